//! What goes wrong with temporary files, and what to do about it.

use std::{io, path::Path};

use super::source::SourceError;
use crate::las::StoreError;

/// The remedy for a job directory that cannot be used: it names the commands that have the option, because all that work in the
/// directory say it.
pub(crate) const BEGIN_ANEW: &str = "`lloydar run` or `lloydar scatter` begins anew with --restart, or elsewhere with another --job";

/// Why temporary files cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TileError {
    /// A file could not be read or written.
    #[error("cannot {action} {path}: {source}{}", remedy(source))]
    Io {
        /// The action that failed, as an infinitive: "read", "write to".
        action: &'static str,
        /// The path of the file.
        path: String,
        /// The reason given by the operating system.
        source: io::Error,
    },
    /// The content of a temporary file is not what was written.
    #[error("{path} is damaged or of another version; {BEGIN_ANEW}")]
    Damaged {
        /// The path of the file.
        path: String,
    },
    /// Sources of points failed: the index of each, and the reason.
    #[error("{}", .0.iter().map(|(_, why)| why.to_string()).collect::<Vec<_>>().join("\n"))]
    Sources(Vec<(usize, SourceError)>),
    /// The user has stopped the program.
    #[error("stopped; the same command goes on from here")]
    Cancelled,
}

fn remedy(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull => {
            "; free some space, or put the job on another disk with --job"
        }
        io::ErrorKind::PermissionDenied => "; choose a place you may write to with --job",
        _ => "",
    }
}

impl TileError {
    /// Reports that the operating system refused `action` on the file at `path`.
    pub(crate) fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io {
            action,
            path: path.display().to_string(),
            source,
        }
    }

    /// Reports that the file at `path` could not be read: that it is damaged if it ends too early.
    pub(super) fn unreadable(path: &Path, source: io::Error) -> Self {
        match source.kind() {
            io::ErrorKind::UnexpectedEof => Self::damaged(path),
            _ => Self::io("read", path, source),
        }
    }

    /// The error that work on temporary files has met: itself, or what it says.
    pub(crate) fn of_store(error: StoreError) -> Self {
        match error.downcast::<Self>() {
            Ok(error) => *error,
            Err(error) => Self::Io {
                action: "use",
                path: "temporary files".to_owned(),
                source: io::Error::other(error),
            },
        }
    }

    /// Reports that the content of the file at `path` is not what was written.
    pub(crate) fn damaged(path: &Path) -> Self {
        Self::Damaged {
            path: path.display().to_string(),
        }
    }
}
