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
        // Scanners sweep: most records that follow each other lie in one counting square, so runs of
        // records are sorted rather than records.
        let mut finder = SquareFinder::new(grid);
        let mut bounds = Bounds::empty();
        let mut runs: Vec<Run> = Vec::new();
        for (record, index) in records.chunks_exact(record_length).zip(0..) {
            let point = Stored::of_record(record);
            bounds.grow(point);
            let (cell, square) = finder.find(point);
            match runs.last_mut() {
                Some(run) if (run.cell, run.square) == (cell, square) => run.end = index + 1,
                _ => runs.push(Run {
                    cell,
                    first: index,
                    end: index + 1,
                    square,
                }),
            }
        }
        runs.sort_unstable_by_key(|run| (run.cell, run.first));
        let mut points = CellPoints {
            records: Vec::with_capacity(records.len()),
            sums: Vec::new(),
        };
        let of_cell = |runs: &[Run]| {
            let start = points.records.len();
            let mut squares = Box::new([0; _]);
            for run in runs {
                let run_of = run.first * record_length..run.end * record_length;
                points.records.extend_from_slice(&records[run_of]);
                squares[run.square] += (run.end - run.first) as u64;
            }
            CellOfBatch {
                cell: runs[0].cell,
                records: start..points.records.len(),
                sums: 0..0,
                squares,
            }
        };
        let cells = runs
            .chunk_by(|a, b| a.cell == b.cell)
            .map(of_cell)
            .collect();
        Self {
            source,
            counts,
            points,
            grid,
            cells,
            bounds,
            bytes_read: records.len(),
        }
    }
}

/// Records that follow each other in one counting square.
struct Run {
    cell: CellKey,
    /// The index of the square in the cell.
    square: usize,
    /// The index of the first record, and that after the last.
    first: usize,
    end: usize,
}
