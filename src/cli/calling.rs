//! Commands called by a program: words in, JSON out, without a terminal or an exit code.
//!
//! A package for another language translates its keywords to the words of the command line, so that
//! it has every option of the program, reads each as the program does, and gives the same bytes.

use std::{ffi::OsString, path::Path, sync::atomic::AtomicBool};

use clap::Parser;
use serde::Serialize;

use super::{
    arguments::{Arguments, Command},
    comparing, inspecting, measuring,
    proposing::{chosen_job, chosen_plan},
    rendering, report_no_panics_of_decoders,
    running::{REPORT_FIGURES, run_and_report, with_ending},
    simulating,
};
use crate::{
    config::ConfigError,
    job::{JobDescription, JobError, Progress},
    las::{InputFile, PointFilter, expand_inputs},
};

/// Carries out the command in `words`, the first of which is the name of the program, and returns
/// its result as JSON: what the command prints with `--json`, and for `run` the report's figures.
///
/// `run` and `plan` report to `progress`, and end soon after `cancel` is set.
///
/// # Errors
///
/// See [`JobError`]. Words that are no command, or one that has no result, are
/// [`JobError::Config`].
pub fn call(
    words: impl IntoIterator<Item = OsString>,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Result<String, JobError> {
    report_no_panics_of_decoders();
    let arguments = Arguments::try_parse_from(words);
    let arguments = arguments.map_err(|error| ConfigError::Words(reason(&error)))?;
    match arguments.command {
        Command::Run {
            scans,
            output,
            restart,
        } => {
            let job = JobDescription {
                restart,
                ..chosen_job(&scans, output.as_deref(), progress, cancel)?.job
            };
            match run_and_report(&job, progress, cancel, None)? {
                Some(done) => Ok(done.report.to_json()),
                None => figures_beside(&job.output),
            }
        }
        Command::Plan { scans, output, .. } => {
            let chosen = chosen_plan(&scans, output.as_deref(), progress, cancel)?;
            Ok(json(&chosen.plan(progress, cancel)?))
        }
        Command::Measure(arguments) => Ok(json(&measuring::measured(&arguments)?)),
        Command::Compare(arguments) => Ok(json(&comparing::compared(&arguments)?)),
        Command::Render(arguments) => rendering::draw(&arguments).map(|_| json(&())),
        Command::Simulate { street, output } => {
            Ok(json(&simulating::write_simulation(&street, &output)?))
        }
        Command::Info { files, .. } => {
            let header = |path: &Path| Ok(inspecting::as_json(&InputFile::survey(path)?));
            let paths = expand_inputs(&files.paths()?, &PointFilter::default())?;
            let headers: Result<Vec<_>, JobError> = paths.iter().map(|path| header(path)).collect();
            Ok(json(&headers?))
        }
        _ => Err(ConfigError::Words("this command has no result in JSON".to_owned()).into()),
    }
}

/// Returns what is wrong with the words of a command, without usage and hints for a terminal.
fn reason(error: &clap::Error) -> String {
    let text = error.to_string();
    let first = text.split("\n\n").next().unwrap_or_default();
    first.trim_start_matches("error: ").trim().to_owned()
}

/// Returns the figures that an earlier run wrote beside `output`.
fn figures_beside(output: &Path) -> Result<String, JobError> {
    let path = with_ending(output, REPORT_FIGURES);
    std::fs::read_to_string(&path).map_err(|source| JobError::Io {
        action: "read",
        path: path.display().to_string(),
        source,
    })
}

/// Returns `result` as JSON.
fn json(result: &impl Serialize) -> String {
    serde_json::to_string(result).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Quiet;

    fn called(words: &[&str]) -> Result<String, JobError> {
        let words = ["lloydar"].iter().chain(words).map(OsString::from);
        call(words, &Quiet, &AtomicBool::new(false))
    }

    #[test]
    fn words_that_cannot_be_read_are_refused_with_the_reason() {
        let error = called(&["run", "scan.laz", "--seeds=none"]).unwrap_err();
        assert!(error.is_usage());
        let text = error.to_string();
        assert!(
            text.starts_with("invalid value 'none' for '--seeds"),
            "{text}"
        );
        assert!(!text.contains('\n') && text.contains("hexagonal"), "{text}");
        assert!(called(&["completions", "bash"]).unwrap_err().is_usage());
        assert!(called(&["run", "--help"]).unwrap_err().is_usage());
    }

    #[test]
    fn a_simulated_street_is_described_and_measured_in_json() {
        let dir = tempfile::tempdir().unwrap();
        let street = dir.path().join("street");
        let street = street.to_str().unwrap();
        let scans = called(&["simulate", "--points=20K", "--length=20", "-o", street]);
        assert_eq!(scans.unwrap().matches("pass-").count(), 2);
        let headers = called(&["info", street]).unwrap();
        assert_eq!(headers.matches("\"points\":").count(), 2);
        assert!(called(&["measure", street]).unwrap().contains("\"delta\":"));
    }
}
