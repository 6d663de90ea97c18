//! The index of a spill: where the records of each cell lie, and how many points each counting
//! square contains.
//!
//! A spill is two files. `.bin` contains records and nothing else. `.index` is written when the
//! spill is complete, and `.checkpoint` in the same form while it grows (integers are little
//! endian):
//!
//! ```text
//!   magic, edge, record length, bytes                   4 × u64
//!   chunks, cells, sources                              3 × u64
//!   bounds: min and max of x, y, z                      6 × i32
//!   chunks: row, column, offset, bytes of records, sums 32 bytes each
//!   cells: row, column, points of each counting square  8 + 64 × 8 bytes each
//!   sources: read, rejected, filtered, outside, ended   5 × u64 each
//! ```

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use super::{
    cell_points::CellPoints,
    checksummed_file::{read_checksummed, write_checksummed},
    error::TileError,
};
use crate::las::PointCounts;
use crate::tiling::{Bounds, CellGrid, CellKey, MAX_OCCUPIED_CELLS, SQUARES_PER_CELL_EDGE};

const MAGIC: u64 = u64::from_le_bytes(*b"llspill4");
/// Bytes of x, y and z at the beginning of every record.
const COORDINATE_BYTES: usize = 12;
/// Bytes of a chunk in the index.
const CHUNK_BYTES: u64 = 32;
/// Bytes of a cell in the index.
const CELL_BYTES: u64 = 8 + 8 * SQUARES_PER_CELL as u64;
/// The number of counting squares of a cell.
const SQUARES_PER_CELL: usize = (SQUARES_PER_CELL_EDGE * SQUARES_PER_CELL_EDGE) as usize;

/// The number of points of every counting square of a cell, row by row.
pub(super) type SquareCounts = [u64; SQUARES_PER_CELL];

/// Records of one cell that are contiguous in a file of the spill, followed by sums of points whose
/// records are not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Chunk {
    /// The cell that contains the points.
    pub(super) cell: CellKey,
    /// The number of the file among the files of the spill. It is not written, because each file
    /// has an index of its own.
    pub(super) file: u32,
    /// The offset of the first record in the file, in bytes.
    pub(super) offset: u64,
    /// The length of all records, in bytes.
    pub(super) records: u64,
    /// The number of sums.
    pub(super) sums: u64,
}

impl Chunk {
    /// The length of records and sums, in bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.records + self.sums * CellPoints::SUM_BYTES as u64
    }

    /// The offset of the first byte behind the chunk.
    pub(super) fn end(&self) -> u64 {
        self.offset + self.bytes()
    }
}

/// How far a source has been scattered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct SourceProgress {
    /// The points taken from the source.
    pub(super) counts: PointCounts,
    /// Whether the source has ended.
    pub(super) is_done: bool,
}

/// What is known of a spill without reading its records.
#[derive(Debug)]
pub(super) struct SpillIndex {
    /// The grid of the cells.
    pub(super) grid: CellGrid,
    /// The length of a record, in bytes.
    pub(super) record_length: usize,
    /// The length of all records and sums, in bytes.
    pub(super) bytes: u64,
    /// The true bounds of the points.
    pub(super) bounds: Bounds,
    /// The chunks in the order of the file.
    pub(super) chunks: Vec<Chunk>,
    /// The occupied cells with the points of their counting squares.
    pub(super) counts: BTreeMap<CellKey, Box<SquareCounts>>,
    /// How far each source has been taken, in the order of the sources.
    pub(super) sources: Vec<SourceProgress>,
}

/// The path of the records of the spill at `stem`.
pub(super) fn spill_path(stem: &Path) -> PathBuf {
    stem.with_extension("bin")
}

/// The path of the index of the complete spill at `stem`.
pub(super) fn index_path(stem: &Path) -> PathBuf {
    stem.with_extension("index")
}

/// The path of the last checkpoint of the growing spill at `stem`.
pub(super) fn checkpoint_path(stem: &Path) -> PathBuf {
    stem.with_extension("checkpoint")
}

