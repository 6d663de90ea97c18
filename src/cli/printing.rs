//! Lines of text: results to standard output, messages to standard error.
//!
//! Nothing here panics. A reader that closes the pipe (`lloydar info … | head`) is no error. A
//! result that cannot be printed is one, and the exit code reports it. A message that cannot be
//! printed is lost.

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

/// Prints a line of a message.
macro_rules! say {
    ($($text:tt)*) => { $crate::cli::printing::to_error(format_args!($($text)*)) };
}

pub(super) use {result, say};

/// Prints a line to standard output, and remembers a failure.
pub(super) fn to_output(line: Arguments<'_>) {
    if let Err(error) = writeln!(io::stdout(), "{line}")
        && error.kind() != ErrorKind::BrokenPipe
        && !IS_LOST.swap(true, Ordering::Relaxed)
    {
        say!("lloydar: cannot print the result: {error}");
    }
}

/// Prints a line to standard error.
pub(super) fn to_error(line: Arguments<'_>) {
    drop(writeln!(io::stderr(), "{line}"));
}

/// Returns whether every result was printed that a reader waited for.
pub(super) fn is_complete() -> bool {
    !IS_LOST.load(Ordering::Relaxed)
}
