//! A file that remembers its first failure.

use std::{
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
    sync::{Arc, Mutex, PoisonError},
};

/// The first failure of a sink; the sink and its monitor share it.
#[derive(Clone, Default)]
struct Failure(Arc<Mutex<FailureState>>);

#[derive(Default)]
struct FailureState {
    first: Option<io::Error>,
    is_stopped: bool,
}

impl Failure {
    fn with<T>(&self, f: impl FnOnce(&mut FailureState) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn is_stopped(&self) -> bool {
        self.with(|state| state.is_stopped)
    }

    fn record(&self, error: io::Error) {
        self.with(|state| {
            state.is_stopped = true;
            state.first.get_or_insert(error);
        });
    }
}

/// The owner's side of a [`Sink`]: reports its failure, and stops it when dropped.
#[derive(Default)]
pub(super) struct SinkMonitor(Failure);

impl SinkMonitor {
    /// The first failure of the sink, once.
    pub(super) fn take_failure(&self) -> Option<io::Error> {
        self.0.with(|state| state.first.take())
    }
}

impl Drop for SinkMonitor {
    fn drop(&mut self) {
        self.0.with(|state| state.is_stopped = true);
    }
}

/// A file that, once it has failed or was stopped, accepts everything and writes nothing.
///
/// The writer of the `las` crate completes its file when it is dropped, and panics if
/// that fails: on a full disk it would. So failures are hidden from it, and the owner asks
/// the monitor after every batch.
pub(super) struct Sink {
    file: BufWriter<File>,
    failure: Failure,
}

impl Sink {
    /// A sink that writes to `file`, and its monitor.
    pub(super) fn new(file: File) -> (Self, SinkMonitor) {
        let monitor = SinkMonitor::default();
        let sink = Self {
            file: BufWriter::with_capacity(1 << 20, file),
            failure: monitor.0.clone(),
        };
        (sink, monitor)
    }
}

impl Write for Sink {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.failure.is_stopped()
            && let Err(error) = self.file.write_all(bytes)
        {
            self.failure.record(error);
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if !self.failure.is_stopped()
            && let Err(error) = self.file.flush()
        {
            self.failure.record(error);
        }
        Ok(())
    }
}

impl Seek for Sink {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        if !self.failure.is_stopped() {
            match self.file.seek(to) {
                Ok(at) => return Ok(at),
                Err(error) => self.failure.record(error),
            }
        }
        Ok(0)
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        drop(self.flush());
    }
}
