//! The system's allocator, made to return freed memory where the budget is small.

#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(super) use restart::{own_process, return_freed_memory};

/// The C library of most Linux systems. It keeps freed pieces of up to 32 MiB for every thread
/// that allocated some: twice what a job has in use at a time. A fixed limit ends that. It can
/// only be given in the environment, before a program starts; so the program starts itself once
/// more, as the same process. Where that fails, it continues, and takes more memory.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod restart {
    use std::{
        env,
        os::unix::process::CommandExt,
        process::Command,
        sync::atomic::{AtomicBool, Ordering},
    };

    /// A budget (bytes) below which little memory matters more than a few per cent of speed.
    const SMALL_BUDGET_BYTES: u64 = 2 << 30;
    /// The variable that limits the pieces (bytes) that the library keeps.
    const LIMIT: (&str, &str) = ("MALLOC_MMAP_THRESHOLD_", "4194304");

    /// Whether the process runs nothing but this program, and so may be restarted.
    static IS_OWN: AtomicBool = AtomicBool::new(false);

    /// Allows a restart: the executable and the arguments of the process are this program's.
    pub(in crate::cli) fn own_process() {
        IS_OWN.store(true, Ordering::Relaxed);
    }

    /// Makes the allocator return freed memory, if `budget` (bytes) is small.
    pub(in crate::cli) fn return_freed_memory(budget: u64) {
        let mut words = env::args_os();
        if budget < SMALL_BUDGET_BYTES
            && IS_OWN.load(Ordering::Relaxed)
            && env::var_os(LIMIT.0).is_none()
            && let (Ok(program), Some(name)) = (env::current_exe(), words.next())
        {
            let mut again = Command::new(program);
            // `exec` returns only if it fails.
            let _failed = again.arg0(name).args(words).env(LIMIT.0, LIMIT.1).exec();
        }
    }
}

/// Other systems need no restart.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn own_process() {}

/// Other allocators return freed memory by themselves.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) fn return_freed_memory(_: u64) {}
