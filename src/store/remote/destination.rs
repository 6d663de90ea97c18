//! A place in a store for a file: the object is complete under its name, or not there.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use bytes::Bytes;
use object_store::{GetOptions, MultipartUpload, ObjectStoreExt};
use tokio::task::{JoinError, JoinSet};

use super::{
    client::{Located, locate, runtime},
    request::{Failure, repeated},
};

/// The bytes of a part of an upload; stores take at most 10 000 parts.
const PART_BYTES: u64 = 8 << 20;
/// The most parts of an upload.
const MOST_PARTS: u64 = 10_000;
/// The parts that are in flight at once.
const PARTS_IN_FLIGHT: usize = 4;

/// A place in a store for a file.
pub(crate) struct Destination(Located);

impl std::fmt::Debug for Destination {
    /// Shows no secret.
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(out, "Destination({})", self.0.path)
    }
}

impl Destination {
    /// The place at the address `path`. No request is made.
    ///
    /// # Errors
    ///
    /// If the address is not valid, or is that of a web server: one that breaks off would leave a part of the file.
    pub(crate) fn of(path: &Path) -> io::Result<Self> {
        let located = locate(path)?;
        match located.path.as_ref().is_empty() {
            true => Err(io::Error::new(
                io::ErrorKind::Unsupported,
                "cannot be written to; outputs are files, or objects of s3://, gs:// or az://, with a bucket and a name",
            )),
            false => Ok(Self(located)),
        }
    }

    /// Whether there is an object.
    ///
    /// # Errors
    ///
    /// If the store does not say so: without access it is known before the work begins.
    pub(crate) fn exists(&self) -> io::Result<bool> {
        let head = || async {
            let options = GetOptions {
                head: true,
                ..GetOptions::default()
            };
            self.0
                .store
                .get_opts(&self.0.path, options)
                .await
                .map_err(Failure::from)
        };
        match runtime()?.block_on(repeated(head)) {
            Ok(_) => Ok(true),
            Err(failure) if failure.kind == io::ErrorKind::NotFound => Ok(false),
            Err(failure) => Err(failure.into()),
        }
    }

    /// Copies the file at `file` to the place, unless `is_cancelled`. Whatever fails, there is no part of it under the name.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, the store does not take it, or the upload is cancelled.
    pub(crate) fn upload(&self, file: &Path, is_cancelled: &dyn Fn() -> bool) -> io::Result<()> {
        let mut file = File::open(file)?;
        let bytes = file.metadata()?.len();
        let Located { store, path } = &self.0;
        runtime()?.block_on(async {
            if bytes <= PART_BYTES {
                let mut content = Vec::new();
                file.read_to_end(&mut content)?;
                let content = Bytes::from(content);
                let put = || async {
                    store
                        .put(path, content.clone().into())
                        .await
                        .map_err(Failure::from)
                };
                return Ok(repeated(put).await.map(|_| ())?);
            }
            let begin = || async { store.put_multipart(path).await.map_err(Failure::from) };
            let mut upload = repeated(begin).await?;
            let sent = send(&mut file, bytes, &mut *upload, is_cancelled).await;
            if sent.is_err() {
                drop(upload.abort().await);
            }
            sent
        })
    }
}

/// Sends the `bytes` of `file` in parts, and completes the upload.
async fn send(
    file: &mut File,
    bytes: u64,
    upload: &mut dyn MultipartUpload,
    is_cancelled: &dyn Fn() -> bool,
) -> io::Result<()> {
    let part = PART_BYTES.max(bytes.div_ceil(MOST_PARTS));
    let mut in_flight = JoinSet::new();
    let done = |part: Option<Result<object_store::Result<()>, JoinError>>| match part {
        None | Some(Ok(Ok(()))) => Ok(()),
        Some(Ok(Err(error))) => Err(io::Error::from(Failure::from(error))),
        Some(Err(error)) => Err(io::Error::other(error)),
    };
    loop {
        if is_cancelled() {
            return Err(io::Error::other("the upload was stopped"));
        }
        let mut content = Vec::new();
        file.take(part).read_to_end(&mut content)?;
        if content.is_empty() {
            break;
        }
        in_flight.spawn(upload.put_part(Bytes::from(content).into()));
        if in_flight.len() >= PARTS_IN_FLIGHT {
            done(in_flight.join_next().await)?;
        }
    }
    while !in_flight.is_empty() {
        done(in_flight.join_next().await)?;
    }
    upload.complete().await.map_err(Failure::from)?;
    Ok(())
}
