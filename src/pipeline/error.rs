//! What ends a job, and what to do about it.

use crate::{config::ConfigError, las::LasError, tile::TileError};

/// Why a job failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// The options are wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A scan or an output is.
    #[error(transparent)]
    Las(#[from] LasError),
    /// Several inputs are, each with its reason.
    #[error("{} of the inputs cannot be used:\n  {}", .0.len(), .0.join("\n  "))]
    Inputs(Vec<String>),
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

impl JobError {
    pub(super) fn io(action: &'static str, path: &std::path::Path, source: std::io::Error) -> Self {
        Self::Io {
            action,
            path: path.display().to_string(),
            source,
        }
    }

    /// Whether the options are to blame, and not the data or the machine.
    pub fn is_usage(&self) -> bool {
        matches!(self, Self::Config(_))
    }

    /// Whether the user stopped the job.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, Self::Tile(TileError::Cancelled))
    }
}
