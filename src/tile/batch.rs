//! Records sorted by the cell of a grid: what decoders hand to the appender of a spill.

use crate::las::PointCounts;
use crate::{
    geometry::Stored,
    tiling::{CellGrid, CellKey},
};

/// Records of one source, sorted by cell.
pub(super) struct Batch {
    /// The index of the source.
    pub(super) source: usize,
    /// The points of the source that were read for this batch.
    pub(super) counts: PointCounts,
    /// The records, those of a cell next to each other.
    pub(super) records: Vec<u8>,
    /// The grid that the records were sorted by.
    pub(super) grid: CellGrid,
    /// The cells in the order of the records, each with the number of its records.
    pub(super) cells: Vec<(CellKey, u32)>,
}

impl Batch {
    /// Sorts `records`, of `record_length` bytes each, by the cells of `grid`. The order of
    /// records within a cell is kept.
    pub(super) fn sorted_by_cell(
        source: usize,
        counts: PointCounts,
        records: &[u8],
        grid: CellGrid,
        record_length: usize,
    ) -> Self {
        // Scanners sweep: most records that follow each other lie in one cell, so runs of
        // records are sorted rather than records.
        let mut runs: Vec<(CellKey, usize, usize)> = Vec::new();
        for (record, index) in records.chunks_exact(record_length).zip(0..) {
            let cell = grid.cell(Stored::of_record(record));
            match runs.last_mut() {
                Some((last, _, end)) if *last == cell => *end = index + 1,
                _ => runs.push((cell, index, index + 1)),
            }
        }
        runs.sort_unstable();
        let mut sorted = Vec::with_capacity(records.len());
        let mut cells: Vec<(CellKey, u32)> = Vec::new();
        for (cell, start, end) in runs {
            sorted.extend_from_slice(&records[start * record_length..end * record_length]);
            let points = (end - start) as u32;
            match cells.last_mut() {
                Some((last, count)) if *last == cell => *count += points,
                _ => cells.push((cell, points)),
            }
        }
        Self {
            source,
            counts,
            records: sorted,
            grid,
            cells,
        }
    }
}
