//! The stamps of the inputs when a job begins.
//!
//! A job reads its inputs over hours, and a resumed job over days. If an input changes meanwhile,
//! part of the old file may have been read already: the job is refused then.

use std::path::PathBuf;

use serde::Serialize;

use super::stamp::Stamp;
use crate::{job::error::JobError, las::InputFile, store::Identity};

/// The inputs of a job with their stamps when it began, in the order of their paths.
pub(crate) struct InputStamps(Vec<Stamped>);

/// An input with its stamp.
struct Stamped {
    path: PathBuf,
    stamp: Option<InputStamp>,
}

/// By what a change of an input is noticed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub(crate) enum InputStamp {
    /// Length and time of a file.
    File(Stamp),
    /// Length and tag of an object.
    Object(Identity),
}

impl InputStamps {
    /// Reads the stamps of `inputs`, and of the files at `left_out`; an unreadable file has none.
    pub(crate) fn of<'a>(
        inputs: impl Iterator<Item = &'a InputFile>,
        left_out: impl Iterator<Item = PathBuf>,
    ) -> Self {
        let of_file = |path: PathBuf| Stamped {
            stamp: Stamp::of(&path).ok().map(InputStamp::File),
            path,
        };
        let of_input = |input: &InputFile| match input.source.identity() {
            Some(identity) => Stamped {
                path: input.path.clone(),
                stamp: Some(InputStamp::Object(identity.clone())),
            },
            None => of_file(input.path.clone()),
        };
        let mut stamps: Vec<Stamped> = inputs.map(of_input).chain(left_out.map(of_file)).collect();
        stamps.sort_by(|a, b| a.path.cmp(&b.path));
        Self(stamps)
    }

    /// The stamps with their paths as text, for the identity of the job.
    pub(crate) fn by_name(&self) -> Vec<(String, Option<InputStamp>)> {
        let stamps = self.0.iter();
        stamps
            .map(|input| (input.path.display().to_string(), input.stamp.clone()))
            .collect()
    }

    /// Checks that no file has changed since the stamps were read. Of an object every answer was compared with its stamp already.
    ///
    /// # Errors
    ///
    /// [`JobError::Refused`] with the path of the first file that has changed.
    pub(crate) fn check(&self) -> Result<(), JobError> {
        let has_changed = |input: &&Stamped| match &input.stamp {
            Some(InputStamp::Object(_)) => false,
            of_file => Stamp::of(&input.path).ok().map(InputStamp::File) != *of_file,
        };
        match self.0.iter().find(has_changed) {
            None => Ok(()),
            Some(input) => Err(JobError::Refused(format!(
                "{} has changed while it was read; run again once it is complete",
                input.path.display()
            ))),
        }
    }
}
