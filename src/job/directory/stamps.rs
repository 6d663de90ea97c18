//! The inputs of a job as they were when it began: half of one that has changed since may have
//! been read before.

use std::path::PathBuf;

use crate::job::{JobError, Survey, directory::Stamp};

/// The inputs of a job as they were when it began.
pub(crate) struct InputStamps(Vec<(PathBuf, Option<Stamp>)>);

impl InputStamps {
    pub(crate) fn of(survey: &Survey) -> Self {
        let inputs = survey.inputs.iter().map(|input| input.path.clone());
        let left_out = survey.left_out.iter().map(|bad| PathBuf::from(&bad.path));
        let mut stamps: Vec<(PathBuf, Option<Stamp>)> = inputs
            .chain(left_out)
            .map(|path| (path.clone(), Stamp::of(&path).ok()))
            .collect();
        stamps.sort_by(|a, b| a.0.cmp(&b.0));
        Self(stamps)
    }

    /// For the identity of the job, which is text.
    pub(crate) fn by_name(&self) -> Vec<(String, Option<Stamp>)> {
        let stamps = self.0.iter();
        stamps
            .map(|(path, stamp)| (path.display().to_string(), *stamp))
            .collect()
    }

    /// Refuses what has changed since: half of it may have been read before.
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
