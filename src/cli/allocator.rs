//! The system's allocator, told to give back what is freed where memory is scarce.

/// A budget (bytes) below which it matters more to hold little than to be a few per cent
/// faster.
const SCARCE: u64 = 2 << 30;

/// Sees to it that what is freed is given back, if the budget is less than [`SCARCE`].
///
/// The C library of most Linux systems keeps what was freed in pieces of up to 32 MiB, for
/// every thread that asked for some: twice what a job holds at a time. A fixed limit, here
/// in bytes, ends that; it can be given in the environment alone, before a program starts. So
/// the program starts itself once more, as the same process. Where that cannot be, it goes on
/// all the same, and takes more.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(super) fn spare(budget: u64) {
    use std::{env, os::unix::process::CommandExt, process::Command};

    const LIMIT: (&str, &str) = ("MALLOC_MMAP_THRESHOLD_", "4194304");
    let mut words = env::args_os();
    if budget < SCARCE
        && env::var_os(LIMIT.0).is_none()
        && let (Ok(program), Some(name)) = (env::current_exe(), words.next())
    {
        let mut again = Command::new(program);
        // It only comes back if it failed.
        let _failed = again.arg0(name).args(words).env(LIMIT.0, LIMIT.1).exec();
    }
}

/// Other allocators do so by themselves.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn spare(_: u64) {}
