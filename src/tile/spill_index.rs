//! The index of a spill: how many points each counting square contains, and where the records of each cell lie.
//!
//! A spill is two files. `.bin` contains records and nothing else. `.index` is written when the
//! spill is complete, and `.checkpoint` in the same form while it grows (integers are little
//! endian):
//!
//! ```text
//!   magic, edge, record length, bytes, values, chunks   6 × u64
//!   cells, sources                                      2 × u64
//!   bounds: min and max of x, y, z                      6 × i32
//!   cells: row, column                                  2 × i32 each, then
//!          chunks, their checksum, points by square     (2 + 64) × u64
//!   sources: read, rejected, filtered, outside, ended   5 × u64 each
//!   checksum of what stands before                      u64
//!   chunks of each cell                                 see [`ChunkTable`]
//! ```

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Read},
    path::{Path, PathBuf},
};

use super::{
    checksummed_file::{checksum, write_complete},
    chunk_table::{CellChunks, Chunk, ChunkTable},
    error::TileError,
    number_reader::NumberReader,
};
use crate::las::PointCounts;
use crate::tiling::{Bounds, CellGrid, CellKey, MAX_OCCUPIED_CELLS, SQUARES_PER_CELL_EDGE};

const MAGIC: u64 = u64::from_le_bytes(*b"llspill5");
/// Bytes of the numbers before the cells.
const HEADER_BYTES: usize = 8 * 8 + 6 * 4;
/// Bytes of a cell.
const CELL_BYTES: u64 = 8 + 8 * (2 + SQUARES_PER_CELL as u64);
/// Bytes of a source.
const SOURCE_BYTES: u64 = 5 * 8;
/// Bytes of the checksum.
const CHECKSUM_BYTES: u64 = 8;
/// The number of counting squares of a cell.
const SQUARES_PER_CELL: usize = (SQUARES_PER_CELL_EDGE * SQUARES_PER_CELL_EDGE) as usize;

/// The number of points of every counting square of a cell, row by row.
pub(super) type SquareCounts = [u64; SQUARES_PER_CELL];

/// How far a source has been scattered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct SourceProgress {
    /// The points taken from the source.
    pub(super) counts: PointCounts,
    /// Whether the source has ended.
    pub(super) is_done: bool,
}

/// What is known of a spill without reading its records, but for where they lie.
#[derive(Debug)]
pub(super) struct SpillIndex {
    /// The grid of the cells.
    pub(super) grid: CellGrid,
    /// The length of a record, in bytes.
    pub(super) record_length: usize,
    /// The length of all records and sums, in bytes.
    pub(super) bytes: u64,
    /// The number of records and sums.
    pub(super) values: u64,
    /// The number of chunks.
    chunks: u64,
    /// The true bounds of the points.
    pub(super) bounds: Bounds,
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
            values: 0,
            chunks: 0,
            bounds: Bounds::empty(),
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

    /// Counts a chunk that has been written to the end of the file.
    pub(super) fn add_chunk(&mut self, chunk: &Chunk) {
        self.bytes = chunk.end();
        self.values += chunk.records / self.record_length as u64 + chunk.sums;
        self.chunks += 1;
    }

    /// Joins every four cells to one.
    pub(super) fn coarsen(&mut self) {
        self.grid = self.grid.coarser();
        for (cell, finer) in std::mem::take(&mut self.counts) {
            let parent = self.counts.entry(cell.parent());
            let counts = parent.or_insert_with(|| Box::new([0; _]));
            for (square, count) in finer.iter().enumerate() {
                counts[CellGrid::square_in_parent(cell, square)] += count;
            }
        }
    }

