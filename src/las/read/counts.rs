//! How many points of a source were read, and what became of them.

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
