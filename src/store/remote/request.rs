//! A request, repeated until it is answered; and what its failures mean.

use std::{io, time::Duration};

use object_store::Error;

use crate::store::address::redacted;

/// How often a request is repeated, after pauses that double from the first to the longest: a minute and a half in all.
const RETRIES: u32 = 8;
const FIRST_PAUSE: Duration = Duration::from_millis(200);
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// Why a request failed.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    /// The kind of the failure.
    pub(super) kind: io::ErrorKind,
    /// What is wrong with the object, as a predicate, and what to do. It contains no secret.
    pub(super) problem: String,
    /// Whether the same request may succeed later.
    pub(super) is_passing: bool,
}

impl Failure {
    pub(super) fn lasting(kind: io::ErrorKind, problem: impl Into<String>) -> Self {
        Self {
            kind,
            problem: problem.into(),
            is_passing: false,
        }
    }

    pub(super) fn passing(problem: impl Into<String>) -> Self {
        Self {
            kind: io::ErrorKind::Interrupted,
            problem: problem.into(),
            is_passing: true,
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        const ACCESS: &str = "access is denied; give the credentials of the store in the environment, or an address whose \
                              signature is still valid";
        match error {
            Error::NotFound { .. } => {
                Self::lasting(io::ErrorKind::NotFound, "there is no such object")
            }
            Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
                Self::lasting(io::ErrorKind::PermissionDenied, ACCESS)
            }
            Error::Precondition { .. } => Self::lasting(io::ErrorKind::InvalidData, CHANGED),
            other => Self::of_text(&other.to_string()),
        }
    }
}

/// The problem of an object whose store says that it is no longer the one that was asked for.
const CHANGED: &str = "has changed while it was read; run again once it is complete";

impl Failure {
    /// The failure that the library of the stores describes by `text`.
    fn of_text(text: &str) -> Self {
        if text.contains("Range request not supported") || text.contains("non-partial response") {
            let problem = "its server does not answer requests for parts of a file; copy the file here, or to a server that \
                           does";
            return Self::lasting(io::ErrorKind::Unsupported, problem);
        }
        if text.contains("Content-Range")
            || text.contains("CONTENT_RANGE")
            || text.contains("Requested ")
        {
            let problem = format!(
                "its server answered with another range than the one it was asked for: {}",
                reason(text)
            );
            return Self::lasting(io::ErrorKind::InvalidData, problem);
        }
        let problem = format!("its server fails: {}", reason(text));
        match status(text) {
            Some(408 | 429 | 500..) | None => Self::passing(problem),
            Some(_) => Self::lasting(io::ErrorKind::Other, problem),
        }
    }
}

/// The status that `text` mentions.
fn status(text: &str) -> Option<u16> {
    let (_, rest) = text.split_once("status code: ")?;
    rest.get(..3)?.parse().ok()
}

/// The last reason in `text`, without secrets.
fn reason(text: &str) -> String {
    redacted(text.rsplit_once(" - ").map_or(text, |(_, reason)| reason))
}

impl From<Failure> for io::Error {
    fn from(failure: Failure) -> Self {
        // A reader would repeat what was interrupted without end.
        let kind = match failure.is_passing {
            true => io::ErrorKind::Other,
            false => failure.kind,
        };
        Self::new(kind, failure.problem)
    }
}

/// Makes `request` until it succeeds, fails for good, or has failed too often.
///
/// # Errors
///
/// The last failure, with the number of tries.
pub(super) async fn repeated<T, F>(request: impl Fn() -> F) -> Result<T, Failure>
where
    F: Future<Output = Result<T, Failure>>,
{
    let mut pause = FIRST_PAUSE;
    for _ in 0..RETRIES {
        match request().await {
            Err(failure) if failure.is_passing => tokio::time::sleep(pause).await,
            other => return other,
        }
        pause = (2 * pause).min(LONGEST_PAUSE);
    }
    request().await.map_err(|failure| Failure {
        problem: match failure.is_passing {
            true => format!(
                "{} ({} requests failed); run again when it can be reached, and the job continues",
                failure.problem,
                RETRIES + 1
            ),
            false => failure.problem,
        },
        ..failure
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_are_told_apart_and_have_no_secrets() {
        let failure = |said: &str| {
            Failure::of_text(&format!(
                "Generic HTTP error: Request error: Error performing GET https://h/a?Signature=s3cret in 1s - {said}"
            ))
        };
        let busy = failure(
            "Server returned non-2xx status code: 503 Service Unavailable: <h1>s3cret</h1>",
        );
        assert!(busy.is_passing);
        assert_eq!(
            busy.problem,
            "its server fails: Server returned non-2xx status code: 503 Service Unavailable"
        );
        assert!(!failure("Server returned non-2xx status code: 400 Bad Request: ").is_passing);
        assert!(failure("HTTP error: connection reset").is_passing);
        let whole = Failure::of_text("Range request not supported by a?Signature=s3cret");
        assert!(!whole.is_passing && whole.problem.contains("parts of a file"));
        for failure in [busy, whole] {
            assert!(!failure.problem.contains("s3cret"));
        }
    }
}
