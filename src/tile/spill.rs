//! The spill: every point of the input, by cell, and the index that finds them. A spill
//! that several processes filled is several such pairs of files, read as one.
//!
//! `.bin` is records and nothing else. `.index` is written once it is complete,
//! `.checkpoint` in the same form while it grows:
//!
//! ```text
//!   magic, edge, record length, bytes                   4 × u64
//!   chunks, cells, sources                              3 × u64
//!   bounds: min and max of x, y, z                      6 × i32
//!   chunks: row, column, offset, bytes                  24 bytes each
//!   cells: row, column, points of each counting square  8 + 64 × 8 bytes each
//!   sources: read, rejected, filtered, outside, ended   5 × u64 each
//! ```

use std::{
    collections::BTreeMap,
    fs::File,
    path::{Path, PathBuf},
};

use super::{PointCounts, TileError, read_checksummed, write_checksummed};
use crate::{
    geometry::Rect,
    tiling::{Bounds, CellGrid, CellKey, MAX_OCCUPIED_CELLS, SQUARES_PER_CELL_EDGE},
};

const MAGIC: u64 = u64::from_le_bytes(*b"llspill3");

/// Points of every counting square of a cell, row by row.
pub(super) type SquareCounts = [u64; (SQUARES_PER_CELL_EDGE * SQUARES_PER_CELL_EDGE) as usize];

/// Records of one cell that lie together in a file of the spill.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Chunk {
    pub(super) cell: CellKey,
    /// Which of the spill's files: not written, for an index is of one.
    pub(super) file: u32,
    pub(super) offset: u64,
    pub(super) bytes: u64,
}

/// How far a source has been scattered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SourceProgress {
    /// Points taken from it.
    pub(crate) counts: PointCounts,
    /// Whether there are no more.
    pub(crate) is_done: bool,
}

/// What is known of a spill.
#[derive(Debug)]
pub(super) struct Index {
    pub(super) grid: CellGrid,
    pub(super) record_length: usize,
    pub(super) bytes: u64,
    pub(super) bounds: Bounds,
    pub(super) chunks: Vec<Chunk>,
    pub(super) counts: BTreeMap<CellKey, Box<SquareCounts>>,
    pub(super) sources: Vec<SourceProgress>,
}

pub(super) fn spill_path(stem: &Path) -> PathBuf {
    stem.with_extension("bin")
}

pub(super) fn index_path(stem: &Path) -> PathBuf {
    stem.with_extension("index")
}

pub(super) fn checkpoint_path(stem: &Path) -> PathBuf {
    stem.with_extension("checkpoint")
}

/// A complete spill: of one file, or of several that each hold some of the sources.
#[derive(Debug)]
pub struct Spill {
    pub(super) files: Vec<PathBuf>,
    pub(super) index: Index,
    points: u64,
}

impl Spill {
    /// Whether there is a complete spill at `stem`: the path of its files, without
    /// their endings.
    pub(crate) fn is_complete(stem: &Path) -> bool {
        index_path(stem).exists()
    }

    /// Opens the spill at `stem`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read, [`TileError::Damaged`] if index
    /// and records are not what was written.
    pub fn open(stem: &Path) -> Result<Self, TileError> {
        Self::join(&[stem.to_owned()])
    }

    /// Opens the spills at `stems` as one, as if their sources had been scattered
    /// together, in this order.
    ///
    /// # Errors
    ///
    /// As [`open`](Self::open); [`TileError::Damaged`], too, if they were not begun with
    /// the same grid, or there are none.
    pub(crate) fn join(stems: &[PathBuf]) -> Result<Self, TileError> {
        let mut joined: Option<Index> = None;
        for (file, stem) in (0..).zip(stems) {
            let index = Self::index(stem)?;
            joined = Some(match joined {
                None => index,
                Some(before) => before
                    .join(index, file)
                    .ok_or_else(|| TileError::damaged(&index_path(stem)))?,
            });
        }
        let index = joined.ok_or_else(|| TileError::damaged(Path::new("the spill")))?;
        let squares = index.counts.values().flat_map(|squares| squares.iter());
        Ok(Self {
            points: squares.sum(),
            files: stems.iter().map(|stem| spill_path(stem)).collect(),
            index,
        })
    }

    /// The index of the spill at `stem`, whose records are there.
    fn index(stem: &Path) -> Result<Index, TileError> {
        let index_path = index_path(stem);
        let index = Index::read(&index_path)?.ok_or_else(|| TileError::damaged(&index_path))?;
        let path = spill_path(stem);
        // Opened: what a network knows of a file by its name alone may be a minute old.
        let length = File::open(&path).and_then(|file| file.metadata());
        let length = length.map_err(|source| TileError::io("read", &path, source))?;
        match length.len() == index.bytes {
            true => Ok(index),
            false => Err(TileError::damaged(&path)),
        }
    }

    /// Removes its files; what cannot be removed stays.
    pub(crate) fn remove(self) {
        for path in self.files {
            drop(std::fs::remove_file(path.with_extension("index")));
            drop(std::fs::remove_file(path));
        }
    }

