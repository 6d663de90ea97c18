//! Records that are thinned as they are decoded, until there are enough for a batch.
//!
//! Points of a scan come in sweeps, and most that follow each other lie in one voxel. A table of the voxels
//! takes them one by one, without a sort, over as many calls of the decoder as its memory allows.

use std::{cmp::Ordering, mem};

use hashbrown::HashTable;

use super::{
    batch::{Batch, CellOfBatch},
    cell_points::CellPoints,
    spill_index::SquareCounts,
};
use crate::{
    geometry::{CellIndex, Stored, spread},
    las::PointCounts,
    lloyd::{PointsByIndex, Thinning, VoxelPoints},
    tiling::{Bounds, CellGrid, CellKey, SquareFinder},
};

/// Bytes of voxels and of records that are kept; beyond them a batch is complete.
const BATCH_BYTES: usize = 2 << 20;
/// Bytes that are read for a batch; beyond them it is complete, however few it keeps.
const BYTES_READ: u64 = 32 << 20;

/// A batch that grows.
pub(super) struct VoxelBatch {
    thinning: Thinning,
    record_length: usize,
    counts: PointCounts,
    bounds: Bounds,
    bytes_read: usize,
    grid: CellGrid,
    cells: Vec<(CellKey, Box<SquareCounts>)>,
    voxels: Vec<Voxel>,
    /// The indices of the cells and of the voxels by their keys.
    cell_table: HashTable<u32>,
    voxel_table: HashTable<u32>,
    /// The records that voxels keep, at the places that their indices say.
    records: Vec<u8>,
    /// The places of records that are not kept any more.
    free: Vec<u32>,
}

/// A voxel, or the part of one that lies in a cell.
struct Voxel {
    key: VoxelKey,
    points: VoxelPoints,
}

/// The index of a voxel, and that of the cell.
#[derive(Clone, Copy, PartialEq, Eq)]
struct VoxelKey {
    voxel: CellIndex,
    cell: u32,
}

/// The records of a batch, and one that may be added at a free place.
struct RecordPlaces<'a> {
    record_length: usize,
    records: &'a [u8],
    added: &'a [u8],
    place: u32,
}

impl VoxelBatch {
    /// An empty batch of records of `record_length` bytes, in the cells of `grid`.
    pub(super) fn new(record_length: usize, grid: CellGrid, thinning: Thinning) -> Self {
        Self {
            thinning,
            record_length,
            counts: PointCounts::default(),
            bounds: Bounds::empty(),
            bytes_read: 0,
            grid,
            cells: Vec::new(),
            voxels: Vec::new(),
            cell_table: HashTable::new(),
            voxel_table: HashTable::new(),
            records: Vec::new(),
            free: Vec::new(),
        }
    }

    /// Whether the batch should not grow any further, where checkpoints follow each other after
    /// `checkpoint_bytes`.
    pub(super) fn is_complete(&self, checkpoint_bytes: u64) -> bool {
        let bytes = self.records.len() + self.voxels.len() * size_of::<Voxel>();
        bytes >= BATCH_BYTES || self.bytes_read as u64 >= checkpoint_bytes.min(BYTES_READ)
    }

    /// Adds `records`, for which the points `counts` were read.
    pub(super) fn add(&mut self, counts: &PointCounts, records: &[u8]) {
        self.counts.add(counts);
        self.bytes_read += records.len();
        let mut finder = SquareFinder::new(self.grid);
        let mut bounds = self.bounds;
        let mut cell: Option<(CellKey, u32)> = None;
        let mut last: Option<(VoxelKey, u32)> = None;
        for record in records.chunks_exact(self.record_length) {
            let point = Stored::of_record(record);
            bounds.grow(point);
            let (key, square) = finder.find(point);
            let cell = match cell {
                Some((known, index)) if known == key => index,
                _ => cell.insert((key, self.cell_index(key))).1,
            };
            self.cells[cell as usize].1[square] += 1;
            let key = VoxelKey {
                voxel: self.thinning.voxel_of(point),
                cell,
            };
            let voxel = match last {
                Some((known, index)) if known == key => index,
                _ => last.insert((key, self.voxel_index(key))).1,
            };
            self.add_point(voxel, point, record);
        }
        self.bounds = bounds;
    }

