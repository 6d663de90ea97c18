//! What ends a job, and what to do about it.

use serde::{Deserialize, Serialize};

use crate::{config::ConfigError, las::LasError, tile::TileError, views::ViewError};

/// Why a job failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum JobError {
    /// The options are wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A scan or an output is.
    #[error(transparent)]
    Las(#[from] LasError),
    /// Several inputs are, each with its reason.
    #[error("{} of the inputs cannot be used:\n  {}", .0.len(), .0.join("\n  "))]
    Inputs(Vec<String>),
    /// Inputs cannot be read, each with its reason.
    #[error(
        "{} cannot be read:\n{}repair or remove {}, or give --on-bad-file skip to go on without",
        files(.0.len()),
        .0.iter().map(|bad| format!("  {}: {}\n", bad.path, bad.reason)).collect::<String>(),
        if .0.len() == 1 { "it" } else { "them" }
    )]
    BadFiles(Vec<LeftOut>),
    /// A temporary file is.
    #[error(transparent)]
    Tile(#[from] TileError),
    /// A file of the job directory cannot be read or written.
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: String,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The job cannot be done as asked; the message says what would do.
    #[error("{0}")]
    Refused(String),
}

/// An input that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct LeftOut {
    /// The file, as text.
    pub(crate) path: String,
    /// What is wrong with it.
    pub(crate) reason: String,
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
            path: path.display().to_string(),
            source,
        }
    }

    /// Whether the options are to blame, and not the data or the machine.
    pub(crate) fn is_usage(&self) -> bool {
        matches!(self, Self::Config(_))
    }

    /// Whether the same job can go on, once the machine lets it.
    pub(super) fn is_resumable(&self) -> bool {
        matches!(self, Self::Io { .. } | Self::Tile(_))
    }

    /// Whether the user stopped the job.
    pub(crate) fn is_cancelled(&self) -> bool {
        matches!(self, Self::Tile(TileError::Cancelled))
    }
}
