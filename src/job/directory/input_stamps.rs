//! The stamps of the inputs when a job begins.
//!
//! A job reads its inputs over hours, and a resumed job over days. If an input changes meanwhile,
//! part of the old file may have been read already: the job is refused then.

use std::path::PathBuf;

use super::stamp::Stamp;
use crate::job::error::JobError;

/// The inputs of a job with their stamps when it began, in the order of their paths.
pub(crate) struct InputStamps(Vec<(PathBuf, Option<Stamp>)>);

impl InputStamps {
    /// Reads the stamps of the files at `paths`; an unreadable file has none.
    pub(crate) fn of(paths: impl Iterator<Item = PathBuf>) -> Self {
        let mut stamps: Vec<(PathBuf, Option<Stamp>)> = paths
            .map(|path| (path.clone(), Stamp::of(&path).ok()))
            .collect();
        stamps.sort_by(|a, b| a.0.cmp(&b.0));
        Self(stamps)
    }

    /// The stamps with their paths as text, for the identity of the job.
    pub(crate) fn by_name(&self) -> Vec<(String, Option<Stamp>)> {
        let stamps = self.0.iter();
        stamps
            .map(|(path, stamp)| (path.display().to_string(), *stamp))
            .collect()
    }

    /// Checks that no input has changed since the stamps were read.
    ///
    /// # Errors
    ///
    /// [`JobError::Refused`] with the path of the first input that has changed.
    pub(crate) fn check(&self) -> Result<(), JobError> {
        let has_changed =
            |(path, stamp): &&(PathBuf, Option<Stamp>)| Stamp::of(path).ok() != *stamp;
        match self.0.iter().find(has_changed) {
            Some((path, _)) => Err(JobError::Refused(format!(
                "{} has changed while it was read; run again once it is complete",
                path.display()
            ))),
            None => Ok(()),
        }
    }
}