    /// The index of the cell `key`, which is added if it is new.
    fn cell_index(&mut self, key: CellKey) -> u32 {
        let cells = &mut self.cells;
        let hash =
            |key: &CellKey| spread(u64::from(key.row as u32) << 32 | u64::from(key.column as u32));
        let is_it = |&index: &u32| cells[index as usize].0 == key;
        if let Some(&known) = self.cell_table.find(hash(&key), is_it) {
            return known;
        }
        let index = cells.len() as u32;
        cells.push((key, Box::new([0; _])));
        let hash_of = |&index: &u32| hash(&cells[index as usize].0);
        self.cell_table.insert_unique(hash(&key), index, hash_of);
        index
    }

    /// The index of the voxel `key`, which is added if it is new.
    #[inline]
    fn voxel_index(&mut self, key: VoxelKey) -> u32 {
        let voxels = &mut self.voxels;
        let is_it = |&index: &u32| voxels[index as usize].key == key;
        if let Some(&known) = self.voxel_table.find(key.hash(), is_it) {
            return known;
        }
        let index = voxels.len() as u32;
        let points = VoxelPoints::default();
        voxels.push(Voxel { key, points });
        let hash_of = |&index: &u32| voxels[index as usize].key.hash();
        self.voxel_table.insert_unique(key.hash(), index, hash_of);
        index
    }

    /// Adds a point to the voxel of this index, and its record if the voxel keeps it.
    #[inline]
    fn add_point(&mut self, voxel: u32, point: Stored, record: &[u8]) {
        let length = self.record_length;
        let end = (self.records.len() / length) as u32;
        let place = self.free.pop().unwrap_or(end);
        let records = RecordPlaces {
            record_length: length,
            records: &self.records,
            added: record,
            place,
        };
        let mut is_kept = true;
        let priority = self.thinning.priority(point);
        let points = &mut self.voxels[voxel as usize].points;
        points.add(point, priority, place, &records, |left| {
            is_kept &= left != place;
            if left != end {
                self.free.push(left);
            }
        });
        if is_kept {
            let start = place as usize * length;
            match place == end {
                true => self.records.extend_from_slice(record),
                false => self.records[start..start + length].copy_from_slice(record),
            }
        }
    }

    /// What has been read of the source with this index since the last call, as a batch; the next points are
    /// those in the cells of `grid`.
    pub(super) fn take(&mut self, source: usize, grid: CellGrid) -> Batch {
        let next = Self::new(self.record_length, grid, self.thinning);
        mem::replace(self, next).into_batch(source)
    }

    fn into_batch(self, source: usize) -> Batch {
        let record = |index: u32| {
            let start = index as usize * self.record_length;
            &self.records[start..start + self.record_length]
        };
        let mut order: Vec<u64> = (0..)
            .zip(&self.voxels)
            .map(|(index, voxel)| u64::from(voxel.key.cell) << 32 | index)
            .collect();
        order.sort_unstable();
        let voxels = order
            .iter()
            .map(|&word| &self.voxels[(word & u64::from(u32::MAX)) as usize]);
        let voxels: Vec<&Voxel> = voxels.collect();

        let mut points = CellPoints::default();
        let mut cells = Vec::with_capacity(self.cells.len());
        let in_cells = voxels.chunk_by(|a, b| a.key.cell == b.key.cell);
        for (in_cell, (cell, squares)) in in_cells.zip(self.cells) {
            let (first_byte, first_sum) = (points.records.len(), points.sums.len());
            for Voxel { points: kept, .. } in in_cell {
                for &index in kept.kept() {
                    points.records.extend_from_slice(record(index));
                }
                let others = kept.others(|index| Stored::of_record(record(index)));
                points.sums.extend((others.count > 0).then_some(others));
            }
            cells.push(CellOfBatch {
                cell,
                records: first_byte..points.records.len(),
                sums: first_sum..points.sums.len(),
                squares,
            });
        }
        Batch {
            source,
            counts: self.counts,
            points,
            grid: self.grid,
            cells,
            bounds: self.bounds,
            bytes_read: self.bytes_read,
        }
    }
}