    /// Number of points.
    pub(crate) fn points(&self) -> u64 {
        self.points
    }

    /// True bounds of the points.
    pub(crate) fn bounds(&self) -> Bounds {
        self.index.bounds
    }

    /// Length of a record in bytes.
    pub(crate) fn record_length(&self) -> usize {
        self.index.record_length
    }

    /// The grid that the points were spilled by.
    pub(crate) fn grid(&self) -> CellGrid {
        self.index.grid
    }

    /// What was taken from each source, in the order of the sources.
    pub(crate) fn sources(&self) -> impl Iterator<Item = PointCounts> + '_ {
        self.index.sources.iter().map(|source| source.counts)
    }

    /// Bytes on disk, records and index.
    pub(crate) fn bytes(&self) -> u64 {
        self.index.bytes
            + 24 * self.index.chunks.len() as u64
            + (8 + 8 * 64) * self.index.counts.len() as u64
    }

    /// The occupied counting squares, by their south-west corner in units of
    /// squares, and the points in each; in a fixed order.
    pub(crate) fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_ {
        self.index.counts.iter().flat_map(|(cell, squares)| {
            let corner = [cell.column, cell.row].map(|c| i64::from(c) * SQUARES_PER_CELL_EDGE);
            (0..)
                .zip(squares.iter())
                .filter(|&(_, &count)| count > 0)
                .map(move |(place, &count): (i64, &u64)| {
                    (
                        [
                            corner[0] + place % SQUARES_PER_CELL_EDGE,
                            corner[1] + place / SQUARES_PER_CELL_EDGE,
                        ],
                        count,
                    )
                })
        })
    }

    /// The chunks of the cells that `rect` touches, in the order of the files.
    pub(super) fn chunks(&self, rect: &Rect) -> Vec<Chunk> {
        let mut chunks: Vec<Chunk> = self
            .index
            .chunks
            .iter()
            .filter(|chunk| self.index.grid.rect(chunk.cell).intersects(rect))
            .copied()
            .collect();
        chunks.sort_unstable_by_key(|chunk| (chunk.file, chunk.offset));
        chunks
    }
}

impl Index {
    /// Nothing as yet.
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

    /// Whether it has too many cells.
    pub(super) fn is_crowded(&self) -> bool {
        self.counts.len() > MAX_OCCUPIED_CELLS
    }

    /// Makes every four cells one.
    pub(super) fn coarsen(&mut self) {
        self.grid = self.grid.coarser();
        for chunk in &mut self.chunks {
            chunk.cell = chunk.cell.parent();
        }
        for (cell, finer) in std::mem::take(&mut self.counts) {
            let parent = self.counts.entry(cell.parent());
            let counts = parent.or_insert_with(|| Box::new([0; _]));
            for (place, count) in finer.iter().enumerate() {
                counts[CellGrid::square_in_parent(cell, place)] += count;
            }
        }
    }

    /// Both together, `other` being that of file number `file`; `None` if they were not
    /// begun with the same grid.
    fn join(mut self, mut other: Self, file: u32) -> Option<Self> {
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
        while self.is_crowded() {
            self.coarsen();
        }
        Some(self)
    }

    /// Writes it to `path`, complete or not at all.
    pub(super) fn write(&self, path: &Path) -> Result<(), TileError> {
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
            out.extend(chunk.bytes.to_le_bytes());
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
        write_checksummed(path, &out).map_err(|source| TileError::io("write", path, source))
    }

    /// The index at `path`; `None` if it is not what was written.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read.
    pub(super) fn read(path: &Path) -> Result<Option<Self>, TileError> {
        let content =
            read_checksummed(path).map_err(|source| TileError::io("read", path, source))?;
        Ok(content.and_then(|content| Self::decode(&content)))
    }

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
            let cell = rest.cell()?;
            let (offset, bytes) = (rest.u64()?, rest.u64()?);
            let whole = record_length >= 12 && bytes % record_length as u64 == 0;
            if !whole || offset.checked_add(bytes)? > total {
                return None;
            }
            index.chunks.push(Chunk {
                cell,
                file: 0,
                offset,
                bytes,
            });
        }
        for _ in 0..cells {
            let cell = rest.cell()?;
            let mut squares =
                Box::new([0; (SQUARES_PER_CELL_EDGE * SQUARES_PER_CELL_EDGE) as usize]);
            for count in squares.iter_mut() {
                *count = rest.u64()?;
            }
            index.counts.insert(cell, squares);
        }
        for _ in 0..sources {
            let counts = PointCounts {
                read: rest.u64()?,
                rejected: rest.u64()?,
                filtered: rest.u64()?,
                outside: rest.u64()?,
            };
            let is_done = rest.u64()? != 0;
            index.sources.push(SourceProgress { counts, is_done });
        }
        (index.grid.edge() == edge && rest.0.is_empty()).then_some(index)
    }
}

/// Takes numbers from the front of a slice, as long as there are any.
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
}
