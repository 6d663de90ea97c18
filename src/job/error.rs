//! Why a job failed, and the remedy.

use serde::{Deserialize, Serialize};

use crate::{
    config::ConfigError,
    las::{LasError, StoreError},
    store::{is_remote, without_secrets},
    tile::TileError,
    views::ViewError,
};

/// Why a job failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// A setting is out of its range, or a file that it names cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// An input cannot be read, or an output cannot be written.
    #[error(transparent)]
    Las(#[from] LasError),
    /// Inputs cannot be merged into one cloud; each is named with the reason.
    #[error("{} of the inputs cannot be used:\n  {}", .0.len(), .0.join("\n  "))]
    Inputs(Vec<String>),
    /// Inputs cannot be read; each is named with the reason.
    #[error(
        "{} cannot be read:\n{}repair or remove {}; with --on-bad-file skip a job goes on without, if other files are left",
        files(.0.len()),
        .0.iter().map(|bad| format!("  {}: {}\n", bad.path, bad.reason)).collect::<String>(),
        if .0.len() == 1 { "it" } else { "them" }
    )]
    BadFiles(Vec<LeftOut>),
    /// A temporary file cannot be read or written, or the user stopped the job.
    #[error(transparent)]
    Tile(#[from] TileError),
    /// A file of the job directory cannot be read or written.
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// The attempted action.
        action: &'static str,
        /// The path of the file.
        path: String,
        /// The error of the system.
        source: std::io::Error,
    },
    /// Memory or disk are too little for the job; the message says what it needs.
    #[error("{0}")]
    Resources(String),
    /// The job cannot be done as requested; the message says what to change.
    #[error("{0}")]
    Refused(String),
}

/// An input that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// The path of the file.
    pub path: String,
    /// The reason, as a predicate: the file …
    pub reason: String,
}

fn files(count: usize) -> String {
    match count {
        1 => "an input".to_owned(),
        _ => format!("{count} of the inputs"),
    }
}

impl From<ViewError> for JobError {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::Las(error) => Self::Las(error),
            ViewError::Tile(error) => Self::Tile(error),
            other => Self::Refused(other.to_string()),
        }
    }
}

impl JobError {
    pub(super) fn io(action: &'static str, path: &std::path::Path, source: std::io::Error) -> Self {
        Self::Io {
            action,
            path: without_secrets(path).display().to_string(),
            source,
        }
    }

    /// The error that work on temporary files has met: itself, or what it says.
    pub(super) fn of_store(error: StoreError) -> Self {
        match error.downcast::<Self>() {
            Ok(error) => *error,
            Err(error) => match error.downcast::<LasError>() {
                Ok(error) => Self::Las(*error),
                Err(error) => Self::Tile(TileError::of_store(error)),
            },
        }
    }

    /// Whether the settings are wrong, and not the data or the machine.
    pub(crate) fn is_usage(&self) -> bool {
        matches!(self, Self::Config(_))
    }

    /// Whether the same job can continue when the machine allows it.
    pub(super) fn is_resumable(&self) -> bool {
        match self {
            Self::Io { .. } | Self::Tile(_) => true,
            // A store that does not answer today may do so tomorrow.
            Self::BadFiles(bad) => bad.iter().any(|bad| is_remote(bad.path.as_ref())),
            _ => false,
        }
    }

    /// Whether the user stopped the job.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Tile(TileError::Cancelled))
    }
}
