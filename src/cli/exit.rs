//! Exit codes, as the README documents them.

use crate::job::JobError;

/// Everything that was requested is done.
pub(super) const DONE: u8 = 0;
/// Something failed; a message says what.
pub(super) const FAILED: u8 = 1;
/// The arguments cannot be used.
pub(super) const USAGE: u8 = 2;
/// The output is complete but for points or inputs that had to be left out.
pub(super) const INCOMPLETE: u8 = 3;
/// A signal stopped the job; the same command continues it.
pub(super) const STOPPED: u8 = 130;

/// Returns the code of a program that ends with `error`.
pub(super) fn code_of(error: &JobError) -> u8 {
    if error.is_usage() {
        USAGE
    } else if error.is_cancelled() {
        STOPPED
    } else {
        FAILED
    }
}