impl SpillIndex {
    /// Describes a spill without records, of `sources` sources that have not been begun.
    pub(super) fn empty(grid: CellGrid, record_length: usize, sources: usize) -> Self {
        Self {
            grid,
            record_length,
            bytes: 0,
            bounds: Bounds::empty(),
            chunks: Vec::new(),
            counts: BTreeMap::new(),
            sources: vec![SourceProgress::default(); sources],
        }
    }

    /// Whether so many cells are occupied that the grid must be made coarser.
    pub(super) fn has_too_many_cells(&self) -> bool {
        self.counts.len() > MAX_OCCUPIED_CELLS
    }

    /// Counts the points of the `squares` of `cell` of `grid`, which is this grid or a finer one.
    /// Returns the cell of this grid that contains them.
    pub(super) fn count(
        &mut self,
        mut cell: CellKey,
        mut grid: CellGrid,
        squares: &SquareCounts,
    ) -> CellKey {
        let mut coarser;
        let mut squares = squares;
        while grid.edge() < self.grid.edge() {
            let mut joined = [0; _];
            for (square, count) in squares.iter().enumerate() {
                joined[CellGrid::square_in_parent(cell, square)] += count;
            }
            coarser = joined;
            squares = &coarser;
            cell = cell.parent();
            grid = grid.coarser();
        }
        let counts = self.counts.entry(cell);
        let counts = counts.or_insert_with(|| Box::new([0; _]));
        for (count, more) in counts.iter_mut().zip(squares) {
            *count += more;
        }
        cell
    }

    /// Joins every four cells to one.
    pub(super) fn coarsen(&mut self) {
        self.grid = self.grid.coarser();
        for chunk in &mut self.chunks {
            chunk.cell = chunk.cell.parent();
        }
        for (cell, finer) in std::mem::take(&mut self.counts) {
            let parent = self.counts.entry(cell.parent());
            let counts = parent.or_insert_with(|| Box::new([0; _]));
            for (square, count) in finer.iter().enumerate() {
                counts[CellGrid::square_in_parent(cell, square)] += count;
            }
        }
    }

    /// Joins this index and `other`, which describes the file with the number `file`; `None` if
    /// the two spills were not begun with the same grid.
    pub(super) fn join(mut self, mut other: Self, file: u32) -> Option<Self> {
        while self.grid.edge() < other.grid.edge() {
            self.coarsen();
        }
        while other.grid.edge() < self.grid.edge() {
            other.coarsen();
        }
        if self.grid != other.grid || self.record_length != other.record_length {
            return None;
        }
        self.bytes += other.bytes;
        self.bounds.join(&other.bounds);
        let chunks = other.chunks.into_iter();
        self.chunks
            .extend(chunks.map(|chunk| Chunk { file, ..chunk }));
        for (cell, squares) in other.counts {
            let counts = self.counts.entry(cell);
            let counts = counts.or_insert_with(|| Box::new([0; _]));
            for (count, more) in counts.iter_mut().zip(squares.iter()) {
                *count += more;
            }
        }
        self.sources.extend(other.sources);
        while self.has_too_many_cells() {
            self.coarsen();
        }
        Some(self)
    }

    /// Writes the index to `path`; the file is complete or unchanged.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be written.
    pub(super) fn write(&self, path: &Path) -> Result<(), TileError> {
        let written = write_checksummed(path, &self.encode());
        written.map_err(|source| TileError::io("write", path, source))
    }

    /// Reads the index at `path`; `None` if the content is not what was written.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read.
    pub(super) fn read(path: &Path) -> Result<Option<Self>, TileError> {
        let content =
            read_checksummed(path).map_err(|source| TileError::io("read", path, source))?;
        Ok(content.and_then(|content| Self::decode(&content)))
    }

    /// Bytes of the index on disk, without header and sources.
    pub(super) fn encoded_bytes(&self) -> u64 {
        CHUNK_BYTES * self.chunks.len() as u64 + CELL_BYTES * self.counts.len() as u64
    }

