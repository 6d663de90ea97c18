//! What a spill keeps of the points that it is given, and where.

use crate::lloyd::Thinning;

/// What is kept of the points that are scattered, and where.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Storage {
    /// The rule by which points are thinned as they come; `None` keeps all.
    pub(crate) thinning: Option<Thinning>,
    /// Bytes of points that stay in memory. If they become more, all go to the file, from which an
    /// interrupted scatter continues.
    pub(crate) memory_bytes: u64,
}
