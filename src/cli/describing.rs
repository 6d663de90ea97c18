//! What the program says of itself: options and where they come from, completions, the
//! manual page.

use std::path::Path;

use crate::{config::Choices, job::JobError};
use clap::Args;

use super::{Arguments, CommandFactory, printing::result};

/// Prints the options of a job as TOML. Those that nobody chose are comments, with what is
/// done then.
pub(super) fn print_config(file: Option<&Path>, flags: Choices) -> Result<u8, JobError> {
    let of_file = match file {
        Some(path) => Choices::from_file(path)?,
        None => Choices::default(),
    };
    let from_file = table(&of_file);
    let from_flags = table(&flags);
    let chosen = table(&flags.or(of_file));
    let options = Choices::augment_args(clap::Command::new("options"));
    for option in options.get_arguments() {
        let Some(name) = option.get_long() else {
            continue;
        };
        let help = option
            .get_help()
            .map(ToString::to_string)
            .unwrap_or_default();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        let (help, default) = match help.split_once(" [default: ") {
            Some((help, default)) => (help, default.trim_end_matches(']')),
            None => (help.as_str(), "not set"),
        };
        result!("# {help}");
        match chosen.get(name) {
            Some(value) => {
                let origin = match (from_flags.contains_key(name), file) {
                    (false, Some(path)) if from_file.contains_key(name) => {
                        path.display().to_string()
                    }
                    _ => "command line".to_owned(),
                };
                result!("{name} = {value}  # from {origin}");
            }
            None => result!("# {name}: {default}"),
        }
    }
    Ok(0)
}

fn table(choices: &Choices) -> toml::Table {
    toml::Table::try_from(choices).unwrap_or_default()
}

/// The flags that make these choices.
pub(super) fn flags(choices: &Choices) -> Vec<String> {
    let text = |value: &toml::Value| match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let mut flags = Vec::new();
    for (name, value) in table(choices) {
        match value {
            toml::Value::Boolean(true) => flags.push(format!("--{name}")),
            toml::Value::Boolean(false) => {}
            toml::Value::Array(items) => {
                let items: Vec<String> = items.iter().map(text).collect();
                flags.push(format!("--{name}={}", items.join(",")));
            }
            one => flags.push(format!("--{name}={}", text(&one))),
        }
    }
    flags
}

pub(super) fn print_completions(shell: clap_complete::Shell) -> Result<u8, JobError> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "lloydar", &mut text);
    result!("{}", String::from_utf8_lossy(&text).trim_end());
    Ok(0)
}

/// Writes a manual page for the program and each of its commands into the directory `dir`.
pub(super) fn write_manual(dir: &Path) -> Result<u8, JobError> {
    let written = std::fs::create_dir_all(dir)
        .and_then(|()| clap_mangen::generate_to(Arguments::command(), dir));
    written.map_err(|source| JobError::Io {
        action: "write",
        path: dir.display().to_string(),
        source,
    })?;
    Ok(0)
}

#[cfg(test)]
mod tests {
    use clap::FromArgMatches;

    use super::*;

    #[test]
    fn flags_make_the_choices_that_they_were_made_of() {
        let said = [
            "--spacing=5cm",
            "--memory=1GiB",
            "--keep-class=2,6",
            "--with=normals,area",
            "--bounds=-1,-2,3.5,4",
            "--overwrite",
            "--patch=plane",
            "--ratio=2%",
            "--polygon=a b.wkt",
        ];
        let parsed = |flags: &[String]| {
            let options = Choices::augment_args(clap::Command::new("options").no_binary_name(true));
            Choices::from_arg_matches(&options.get_matches_from(flags)).unwrap()
        };
        let choices = parsed(&said.map(str::to_owned));
        assert_eq!(parsed(&flags(&choices)), choices);
    }
}
