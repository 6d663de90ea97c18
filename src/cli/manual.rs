//! `completions` and `man`: the program described for shells and for `man`.

use std::path::Path;

use clap::CommandFactory;

use super::{arguments::Arguments, exit::DONE, printing::result};
use crate::job::JobError;

/// Prints completions for `shell`.
pub(super) fn print_completions(shell: clap_complete::Shell) -> Result<u8, JobError> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut Arguments::command(), "lloydar", &mut text);
    result!("{}", String::from_utf8_lossy(&text).trim_end());
    Ok(DONE)
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
    Ok(DONE)
}
