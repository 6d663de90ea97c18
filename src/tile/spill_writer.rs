//! A spill that one thread fills without interruption.

use std::path::Path;

use super::{
    batch::Batch,
    error::TileError,
    spill::Spill,
    spill_appender::{AppendOptions, SpillAppender},
    storage::Storage,
};
use crate::las::PointCounts;
use crate::tiling::CellGrid;

/// Takes records in any order, so that they can be gathered by rectangles.
pub(super) struct SpillWriter {
    appender: SpillAppender,
    record_length: usize,
}

impl SpillWriter {
    /// Makes a new spill at `stem`, of records of `record_length` bytes, whose buffers take at
    /// most `buffer_bytes`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if its file cannot be made.
    pub(super) fn create(
        stem: &Path,
        grid: CellGrid,
        record_length: usize,
        buffer_bytes: usize,
    ) -> Result<Self, TileError> {
        let options = AppendOptions {
            record_length,
            buffer_bytes,
            // A spill that is filled without interruption is not resumed.
            checkpoint_bytes: u64::MAX,
            storage: Storage::default(),
        };
        Ok(Self {
            appender: SpillAppender::open(stem, grid, &options, 1)?,
            record_length,
        })
    }

    /// Adds `records`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if they cannot be written.
    pub(super) fn push(&mut self, records: &[u8]) -> Result<(), TileError> {
        let counts = PointCounts {
            read: (records.len() / self.record_length) as u64,
            ..PointCounts::default()
        };
        let grid = self.appender.grid();
        let batch = Batch::sorted_by_cell(0, counts, records, grid, self.record_length);
        self.appender.append(&batch)
    }

    /// Completes the spill.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be written.
    pub(super) fn finish(self) -> Result<Spill, TileError> {
        self.appender.finish()
    }
}
