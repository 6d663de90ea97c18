//! The system's allocator, made to return freed memory where the budget is small.
//!
//! The C library of most Linux systems keeps freed pieces of up to 32 MiB for every thread that
//! allocated some: twice what a job has in use at a time. A fixed limit and one heap for all
//! threads end that: small tiles one after the other took 169 MiB where they took 210, in the same
//! time. The limit is low, because a heap that is empty but for its last piece is not returned: after
//! the scatter of 5.8 M points 62 MiB were left with a limit of 64 KiB, and 87 MiB with one of 1 MiB.
//! Both can only be given in the environment, before a program starts; so the program starts
//! itself once more, as the same process. Where that fails, it continues, and takes more memory.
//! Other allocators return freed memory by themselves.

use std::sync::atomic::{AtomicBool, Ordering};

/// A budget (bytes) below which little memory matters more than a few per cent of speed.
const SMALL_BUDGET_BYTES: u64 = 2 << 30;

/// The budget over the largest piece that the C library keeps: 64 KiB of a budget of 256 MiB. Larger pieces are returned, and the
/// system has to clear each that replaces one.
const BUDGET_PER_PIECE: u64 = 4096;

/// Whether the process runs nothing but this program, and so may be restarted.
static IS_OWN_PROCESS: AtomicBool = AtomicBool::new(false);

/// Allows a restart: the executable and the arguments of the process are this program's.
pub(super) fn own_process() {
    IS_OWN_PROCESS.store(true, Ordering::Relaxed);
}

/// Makes the allocator return freed memory, if `budget` (bytes) is small.
pub(super) fn return_freed_memory(budget: u64) {
    if budget < SMALL_BUDGET_BYTES && IS_OWN_PROCESS.load(Ordering::Relaxed) {
        restart_with_limit(budget / BUDGET_PER_PIECE);
    }
}

/// Starts the program again with one heap, and a `limit` (bytes) on the pieces that the C library keeps.
/// Returns if it has been started so, or cannot be.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
fn restart_with_limit(limit: u64) {
    use std::{env, os::unix::process::CommandExt, process::Command};

    const LIMIT: &str = "MALLOC_MMAP_THRESHOLD_";
    const HEAPS: &str = "MALLOC_ARENA_MAX";
    let mut words = env::args_os();
    if env::var_os(LIMIT).is_none()
        && let (Ok(program), Some(name)) = (env::current_exe(), words.next())
    {
        let mut again = Command::new(program);
        // `exec` returns only if it fails.
        let again = again.arg0(name).args(words);
        let _failed = again.env(LIMIT, limit.to_string()).env(HEAPS, "1").exec();
    }
}

#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
fn restart_with_limit(_limit: u64) {}
