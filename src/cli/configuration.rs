//! `config`: the options of a job, each with the origin of its value.

use std::path::Path;

use clap::Args;

use super::{
    exit::DONE,
    options::{JobOptions, choices_in, table},
    printing::result,
};
use crate::{config::Choices, job::JobError};

/// Prints the options of a job as TOML. Options that nobody chose are comments that state the
/// default.
pub(super) fn print_config(file: Option<&Path>, flags: &JobOptions) -> Result<u8, JobError> {
    let from_file = match file {
        Some(path) => table(&choices_in(path)?),
        None => table(&Choices::default()),
    };
    let from_flags = flags.table();
    let chosen = table(&flags.choices(file)?);
    let options = JobOptions::augment_args(clap::Command::new("options"));
    for option in options.get_arguments() {
        let Some(name) = option.get_long() else {
            continue;
        };
        let help = option.get_help().map(ToString::to_string);
        let help = help.unwrap_or_default();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        let (help, default) = match help.split_once(" [default: ") {
            Some((help, default)) => (help, default.trim_end_matches(']')),
            None => (help.as_str(), "not set"),
        };
        result!("# {help}");
        match (chosen.get(name), file) {
            (None, _) => result!("# {name}: {default}"),
            (Some(value), Some(path))
                if from_file.contains_key(name) && !from_flags.contains_key(name) =>
            {
                result!("{name} = {value}  # from {}", path.display());
            }
            (Some(value), _) => result!("{name} = {value}  # from command line"),
        }
    }
    Ok(DONE)
}