    /// Joins this index and `other`; `None` if the two spills were not begun with the same grid.
    pub(super) fn join(mut self, mut other: Self) -> Option<Self> {
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
        self.values += other.values;
        self.chunks += other.chunks;
        self.bounds.join(&other.bounds);
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

    /// Writes the index to `path`, and `chunks`, which are brought into the order of their cells; the file is complete or unchanged.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be written.
    pub(super) fn write(&self, path: &Path, chunks: &mut [Chunk]) -> Result<(), TileError> {
        chunks.sort_unstable_by_key(|chunk| (chunk.cell, chunk.offset));
        let (index, table) = self.encode(chunks);
        let sum = checksum(&index).to_le_bytes();
        write_complete(path, &[&index, &sum, &table])
            .map_err(|source| TileError::io("write", path, source))
    }

    /// Reads the index at `path`, without its chunks; `None` if the content is not what was written.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read.
    pub(super) fn read(path: &Path) -> Result<Option<(Self, ChunkTable)>, TileError> {
        let read = File::open(path).and_then(|mut file| Self::read_from(&mut file, path));
        read.map_err(|source| TileError::io("read", path, source))
    }

    fn read_from(file: &mut File, path: &Path) -> io::Result<Option<(Self, ChunkTable)>> {
        let length = file.metadata()?.len();
        let mut content = Vec::new();
        file.take(HEADER_BYTES as u64).read_to_end(&mut content)?;
        let Some((mut index, [cells, sources])) = Self::decode_header(&content) else {
            return Ok(None);
        };
        // The numbers may be damaged, so that they are compared with the length before anything of that size is read.
        let rest = u128::from(cells) * u128::from(CELL_BYTES)
            + u128::from(sources) * u128::from(SOURCE_BYTES)
            + u128::from(CHECKSUM_BYTES);
        let table = u128::from(index.chunks) * u128::from(ChunkTable::CHUNK_BYTES);
        if HEADER_BYTES as u128 + rest + table != u128::from(length) {
            return Ok(None);
        }
        file.take(rest as u64).read_to_end(&mut content)?;
        let Some((content, sum)) = content.split_last_chunk() else {
            return Ok(None);
        };
        if checksum(content).to_le_bytes() != *sum {
            return Ok(None);
        }
        let cells = index.decode(&content[HEADER_BYTES..], cells, sources);
        Ok(cells.map(|cells| {
            let table = ChunkTable {
                path: path.to_owned(),
                start: length - table as u64,
                cells,
                grid: index.grid,
                record_length: index.record_length,
                bytes: index.bytes,
            };
            (index, table)
        }))
    }

    /// Bytes of the index on disk, without header and sources.
    pub(super) fn encoded_bytes(&self) -> u64 {
        ChunkTable::CHUNK_BYTES * self.chunks + CELL_BYTES * self.counts.len() as u64
    }

    /// Encodes the index, and the table of `chunks`, which are in the order of their cells.
    fn encode(&self, mut chunks: &[Chunk]) -> (Vec<u8>, Vec<u8>) {
        let (mut out, mut table) = (Vec::new(), Vec::new());
        for number in [
            MAGIC,
            self.grid.edge() as u64,
            self.record_length as u64,
            self.bytes,
            self.values,
            self.chunks,
            self.counts.len() as u64,
            self.sources.len() as u64,
        ] {
            out.extend(number.to_le_bytes());
        }
        for c in self.bounds.min.iter().chain(&self.bounds.max) {
            out.extend(c.to_le_bytes());
        }
        for (cell, squares) in &self.counts {
            let count = chunks.partition_point(|chunk| chunk.cell <= *cell);
            let (of_cell, others) = chunks.split_at(count);
            chunks = others;
            let entries = ChunkTable::encode(of_cell);
            out.extend(cell.row.to_le_bytes());
            out.extend(cell.column.to_le_bytes());
            for number in [count as u64, checksum(&entries)]
                .iter()
                .chain(squares.iter())
            {
                out.extend(number.to_le_bytes());
            }
            table.extend(entries);
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
        (out, table)
    }

    /// Decodes what stands before the cells: an index without them, and the numbers of cells and sources; `None` if it is none.
    fn decode_header(content: &[u8]) -> Option<(Self, [u64; 2])> {
        let mut rest = NumberReader(content);
        if rest.u64()? != MAGIC {
            return None;
        }
        let edge = i64::try_from(rest.u64()?).ok()?;
        let record_length = usize::try_from(rest.u64()?).ok()?;
        let mut index = Self::empty(CellGrid::new(edge), record_length, 0);
        [index.bytes, index.values, index.chunks] = [rest.u64()?, rest.u64()?, rest.u64()?];
        let numbers = [rest.u64()?, rest.u64()?];
        let bounds = &mut index.bounds;
        for c in bounds.min.iter_mut().chain(&mut bounds.max) {
            *c = rest.i32()?;
        }
        (index.grid.edge() == edge).then_some((index, numbers))
    }

    /// Decodes the `cells` and the `sources`, and returns where the chunks of the cells lie; `None` if `content` is not that.
    fn decode(&mut self, content: &[u8], cells: u64, sources: u64) -> Option<Vec<CellChunks>> {
        let mut rest = NumberReader(content);
        let (mut found, mut first) = (Vec::new(), 0);
        for _ in 0..cells {
            let cell = CellKey {
                row: rest.i32()?,
                column: rest.i32()?,
            };
            let (chunks, checksum) = (rest.u64()?, rest.u64()?);
            let end = u64::checked_add(first, chunks)?;
            found.push(CellChunks {
                cell,
                chunks: first..end,
                checksum,
            });
            first = end;
            let mut squares = Box::new([0; SQUARES_PER_CELL]);
            for count in squares.iter_mut() {
                *count = rest.u64()?;
            }
            self.counts.insert(cell, squares);
        }
        for _ in 0..sources {
            let counts = PointCounts {
                read: rest.u64()?,
                rejected: rest.u64()?,
                filtered: rest.u64()?,
                outside: rest.u64()?,
            };
            let is_done = rest.u64()? != 0;
            self.sources.push(SourceProgress { counts, is_done });
        }
        (first == self.chunks && rest.0.is_empty()).then_some(found)
    }
}
