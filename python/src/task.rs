//! Work on a thread of its own, in a thread pool of its own.
//!
//! The pool is made for each task: threads do not survive a `fork`, and a pool that the process
//! shares would leave the child waiting for ever. It takes a tenth of a millisecond.

use std::{
    any::Any,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use lloydar::Resampled;
use pyo3::{prelude::*, types::PyDict};
use rayon::ThreadPoolBuilder;

use crate::{failure::Failure, memory::cloud_of, reports::Reports};

/// The greatest number of threads.
const MAX_THREADS: usize = 1024;

/// The stack of a thread: as much as the program has, which does some of the work in its first thread.
const STACK_BYTES: usize = 8 << 20;

/// What a task gives.
pub(crate) enum Product {
    /// Points in memory.
    Cloud(Box<Resampled>),
    /// The result of a command, as JSON.
    Json(String),
}

/// What the task and its thread share.
pub(crate) struct Shared {
    /// Whether the work is to stop.
    pub(crate) cancel: AtomicBool,
    /// What the work reports.
    pub(crate) reports: Reports,
    state: Mutex<State>,
    ended: Condvar,
}

enum State {
    Working,
    Ended(Result<Product, Failure>),
    Taken,
}

impl Shared {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Work in the background. It is cancelled when nobody can wait for it any more.
#[pyclass(frozen, module = "lloydar._lloydar")]
pub(crate) struct Task(Arc<Shared>);

impl Task {
    /// Starts `work` on `threads` threads, one per core if none are given.
    ///
    /// # Errors
    ///
    /// If the threads cannot be started. A panic of `work` is the failure of the task.
    pub(crate) fn start(
        threads: Option<usize>,
        work: impl FnOnce(&Shared) -> Result<Product, Failure> + Send + 'static,
    ) -> Result<Self, Failure> {
        let cores = || thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let threads = threads.unwrap_or_else(cores);
        if !(1..=MAX_THREADS).contains(&threads) {
            return Err(Failure::option(
                "threads",
                threads,
                "must be from 1 to 1024",
            ));
        }
        let refused = |e: &dyn ToString| Failure::Threads(threads, e.to_string());
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .stack_size(STACK_BYTES);
        let pool = pool.build();
        let pool = pool.map_err(|e| refused(&e))?;
        let shared = Arc::new(Shared {
            cancel: AtomicBool::new(false),
            reports: Reports::default(),
            state: Mutex::new(State::Working),
            ended: Condvar::new(),
        });
        let of_thread = Arc::clone(&shared);
        let body = move || {
            let work = || pool.install(|| work(&of_thread));
            let result = catch_unwind(AssertUnwindSafe(work));
            let result = result.unwrap_or_else(|panic| Err(Failure::Panic(message(&*panic))));
            *of_thread.state() = State::Ended(result);
            of_thread.ended.notify_all();
        };
        let started = thread::Builder::new()
            .name("lloydar".to_owned())
            .spawn(body);
        started.map_err(|e| refused(&e))?;
        Ok(Self(shared))
    }
}

#[pymethods]
impl Task {
    /// Waits until the work has ended, for at most `seconds`; returns whether it has.
    fn wait(&self, py: Python<'_>, seconds: f64) -> bool {
        let shared = &*self.0;
        py.detach(|| {
            let timeout = Duration::try_from_secs_f64(seconds).unwrap_or_default();
            let is_working = |state: &mut State| matches!(state, State::Working);
            let waited = shared
                .ended
                .wait_timeout_while(shared.state(), timeout, is_working);
            let (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
            !matches!(*state, State::Working)
        })
    }

    /// Asks the work to stop; it does at its next step.
    fn cancel(&self) {
        self.0.cancel.store(true, Ordering::Relaxed);
    }

    /// Returns what the work does at the moment, and what it has noted since the last call.
    fn reports<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
        let (standing, notes) = self.0.reports.take();
        Ok((standing.into_dict(py)?, notes))
    }

    /// Returns what the work gave, once, or raises why it failed.
    fn result<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match std::mem::replace(&mut *self.0.state(), State::Taken) {
            State::Ended(Ok(Product::Cloud(cloud))) => cloud_of(py, *cloud),
            State::Ended(Ok(Product::Json(text))) => Ok(text.into_pyobject(py)?.into_any()),
            State::Ended(Err(failure)) => Err(failure.into()),
            State::Working | State::Taken => Err(Failure::NoResult.into()),
        }
    }
}

impl Drop for Task {
    fn drop(&mut self) {
        self.cancel();
    }
}

/// Returns the message of a panic.
fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "no message".to_owned())
}
