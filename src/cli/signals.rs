//! Ctrl-C and SIGTERM: they stop a job, and the same command continues it.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::Duration,
};

use super::{exit::STOPPED, printing::say};

/// Whether a signal has arrived. Jobs read it between pieces of work.
pub(super) static CANCEL: AtomicBool = AtomicBool::new(false);

/// How long a job may take to stop by itself after a signal.
const GRACE: Duration = Duration::from_millis(800);

/// Stops the job at the first signal: between two pieces of work, or, after [`GRACE`], in the
/// middle of one, for a job can be killed at any time and continued. The second signal ends
/// the program at once.
pub(super) fn stop_on_signals() {
    let stop = || {
        if CANCEL.swap(true, Ordering::Relaxed) {
            std::process::exit(STOPPED.into());
        }
        say!("stopping; the same command will continue the job");
        std::thread::spawn(|| {
            std::thread::sleep(GRACE);
            std::process::exit(STOPPED.into());
        });
    };
    // Without a handler a signal ends the program, and the job can be continued all the same.
    drop(ctrlc::set_handler(stop));
}
