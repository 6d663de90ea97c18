//! Temporary files of records that are sorted by position before they are written.
//!
//! The layer above implements them with its spill; a writer sees these traits only.

use std::fmt::Debug;

use crate::{
    geometry::Rect,
    tiling::{Bounds, CellGrid},
};

/// Why a store cannot be written or read.
pub(crate) type StoreError = Box<dyn std::error::Error + Send + Sync>;

/// A directory of temporary files in which records can be sorted.
pub(crate) trait SortingSpace: Debug {
    /// Begins to sort records of `record_length` bytes into the cells of `grid`, in files with this `name`, which is
    /// one that jobs give to their files.
    ///
    /// # Errors
    ///
    /// If no file can be made.
    fn begin(
        &self,
        name: &str,
        grid: CellGrid,
        record_length: usize,
    ) -> Result<Box<dyn RecordSorter>, StoreError>;
}

/// Records that are being sorted.
pub(crate) trait RecordSorter: Send {
    /// Adds `records`, in any order.
    ///
    /// # Errors
    ///
    /// If they cannot be written.
    fn push(&mut self, records: &[u8]) -> Result<(), StoreError>;

    /// Completes the store.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    fn finish(self: Box<Self>) -> Result<Box<dyn SortedRecords>, StoreError>;
}

/// Records that can be read by position.
pub(crate) trait SortedRecords {
    /// The number of records.
    fn points(&self) -> u64;

    /// The bounds of the points.
    fn bounds(&self) -> Bounds;

    /// The occupied squares of a grid, and the number of points in each, in a fixed order.
    fn squares(&self) -> Vec<(Rect, u64)>;

    /// Calls `visit` with every record whose point lies in `rect`, in no order that may be
    /// relied on.
    ///
    /// # Errors
    ///
    /// If the store cannot be read.
    fn visit(&self, rect: &Rect, visit: &mut dyn FnMut(&[u8])) -> Result<(), StoreError>;

    /// Reads all records whose points lie in `rect`, in parallel, in no order that may be
    /// relied on.
    ///
    /// # Errors
    ///
    /// If the store cannot be read.
    fn read(&self, rect: &Rect) -> Result<Vec<u8>, StoreError>;

    /// Removes the temporary files; files that cannot be removed stay.
    fn remove(self: Box<Self>);
}
