//! The store of an address, and the threads on which requests run.

use std::{
    io,
    path::Path as FilePath,
    sync::{Arc, OnceLock},
    time::Duration,
};

use object_store::{
    BackoffConfig, ClientConfigKey, ClientOptions, ObjectStore, RetryConfig,
    aws::{AmazonS3Builder, AmazonS3ConfigKey},
    azure::{AzureConfigKey, MicrosoftAzureBuilder},
    gcp::{GoogleCloudStorageBuilder, GoogleConfigKey},
    http::HttpBuilder,
    path::Path,
};
use tokio::runtime::Runtime;
use url::Url;

use crate::store::address::parsed;

/// The threads on which requests run.
const REQUEST_THREADS: usize = 2;
/// How long a connection may take to come about, an answer may pause, and a request may take in all: on a slow line
/// requests wait for each other.
const CONNECT_TIMEOUT: &str = "10s";
const PAUSE_TIMEOUT: &str = "30s";
const REQUEST_TIMEOUT: &str = "1h";
/// How often a request is repeated at once; `request` repeats it more patiently.
const QUICK_RETRIES: usize = 3;
const LONGEST_QUICK_RETRY: Duration = Duration::from_secs(30);

/// An object, and the store that it lies in.
pub(super) struct Located {
    pub(super) store: Arc<dyn ObjectStore>,
    pub(super) path: Path,
}

/// Finds the store of the object at the address `path`. No request is made.
///
/// # Errors
///
/// If the address is not valid, or settings in the environment are not.
pub(super) fn locate(path: &FilePath) -> io::Result<Located> {
    let invalid = |problem: String| io::Error::new(io::ErrorKind::InvalidInput, problem);
    // It chooses the cryptography that clients are built with.
    runtime()?;
    let url = parsed(path).ok_or_else(|| invalid("is no valid address".into()))?;
    if matches!(url.scheme(), "http" | "https") {
        // The address is that of the object, with the query that signs it, and so is the store's.
        let store = HttpBuilder::new()
            .with_url(url)
            .with_client_options(options())
            .with_retry(retries())
            .build();
        let store = store.map_err(|_| invalid("is no valid address".into()))?;
        return Ok(Located {
            store: Arc::new(store),
            path: Path::default(),
        });
    }
    let key = Path::from_url_path(url.path()).map_err(|_| invalid("is no valid address".into()))?;
    let built = match url.scheme() {
        "s3" => s3(&url),
        "gs" => google(&url),
        _ => azure(&url),
    };
    let store = built.map_err(|error| {
        // Errors of settings name the setting, and none has its value.
        invalid(format!(
            "cannot be reached with the settings of the environment: {error}"
        ))
    })?;
    Ok(Located { store, path: key })
}

fn s3(url: &Url) -> object_store::Result<Arc<dyn ObjectStore>> {
    let mut builder = AmazonS3Builder::from_env().with_retry(retries());
    // An endpoint is reached as it says.
    if builder
        .get_config_value(&AmazonS3ConfigKey::Endpoint)
        .is_some_and(|e| e.starts_with("http://"))
    {
        builder = builder.with_allow_http(true);
    }
    for (key, value) in timeouts() {
        builder = builder.with_config(AmazonS3ConfigKey::Client(key), value);
    }
    Ok(Arc::new(
        builder
            .with_bucket_name(url.host_str().unwrap_or_default())
            .build()?,
    ))
}

fn google(url: &Url) -> object_store::Result<Arc<dyn ObjectStore>> {
    let mut builder = GoogleCloudStorageBuilder::from_env().with_retry(retries());
    for (key, value) in timeouts() {
        builder = builder.with_config(GoogleConfigKey::Client(key), value);
    }
    Ok(Arc::new(
        builder
            .with_bucket_name(url.host_str().unwrap_or_default())
            .build()?,
    ))
}

fn azure(url: &Url) -> object_store::Result<Arc<dyn ObjectStore>> {
    let mut builder = MicrosoftAzureBuilder::from_env().with_retry(retries());
    for (key, value) in timeouts() {
        builder = builder.with_config(AzureConfigKey::Client(key), value);
    }
    Ok(Arc::new(
        builder
            .with_container_name(url.host_str().unwrap_or_default())
            .build()?,
    ))
}

fn timeouts() -> [(ClientConfigKey, &'static str); 3] {
    [
        (ClientConfigKey::ConnectTimeout, CONNECT_TIMEOUT),
        (ClientConfigKey::ReadTimeout, PAUSE_TIMEOUT),
        (ClientConfigKey::Timeout, REQUEST_TIMEOUT),
    ]
}

fn options() -> ClientOptions {
    let options = ClientOptions::new().with_allow_http(true);
    timeouts()
        .into_iter()
        .fold(options, |options, (key, value)| {
            options.with_config(key, value)
        })
}

fn retries() -> RetryConfig {
    RetryConfig {
        backoff: BackoffConfig::default(),
        max_retries: QUICK_RETRIES,
        retry_timeout: LONGEST_QUICK_RETRY,
    }
}

/// The threads on which requests run, started when they are first needed.
///
/// # Errors
///
/// If they cannot be started.
pub(super) fn runtime() -> io::Result<&'static Runtime> {
    static RUNTIME: OnceLock<io::Result<Runtime>> = OnceLock::new();
    let runtime = RUNTIME.get_or_init(|| {
        // If a program around this library has chosen another one, that stays.
        drop(rustls::crypto::ring::default_provider().install_default());
        tokio::runtime::Builder::new_multi_thread()
            .worker_threads(REQUEST_THREADS)
            .thread_name("requests")
            .enable_all()
            .build()
    });
    runtime
        .as_ref()
        .map_err(|error| io::Error::new(error.kind(), error.to_string()))
}
