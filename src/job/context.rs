//! The context of a run: what every stage works with, made once.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    thread,
};

use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{
    description::JobDescription,
    error::JobError,
    progress::Progress,
    resources::{Budget, Clock, Forecast},
};
use crate::tile::TileError;

/// The context of a run.
pub(crate) struct RunContext<'a> {
    /// The job.
    pub(crate) job: &'a JobDescription,
    /// Memory and threads of the job.
    pub(crate) budget: Budget,
    /// The threads that compute.
    pub(crate) pool: ThreadPool,
    /// The listener to the run, which also estimates the remaining time.
    pub(crate) progress: &'a Forecast<'a>,
    /// The user sets this to stop the run.
    pub(crate) cancel: &'a AtomicBool,
    /// Times the stages, and samples memory and disk.
    pub(crate) clock: Clock,
}

impl RunContext<'_> {
    /// Runs `work` on `job` with `threads` threads. Until it returns, `progress` receives reports
    /// of memory and remaining time.
    ///
    /// # Errors
    ///
    /// The errors of `work`; [`JobError::Refused`] if the threads cannot be started.
    pub(crate) fn with<T>(
        job: &JobDescription,
        threads: usize,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        work: impl FnOnce(&RunContext<'_>) -> Result<T, JobError>,
    ) -> Result<T, JobError> {
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| JobError::Refused(format!("cannot start {threads} threads: {e}")))?;
        let budget = job.budget();
        let forecast = &Forecast::new(progress);
        thread::scope(|scope| {
            let clock = Clock::start(scope, &job.dir, budget.total, forecast);
            work(&RunContext {
                job,
                budget,
                pool,
                progress: forecast,
                cancel,
                clock,
            })
        })
    }

    /// Checks that the user has not stopped the run.
    ///
    /// # Errors
    ///
    /// [`TileError::Cancelled`] if the user has.
    pub(crate) fn check_cancelled(&self) -> Result<(), JobError> {
        match self.cancel.load(Ordering::Relaxed) {
            true => Err(JobError::Tile(TileError::Cancelled)),
            false => Ok(()),
        }
    }
}
