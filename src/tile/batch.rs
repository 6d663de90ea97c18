//! Records sorted by the cell of a grid: what decoders hand to the appender of a spill.

use std::ops::Range;

use super::{cell_points::CellPoints, spill_index::SquareCounts};
use crate::{
    geometry::Stored,
    las::PointCounts,
    tiling::{Bounds, CellGrid, CellKey, SquareFinder},
};

/// Records of one source, sorted by cell.
pub(super) struct Batch {
    /// The index of the source.
    pub(super) source: usize,
    /// The points of the source that were read for this batch.
    pub(super) counts: PointCounts,
    /// The points, those of a cell next to each other.
    pub(super) points: CellPoints,
    /// The grid that the records were sorted by.
    pub(super) grid: CellGrid,
    /// The cells in the order of the records.
    pub(super) cells: Vec<CellOfBatch>,
    /// The bounds of all points that were read.
    pub(super) bounds: Bounds,
    /// Bytes of the records of all points that were read.
    pub(super) bytes_read: usize,
}

/// The part of a batch that lies in one cell.
pub(super) struct CellOfBatch {
    pub(super) cell: CellKey,
    /// The bytes of its records.
    pub(super) records: Range<usize>,
    /// The indices of its sums.
    pub(super) sums: Range<usize>,
    /// The points that were read in each of its counting squares.
    pub(super) squares: Box<SquareCounts>,
}

impl Batch {
    /// Sorts `records`, of `record_length` bytes each, by the cells of `grid`. The order of records within a
    /// cell is kept.
    pub(super) fn sorted_by_cell(
        source: usize,
        counts: PointCounts,
        records: &[u8],
        grid: CellGrid,
        record_length: usize,
    ) -> Self {
        // Scanners sweep: most records that follow each other lie in one cell, so runs of
        // records are sorted rather than records.
        let mut finder = SquareFinder::new(grid);
        let mut runs: Vec<(CellKey, usize, usize)> = Vec::new();
        for (record, index) in records.chunks_exact(record_length).zip(0..) {
            let (cell, _) = finder.find(Stored::of_record(record));
            match runs.last_mut() {
                Some((last, _, end)) if *last == cell => *end = index + 1,
                _ => runs.push((cell, index, index + 1)),
            }
        }
        runs.sort_unstable();
        let mut batch = Self {
            source,
            counts,
            points: CellPoints {
                records: Vec::with_capacity(records.len()),
                sums: Vec::new(),
            },
            grid,
            cells: Vec::new(),
            bounds: Bounds::empty(),
            bytes_read: records.len(),
        };
        for runs in runs.chunk_by(|a, b| a.0 == b.0) {
            let start = batch.points.records.len();
            for &(_, first, end) in runs {
                let run = &records[first * record_length..end * record_length];
                batch.points.records.extend_from_slice(run);
            }
            batch.end_cell(runs[0].0, start, record_length);
        }
        batch
    }

    /// Counts the records from the byte `start` on, which are those of `cell`.
    fn end_cell(&mut self, cell: CellKey, start: usize, record_length: usize) {
        let records = &self.points.records[start..];
        let mut finder = SquareFinder::new(self.grid);
        let mut squares = Box::new([0; _]);
        // A copy that stays in registers over the records of a cell.
        let mut bounds = self.bounds;
        for record in records.chunks_exact(record_length) {
            let point = Stored::of_record(record);
            squares[finder.find(point).1] += 1;
            bounds.grow(point);
        }
        self.bounds = bounds;
        self.cells.push(CellOfBatch {
            cell,
            records: start..self.points.records.len(),
            sums: 0..0,
            squares,
        });
    }
}
