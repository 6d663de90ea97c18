//! A spill that one hand fills, in one go.

use std::path::{Path, PathBuf};

use super::{
    CellGrid, PointCounts, ScatterOptions, Spill, TileError, growing::Growing,
    scatter::sorted_by_cell,
};

/// Takes records in any order, to be gathered by place.
#[allow(
    missing_debug_implementations,
    reason = "buffers of other people's points"
)]
pub(crate) struct SpillWriter {
    stem: PathBuf,
    growing: Growing,
    record_length: usize,
}

impl SpillWriter {
    /// A new spill at `stem`, of records of `record_length` bytes, that holds at the
    /// most `buffer_bytes` of them in memory.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if its file cannot be made.
    pub(crate) fn create(
        stem: &Path,
        grid: CellGrid,
        record_length: usize,
        buffer_bytes: usize,
    ) -> Result<Self, TileError> {
        let options = ScatterOptions {
            record_length,
            threads: 1,
            buffer_bytes,
            checkpoint_bytes: u64::MAX,
            keep_going: false,
        };
        Ok(Self {
            stem: stem.to_owned(),
            growing: Growing::open(stem, grid, &options, 1)?,
            record_length,
        })
    }

    /// Adds `records`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if they cannot be written.
    pub(crate) fn push(&mut self, records: &[u8]) -> Result<(), TileError> {
        let counts = PointCounts {
            read: (records.len() / self.record_length) as u64,
            ..PointCounts::default()
        };
        let grid = self.growing.grid();
        let batch = sorted_by_cell(0, counts, records, grid, self.record_length);
        self.growing.take(&batch, 0, &counts)
    }

    /// Completes the spill.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be written.
    pub(crate) fn finish(self) -> Result<Spill, TileError> {
        self.growing.finish()?;
        Spill::open(&self.stem)
    }
}
