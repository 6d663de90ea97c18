//! The points of the output in an order that their positions alone give: cell by cell, by position within a cell.
//!
//! A mesh refers to its points by their numbers, and must be the same whatever the tiles were. So where a mesh
//! is written, the points of the cloud are written in this order, too.

use std::{collections::BTreeMap, io, path::Path};

use rayon::prelude::*;

use crate::{
    geometry::{Quantization, Stored},
    job::error::JobError,
    las::SortedRecords,
    tile::{BlockFile, TileError},
    tiling::{CellGrid, CellKey},
};

/// The grids by which the points of a mesh are put in order.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrderingGrids {
    /// The cells.
    pub(super) cells: CellGrid,
    /// Groups of cells, in which the points are sorted first.
    pub(super) groups: CellGrid,
}

impl OrderingGrids {
    /// The grids for points at `spacing` (CRS units).
    pub(super) fn new(spacing: f64, quantization: &Quantization) -> Self {
        let groups = CellGrid::of_mesh_cells(spacing, quantization);
        Self {
            cells: CellGrid::new(groups.square()),
            groups,
        }
    }
}

/// A cell with points.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrderedCell {
    /// The row and the column of the cell.
    pub(super) key: CellKey,
    /// The number of the first point among all points.
    pub(super) first: u64,
    /// The number of points.
    pub(super) count: u64,
}

/// The points of the output in order, in a temporary file.
#[derive(Debug)]
pub(super) struct OrderedPoints {
    blocks: BlockFile,
    /// The cells in their order.
    cells: Vec<OrderedCell>,
    /// The index of each cell in `cells`.
    places: BTreeMap<CellKey, usize>,
    record_length: usize,
}

impl OrderedPoints {
    /// Puts the points of `sorted`, records of `record_length` bytes, in order in a file at `path`. `advance` is called with the
    /// numbers of points that are done.
    ///
    /// # Errors
    ///
    /// [`JobError`] if temporary files cannot be read or written.
    pub(super) fn new(
        sorted: &dyn SortedRecords,
        grids: &OrderingGrids,
        record_length: usize,
        path: &Path,
        advance: &dyn Fn(u64),
    ) -> Result<Self, JobError> {
        let mut ordered = Self {
            blocks: BlockFile::create(path)?,
            cells: Vec::new(),
            places: BTreeMap::new(),
            record_length,
        };
        let mut groups: Vec<CellKey> = Vec::new();
        for (square, _) in sorted.squares() {
            groups.extend(grids.groups.touched_by(&square));
        }
        groups.sort_unstable();
        groups.dedup();
        for group in groups {
            let records = sorted.read(&grids.groups.rect(group));
            let records = records.map_err(|e| JobError::io("read", path, io::Error::other(e)))?;
            ordered.add_group(&records, &grids.cells)?;
            advance((records.len() / record_length) as u64);
        }
        Ok(ordered)
    }

    /// Adds the `records` of a group of cells.
    fn add_group(&mut self, records: &[u8], grid: &CellGrid) -> Result<(), TileError> {
        let length = self.record_length;
        let record = |number: u32| &records[number as usize * length..][..length];
        let mut order: Vec<(CellKey, Stored, u32)> = records
            .par_chunks_exact(length)
            .zip(0..(records.len() / length) as u32)
            .map(|(record, number)| {
                let point = Stored::of_record(record);
                (grid.cell(point), point, number)
            })
            .collect();
        order.par_sort_unstable_by(|a, b| {
            let by_bytes = || record(a.2).cmp(record(b.2));
            (a.0, a.1).cmp(&(b.0, b.1)).then_with(by_bytes)
        });
        for cell in order.chunk_by(|a, b| a.0 == b.0) {
            let mut bytes = Vec::with_capacity(cell.len() * length);
            cell.iter()
                .for_each(|&(_, _, number)| bytes.extend(record(number)));
            let number = self.cells.len();
            self.blocks.append(&[(number as u64, &bytes)])?;
            self.places.insert(cell[0].0, number);
            self.cells.push(OrderedCell {
                key: cell[0].0,
                first: self.points(),
                count: cell.len() as u64,
            });
        }
        Ok(())
    }

    /// The number of points.
    pub(super) fn points(&self) -> u64 {
        self.cells.last().map_or(0, |cell| cell.first + cell.count)
    }

    /// The cells in their order.
    pub(super) fn cells(&self) -> &[OrderedCell] {
        &self.cells
    }

    /// The index of a cell among the cells, if it has points.
    pub(super) fn index_of(&self, key: CellKey) -> Option<usize> {
        self.places.get(&key).copied()
    }

    /// The index of the cell that contains the point with this number.
    pub(super) fn cell_of(&self, number: u32) -> usize {
        let until = self
            .cells
            .partition_point(|cell| cell.first <= u64::from(number));
        until.saturating_sub(1)
    }

    /// The records of the cell with this index, in order.
    ///
    /// # Errors
    ///
    /// [`TileError`] if they cannot be read.
    pub(super) fn records(&self, index: usize) -> Result<Vec<u8>, TileError> {
        self.blocks.read(index as u64)
    }
}
