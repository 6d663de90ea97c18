//! Commands on files: the words of the command line, carried out in the background.

use std::{ffi::OsString, path::PathBuf};

use lloydar::cli;
use pyo3::prelude::*;

use crate::{
    failure::Failure,
    task::{Product, Task},
};

/// Starts the command in `words`, the first of which is the name of the program. `output` is the path
/// that it writes, if any.
#[pyfunction]
#[pyo3(signature = (words, *, output=None, threads=None))]
pub(crate) fn call(
    words: Vec<OsString>,
    output: Option<PathBuf>,
    threads: Option<usize>,
) -> PyResult<Task> {
    Ok(Task::start(threads, move |shared| {
        let result = cli::call(words, &shared.reports, &shared.cancel);
        result
            .map(Product::Json)
            .map_err(|error| Failure::Job(error, output))
    })?)
}
