//! Addresses: what is remote, how it is shown, and what stands beside it.
//!
//! An address may contain secrets: a user with a password before the host, a signature in the query. They are
//! used for requests and for nothing else. What is shown, written or compared is the address without them.

use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};
use url::Url;

/// The schemes of addresses that are remote.
const SCHEMES: [&str; 5] = ["https", "http", "s3", "gs", "az"];

/// Whether `path` is an address of something remote, and not the path of a file.
pub(crate) fn is_remote(path: &Path) -> bool {
    let scheme = path.to_str().and_then(|text| text.split_once("://"));
    scheme.is_some_and(|(scheme, _)| {
        SCHEMES
            .iter()
            .any(|known| scheme.eq_ignore_ascii_case(known))
    })
}

/// The parts of the address `path`; `None` if it is the path of a file, or no valid address.
pub(super) fn parsed(path: &Path) -> Option<Url> {
    is_remote(path)
        .then(|| Url::parse(path.to_str()?).ok())
        .flatten()
}

/// The address or path as it is shown and written: without user, password, query and fragment.
pub(crate) fn without_secrets(path: &Path) -> PathBuf {
    match path.to_str() {
        Some(text) if is_remote(path) => shown(text).into(),
        _ => path.to_owned(),
    }
}

/// Whether the address has a part that is never shown or written.
pub(crate) fn has_secret(path: &Path) -> bool {
    is_remote(path) && without_secrets(path) != path
}

/// Serializes paths and addresses as they are shown.
///
/// # Errors
///
/// The errors of `serializer`.
pub(crate) fn serialize_without_secrets<S: Serializer>(
    paths: &[PathBuf],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let paths: Vec<PathBuf> = paths.iter().map(|path| without_secrets(path)).collect();
    paths.serialize(serializer)
}

/// The text of an address without its secrets, whether it is valid or not.
fn shown(address: &str) -> String {
    let address = address.split(['?', '#']).next().unwrap_or_default();
    let Some((scheme, rest)) = address.split_once("://") else {
        return address.to_owned();
    };
    let (host, path) = match rest.find('/') {
        Some(end) => rest.split_at(end),
        None => (rest, ""),
    };
    let host = host.rsplit('@').next().unwrap_or_default();
    format!("{scheme}://{host}{path}")
}

/// The `text` of an error, with all addresses in it as they are shown, and without what a server added: its pages
/// may repeat keys and signatures.
#[cfg(feature = "remote")]
pub(super) fn redacted(text: &str) -> String {
    let text = text
        .split(['<', '{', '\n', '\r'])
        .next()
        .unwrap_or_default();
    let words = text.split(' ').map(|word| match word.find("://") {
        Some(_) => {
            let closing = word.ends_with([')', '"']);
            format!("{}{}", shown(word), if closing { ")" } else { "" })
        }
        None => word.split('?').next().unwrap_or_default().to_owned(),
    });
    let words: Vec<String> = words.collect();
    words
        .join(" ")
        .trim_end_matches([' ', ':', '-', ','])
        .to_owned()
}

/// The path or address that `reference` names in a file at `base`: it is relative to the directory of that file unless
/// it is absolute.
///
/// # Errors
///
/// A text that says why it names nothing: a file that a remote file cannot know of, or no valid address.
pub(crate) fn joined(base: &Path, reference: &str) -> Result<PathBuf, String> {
    if let Some(path) = reference.strip_prefix("file://") {
        return match is_remote(base) {
            true => Err(
                "names a file of this machine, which a remote catalogue cannot know of".to_owned(),
            ),
            false => Ok(path.into()),
        };
    }
    if is_remote(Path::new(reference)) {
        return Ok(reference.into());
    }
    let Some(address) = parsed(base) else {
        return Ok(base
            .parent()
            .unwrap_or(Path::new(""))
            .join(reference.trim_start_matches("./")));
    };
    if Path::new(reference).is_absolute() {
        return Err(
            "names a file of this machine, which a remote catalogue cannot know of".to_owned(),
        );
    }
    let joined = address
        .join(reference)
        .map_err(|e| format!("is no address: {e}"))?;
    Ok(joined.as_str().into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn secrets_are_not_shown() {
        for (address, expected) in [
            (
                "https://me:word@host:8/a/b.laz?X-Signature=1/2#f",
                "https://host:8/a/b.laz",
            ),
            ("https://host/a@b.laz", "https://host/a@b.laz"),
            ("s3://bucket/a b.laz", "s3://bucket/a b.laz"),
            ("http://u:p@host", "http://host"),
            ("scans/what?.laz", "scans/what?.laz"),
        ] {
            assert_eq!(without_secrets(Path::new(address)), Path::new(expected));
            assert_eq!(
                has_secret(Path::new(address)),
                address != expected,
                "{address}"
            );
        }
        assert!(!is_remote(Path::new("C:/scans/a.laz")) && !is_remote(Path::new("ftp://host/a")));
    }

    #[cfg(feature = "remote")]
    #[test]
    fn what_servers_say_is_shown_without_their_pages_and_without_secrets() {
        let said = "GET https://me:x@host/a.laz?Signature=s3cret failed (https://host/a?key=s3cret) for /a?key=s3cret: \
                    403: <Error><StringToSign>s3cret</StringToSign></Error>";
        let shown = redacted(said);
        assert_eq!(
            shown,
            "GET https://host/a.laz failed (https://host/a) for /a 403"
        );
    }

    #[test]
    fn references_are_relative_to_the_file_that_has_them() {
        let local = |reference| joined(Path::new("data/city.vpc"), reference);
        assert_eq!(local("./a.laz"), Ok("data/a.laz".into()));
        assert_eq!(local("../b.laz"), Ok("data/../b.laz".into()));
        assert_eq!(local("/scans/c.laz"), Ok("/scans/c.laz".into()));
        assert_eq!(local("file:///d.laz"), Ok("/d.laz".into()));
        let remote = |reference| joined(Path::new("https://h/x/y/city.vpc?key=1"), reference);
        assert_eq!(remote("./a.laz"), Ok("https://h/x/y/a.laz".into()));
        assert_eq!(remote("../../../b.laz"), Ok("https://h/b.laz".into()));
        assert_eq!(remote("s3://bucket/c.laz"), Ok("s3://bucket/c.laz".into()));
        assert!(remote("/etc/d.laz").is_err() && remote("file:///d.laz").is_err());
    }
}
