//! The private half of the Python package `lloydar`: work on threads of its own.
//!
//! ```text
//!   lloydar.resample ─► memory ─┐
//!                               ├─► Task ─► wait, reports, cancel, result
//!   lloydar.run, … ───► files ──┘
//! ```
//!
//! No function here waits with the interpreter's lock held, and none calls Python code from another
//! thread: the half in Python starts a [`Task`], looks at it several times a second, and hands on
//! what it reports. So Ctrl-C and exceptions of callbacks work as they do anywhere in Python.

mod failure;
mod files;
mod memory;
mod reports;
mod task;

use std::ffi::OsString;

use pyo3::prelude::*;

use memory::Rings;
use task::Task;

/// Runs the program with `arguments`, the first of which is its name; returns its exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| lloydar::cli::run_process(arguments))
}

#[pymodule]
fn _lloydar(module: &Bound<'_, PyModule>) -> PyResult<()> {
    // What is looked up in NumPy once is looked up now: an interruption in the midst of it, when the
    // first array comes, would be a panic.
    module.py().import("numpy")?;
    numpy::dtype::<f64>(module.py());
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<Task>()?;
    module.add_class::<Rings>()?;
    module.add_function(wrap_pyfunction!(memory::resample, module)?)?;
    module.add_function(wrap_pyfunction!(files::call, module)?)?;
    module.add_function(wrap_pyfunction!(main, module)?)
}
