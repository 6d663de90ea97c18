//! Why a task failed, as an exception of `lloydar`.

use std::path::PathBuf;

use lloydar::{JobError, ResampleError};
use pyo3::{PyErr, import_exception};

import_exception!(lloydar, InputError);
import_exception!(lloydar, InternalError);
import_exception!(lloydar, OptionError);
import_exception!(lloydar, OutputError);
import_exception!(lloydar, RequestError);
import_exception!(lloydar, ResourceError);
import_exception!(lloydar, StoppedError);

/// Why a task failed.
pub(crate) enum Failure {
    /// Points in memory cannot be resampled.
    Resample(ResampleError),
    /// A command on files failed; the path is that of its output, if it has one.
    Job(JobError, Option<PathBuf>),
    /// An option, its value, and what the value must be.
    Option(&'static str, String, String),
    /// This many threads cannot be started, for the reason given.
    Threads(usize, String),
    /// The library is at fault; its message.
    Panic(String),
    /// The result is not there yet, or was taken.
    NoResult,
}

impl Failure {
    /// The failure that `option` has a `value` that is out of range.
    pub(crate) fn option(
        option: &'static str,
        value: impl ToString,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Option(option, value.to_string(), remedy.into())
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Resample(error) => of_points(&error),
            Failure::Job(error, output) => of_files(error, output),
            Failure::Option(option, value, remedy) => {
                OptionError::new_err((format!("{option} {value}: {remedy}"), option))
            }
            Failure::Threads(threads, reason) => {
                ResourceError::new_err(format!("cannot start {threads} threads: {reason}"))
            }
            Failure::Panic(message) => InternalError::new_err(format!(
                "lloydar is at fault, please report this: {message}"
            )),
            Failure::NoResult => InternalError::new_err("the task has no result"),
        }
    }
}

/// Paths with what is wrong with each.
type Files = Vec<(String, String)>;

fn of_points(error: &ResampleError) -> PyErr {
    let text = error.to_string();
    match error {
        ResampleError::InvalidOption { option, .. } => OptionError::new_err((text, *option)),
        ResampleError::InvalidPoint { index, .. } => {
            InputError::new_err((text, Files::new(), *index))
        }
        ResampleError::NoPoints | ResampleError::TooManyPoints { .. } => InputError::new_err(text),
        ResampleError::Cancelled => StoppedError::new_err(text),
        _ => RequestError::new_err(text),
    }
}

fn of_files(error: JobError, output: Option<PathBuf>) -> PyErr {
    let text = error.to_string();
    let is_output = |path: &str| {
        let output = output.as_ref().map(|output| output.display().to_string());
        output.is_some_and(|output| path.starts_with(&output))
    };
    match error {
        error if error.is_cancelled() => StoppedError::new_err(text),
        JobError::Config(_) => OptionError::new_err(text),
        JobError::Las(error) if is_output(&error.path) => {
            OutputError::new_err((text, vec![(error.path, error.problem)]))
        }
        JobError::Las(error) => InputError::new_err((text, vec![(error.path, error.problem)])),
        JobError::Inputs(problems) => {
            let file = |problem: String| match problem.split_once(": ") {
                Some((path, problem)) => (path.to_owned(), problem.to_owned()),
                None => (String::new(), problem),
            };
            InputError::new_err((text, problems.into_iter().map(file).collect::<Files>()))
        }
        JobError::BadFiles(files) => {
            let files = files.into_iter().map(|file| (file.path, file.reason));
            InputError::new_err((text, files.collect::<Files>()))
        }
        JobError::Resources(_) | JobError::Tile(_) => ResourceError::new_err(text),
        JobError::Io { path, .. } if is_output(&path) => OutputError::new_err(text),
        JobError::Io { .. } => ResourceError::new_err(text),
        _ => RequestError::new_err(text),
    }
}
