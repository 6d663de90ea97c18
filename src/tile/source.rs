//! Where scattered points come from: a stream of records, opened in the thread that reads it.

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

/// How many points of a source were read, and how many of these were left out and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointCounts {
    /// Points read, including those that were left out.
    pub read: u64,
    /// Points left out because they lie out of the range of the run's quantization.
    pub rejected: u64,
    /// Points left out by the filter of the run.
    pub filtered: u64,
    /// Points outside of the bounds that the header claims; they are kept. Some damage passes
    /// the decoder unseen, and shows here.
    pub outside: u64,
}

impl PointCounts {
    /// Adds the counts of another part of the source.
    pub(crate) fn add(&mut self, other: &Self) {
        self.read += other.read;
        self.rejected += other.rejected;
        self.filtered += other.filtered;
        self.outside += other.outside;
    }
}
