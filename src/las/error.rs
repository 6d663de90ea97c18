//! The error of everything that reads or writes point clouds.

use std::{fmt::Display, path::Path};

use crate::store::without_secrets;

/// A point cloud that cannot be read or written. The message begins with the file's path.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {problem}")]
pub struct LasError {
    /// The path of the file.
    pub path: String,
    /// What is wrong with the file, with the numbers, and what to do.
    pub problem: String,
}

impl LasError {
    /// The error that the file at `path` has this `problem`.
    pub(crate) fn new(path: &Path, problem: impl Into<String>) -> Self {
        Self {
            path: without_secrets(path).display().to_string(),
            problem: problem.into(),
        }
    }

    /// The error that the file at `path` cannot be read because of `cause`.
    pub(super) fn unreadable(path: &Path, cause: impl Display) -> Self {
        Self::new(path, format!("cannot be read: {cause}"))
    }

    /// The error that the file at `path` cannot be written because of `cause`.
    pub(super) fn unwritable(path: &Path, cause: impl Display) -> Self {
        Self::new(path, format!("cannot be written: {cause}"))
    }
}
