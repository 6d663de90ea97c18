//! Where scattered points come from: a stream of records, opened in the thread that reads it.

use crate::las::PointCounts;

/// Why a source failed. The source states the reason, and it is passed on unchanged.
pub type SourceError = Box<dyn std::error::Error + Send + Sync>;

/// Opens a source after skipping the given number of its points. It is called in the thread that
/// reads the source, so that only as many inputs are open as there are threads.
pub type Opener<'a> = Box<dyn FnOnce(u64) -> Result<Box<dyn Source + 'a>, SourceError> + Send + 'a>;

/// A stream of records.
pub trait Source {
    /// Replaces the content of `records` by the next records, and returns how many points were
    /// read for them, including points that were left out; 0 points mean the end.
    ///
    /// # Errors
    ///
    /// The reason why the source cannot be read any further.
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError>;
}