impl VoxelKey {
    #[inline]
    fn hash(&self) -> u64 {
        let [x, y, z] = self.voxel.map(|c| u64::from(c as u32));
        // An odd factor keeps layers apart.
        spread((x << 32 | y) ^ (z ^ u64::from(self.cell) << 32).wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }
}

impl RecordPlaces<'_> {
    fn record(&self, index: u32) -> &[u8] {
        match index == self.place {
            true => self.added,
            false => &self.records[index as usize * self.record_length..][..self.record_length],
        }
    }
}

impl PointsByIndex for RecordPlaces<'_> {
    type Identity = Stored;

    fn identity(&self, index: u32) -> Stored {
        Stored::of_record(self.record(index))
    }

    fn order(&self, a: u32, b: u32) -> Ordering {
        self.record(a).cmp(self.record(b))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{geometry::Quantization, lloyd::SolverOptions};

    /// Bytes of a record: a point, and a number.
    const LENGTH: usize = 16;

    fn thinning() -> Thinning {
        let quantization = Quantization {
            scale: 0.01,
            offset: [0.0; 3],
        };
        Thinning::new(&quantization, &SolverOptions::new(1.0))
    }

    /// Records in a few voxels, in sweeps, some of them at one position.
    fn records(count: u64) -> Vec<u8> {
        (0..count)
            .flat_map(|k| {
                let c = |axis: u64| (spread(k / 3 * 3 + axis) % 150) as i32 - 70;
                [c(0), c(1), c(2) / 8, spread(k) as i32]
            })
            .flat_map(i32::to_le_bytes)
            .collect()
    }

    /// The slow twin sorts by cell, and thins the records of each cell at once.
    #[test]
    fn a_batch_that_grows_is_the_batch_of_all_its_records() {
        let grid = CellGrid::new(64);
        let records = records(5000);
        let mut batch = VoxelBatch::new(LENGTH, grid, thinning());
        for part in records.chunks(700 * LENGTH) {
            let read = (part.len() / LENGTH) as u64;
            let counts = PointCounts {
                read,
                ..PointCounts::default()
            };
            batch.add(&counts, part);
        }
        let grown = batch.take(3, grid);
        let twin = Batch::sorted_by_cell(3, grown.counts, &records, grid, LENGTH);

        assert_eq!(grown.counts.read, 5000);
        assert_eq!((grown.bytes_read, grown.source), (records.len(), 3));
        assert_eq!(grown.bounds, twin.bounds);
        assert_eq!(grown.cells.len(), twin.cells.len());
        let sorted = |mut points: CellPoints| {
            let mut records: Vec<Vec<u8>> =
                points.records.chunks(LENGTH).map(<[u8]>::to_vec).collect();
            records.sort();
            points.sums.sort_unstable();
            (records, points.sums)
        };
        let points_of = |batch: &Batch, cell: &CellOfBatch| CellPoints {
            records: batch.points.records[cell.records.clone()].to_vec(),
            sums: batch.points.sums[cell.sums.clone()].to_vec(),
        };
        for cell in &grown.cells {
            let same = twin.cells.iter().find(|other| other.cell == cell.cell);
            let same = same.expect("both have the cell");
            assert_eq!(cell.squares, same.squares);
            let mut thinned = points_of(&twin, same);
            thinned.thin(LENGTH, &thinning());
            assert_eq!(sorted(points_of(&grown, cell)), sorted(thinned));
        }
        assert!(grown.points.records.len() < records.len() / 3);
        assert!(batch.take(3, grid).cells.is_empty());
    }
}