    /// Encodes the index as the head of this file describes.
    fn encode(&self) -> Vec<u8> {
        let mut out = Vec::new();
        for number in [
            MAGIC,
            self.grid.edge() as u64,
            self.record_length as u64,
            self.bytes,
            self.chunks.len() as u64,
            self.counts.len() as u64,
            self.sources.len() as u64,
        ] {
            out.extend(number.to_le_bytes());
        }
        for c in self.bounds.min.iter().chain(&self.bounds.max) {
            out.extend(c.to_le_bytes());
        }
        for chunk in &self.chunks {
            out.extend(chunk.cell.row.to_le_bytes());
            out.extend(chunk.cell.column.to_le_bytes());
            out.extend(chunk.offset.to_le_bytes());
            out.extend(chunk.records.to_le_bytes());
            out.extend(chunk.sums.to_le_bytes());
        }
        for (cell, squares) in &self.counts {
            out.extend(cell.row.to_le_bytes());
            out.extend(cell.column.to_le_bytes());
            for count in squares.iter() {
                out.extend(count.to_le_bytes());
            }
        }
        for SourceProgress { counts, is_done } in &self.sources {
            let numbers = [
                counts.read,
                counts.rejected,
                counts.filtered,
                counts.outside,
            ];
            for number in numbers.into_iter().chain([u64::from(*is_done)]) {
                out.extend(number.to_le_bytes());
            }
        }
        out
    }

    /// Decodes an index; `None` if `content` is none.
    fn decode(content: &[u8]) -> Option<Self> {
        let mut rest = Reader(content);
        if rest.u64()? != MAGIC {
            return None;
        }
        let edge = i64::try_from(rest.u64()?).ok()?;
        let record_length = usize::try_from(rest.u64()?).ok()?;
        let total = rest.u64()?;
        let [chunks, cells, sources] = [rest.u64()?, rest.u64()?, rest.u64()?];
        let mut index = Self::empty(CellGrid::new(edge), record_length, 0);
        index.bytes = total;
        let bounds = &mut index.bounds;
        for c in bounds.min.iter_mut().chain(&mut bounds.max) {
            *c = rest.i32()?;
        }
        for _ in 0..chunks {
            index.chunks.push(rest.chunk(record_length, total)?);
        }
        for _ in 0..cells {
            let cell = rest.cell()?;
            let mut squares = Box::new([0; SQUARES_PER_CELL]);
            for count in squares.iter_mut() {
                *count = rest.u64()?;
            }
            index.counts.insert(cell, squares);
        }
        for _ in 0..sources {
            index.sources.push(rest.source_progress()?);
        }
        (index.grid.edge() == edge && rest.0.is_empty()).then_some(index)
    }
}

/// Takes numbers from the front of a slice; `None` when it is exhausted.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }

    fn cell(&mut self) -> Option<CellKey> {
        Some(CellKey {
            row: self.i32()?,
            column: self.i32()?,
        })
    }

    /// Takes a chunk of records of `record_length` bytes in a file of `total` bytes.
    fn chunk(&mut self, record_length: usize, total: u64) -> Option<Chunk> {
        let cell = self.cell()?;
        let (offset, records, sums) = (self.u64()?, self.u64()?, self.u64()?);
        let is_whole = record_length >= COORDINATE_BYTES && records % record_length as u64 == 0;
        let end = sums
            .checked_mul(CellPoints::SUM_BYTES as u64)?
            .checked_add(records)?
            .checked_add(offset)?;
        (is_whole && end <= total).then_some(Chunk {
            cell,
            file: 0,
            offset,
            records,
            sums,
        })
    }

    fn source_progress(&mut self) -> Option<SourceProgress> {
        let counts = PointCounts {
            read: self.u64()?,
            rejected: self.u64()?,
            filtered: self.u64()?,
            outside: self.u64()?,
        };
        let is_done = self.u64()? != 0;
        Some(SourceProgress { counts, is_done })
    }
}
