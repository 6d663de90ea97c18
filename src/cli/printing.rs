//! Lines for people: results to standard output, all else to standard error.
//!
//! Nothing panics here. A reader that has had enough (`lloydar info … | head`) is no
//! error; a result that could not be printed is, and is told by the exit code. What
//! cannot be said on standard error cannot be said.

use std::{
    fmt::Arguments,
    io::{self, ErrorKind, Write},
    sync::atomic::{AtomicBool, Ordering},
};

/// Whether a result could not be printed.
static IS_LOST: AtomicBool = AtomicBool::new(false);

/// Prints a line of a result.
macro_rules! result {
    ($($text:tt)*) => { $crate::cli::printing::to_output(format_args!($($text)*)) };
}

/// Prints a line of whatever else is to be said.
macro_rules! say {
    ($($text:tt)*) => { $crate::cli::printing::to_error(format_args!($($text)*)) };
}

pub(super) use {result, say};

pub(super) fn to_output(line: Arguments<'_>) {
    if let Err(error) = writeln!(io::stdout(), "{line}")
        && error.kind() != ErrorKind::BrokenPipe
        && !IS_LOST.swap(true, Ordering::Relaxed)
    {
        say!("lloydar: cannot print the result: {error}");
    }
}

pub(super) fn to_error(line: Arguments<'_>) {
    drop(writeln!(io::stderr(), "{line}"));
}

/// Whether all results were printed, as far as anybody wanted them.
pub(super) fn is_complete() -> bool {
    !IS_LOST.load(Ordering::Relaxed)
}
