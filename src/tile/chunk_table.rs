//! Where the records of a complete spill lie.
//!
//! A spill has a chunk for every few ten thousand bytes, so that a list of all is as large as the memory of a server when the spill
//! is as large as a city. The list stays on the disk, in the order of the cells, and the part for a rectangle is read when that
//! rectangle is gathered. An entry has three numbers (u64, little endian): the offset of the chunk, the bytes of its records,
//! and the number of its sums.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    ops::Range,
    path::PathBuf,
};

use super::{
    cell_points::CellPoints, checksummed_file::checksum, error::TileError,
    number_reader::NumberReader,
};
use crate::{
    geometry::Rect,
    tiling::{CellGrid, CellKey},
};

/// Bytes of x, y and z at the beginning of every record.
const COORDINATE_BYTES: usize = 12;

/// Records of one cell that are contiguous in a file of a spill, followed by sums of points whose
/// records are not kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Chunk {
    /// The cell that contains the points.
    pub(super) cell: CellKey,
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

/// The entries of the chunks of one cell.
#[derive(Clone, Debug)]
pub(super) struct CellChunks {
    pub(super) cell: CellKey,
    /// The numbers of the entries.
    pub(super) chunks: Range<u64>,
    /// The checksum of the entries.
    pub(super) checksum: u64,
}

/// The list of the chunks of one file of a spill, on the disk.
#[derive(Debug)]
pub(super) struct ChunkTable {
    /// The path of the index, which contains the list.
    pub(super) path: PathBuf,
    /// The offset of the list, in bytes.
    pub(super) start: u64,
    /// The entries of each cell, in the order of the cells.
    pub(super) cells: Vec<CellChunks>,
    /// The grid of the cells.
    pub(super) grid: CellGrid,
    /// The length of a record, in bytes.
    pub(super) record_length: usize,
    /// The length of the file that contains the chunks, in bytes.
    pub(super) bytes: u64,
}

impl ChunkTable {
    /// Bytes of an entry.
    pub(super) const CHUNK_BYTES: u64 = 3 * 8;

    /// The entries of `chunks`.
    pub(super) fn encode(chunks: &[Chunk]) -> Vec<u8> {
        let numbers = chunks.iter().map(|c| [c.offset, c.records, c.sums]);
        numbers.flatten().flat_map(u64::to_le_bytes).collect()
    }

    /// Reads all chunks.
    ///
    /// # Errors
    ///
    /// See [`Self::chunks_in`].
    pub(super) fn all_chunks(&self) -> Result<Vec<Chunk>, TileError> {
        self.read(&self.cells.iter().collect::<Vec<_>>())
    }

    /// Reads the chunks of the cells that intersect `rect`, and returns them in the order of the file.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if they cannot be read, [`TileError::Damaged`] if they are not what was written.
    pub(super) fn chunks_in(&self, rect: &Rect) -> Result<Vec<Chunk>, TileError> {
        let rect_of = |of_cell: &CellChunks| self.grid.rect(of_cell.cell);
        // Cells are in the order of their rows.
        let south = (self.cells).partition_point(|cell| rect_of(cell).max[1] <= rect.min[1]);
        let (_, northern) = self.cells.split_at(south);
        let rows = northern.partition_point(|cell| rect_of(cell).min[1] < rect.max[1]);
        let in_rows = northern[..rows].iter();
        let cells: Vec<_> = (in_rows.filter(|cell| rect_of(cell).intersects(rect))).collect();
        self.read(&cells)
    }

    fn read(&self, cells: &[&CellChunks]) -> Result<Vec<Chunk>, TileError> {
        if cells.is_empty() {
            return Ok(Vec::new());
        }
        let chunks = File::open(&self.path).and_then(|mut file| self.read_from(&mut file, cells));
        match chunks {
            Ok(Some(mut chunks)) => {
                chunks.sort_unstable_by_key(|chunk| chunk.offset);
                Ok(chunks)
            }
            Ok(None) => Err(TileError::damaged(&self.path)),
            Err(source) => Err(TileError::unreadable(&self.path, source)),
        }
    }

    /// Reads the chunks of `cells`; `None` if they are not what was written.
    fn read_from(&self, file: &mut File, cells: &[&CellChunks]) -> io::Result<Option<Vec<Chunk>>> {
        let (mut found, mut entries) = (Vec::new(), Vec::new());
        // Cells whose entries follow each other are read at once.
        for together in cells.chunk_by(|a, b| a.chunks.end == b.chunks.start) {
            let (first, last) = (together[0], together[together.len() - 1]);
            file.seek(SeekFrom::Start(
                self.start + Self::CHUNK_BYTES * first.chunks.start,
            ))?;
            let bytes = Self::CHUNK_BYTES * (last.chunks.end - first.chunks.start);
            entries.resize(bytes as usize, 0);
            file.read_exact(&mut entries)?;
            let mut rest = &entries[..];
            for cell in together {
                let bytes = Self::CHUNK_BYTES * (cell.chunks.end - cell.chunks.start);
                let (of_cell, others) = rest.split_at(bytes as usize);
                rest = others;
                let decoded = (of_cell.chunks_exact(Self::CHUNK_BYTES as usize))
                    .map(|entry| self.decode(cell.cell, entry));
                match decoded.collect::<Option<Vec<Chunk>>>() {
                    Some(chunks) if checksum(of_cell) == cell.checksum => found.extend(chunks),
                    _ => return Ok(None),
                }
            }
        }
        Ok(Some(found))
    }

    /// Decodes the entry of a chunk of `cell`; `None` if the file does not contain such a chunk.
    fn decode(&self, cell: CellKey, entry: &[u8]) -> Option<Chunk> {
        let mut entry = NumberReader(entry);
        let (offset, records, sums) = (entry.u64()?, entry.u64()?, entry.u64()?);
        let length = self.record_length;
        let is_whole = length >= COORDINATE_BYTES && records % length as u64 == 0;
        let end = sums
            .checked_mul(CellPoints::SUM_BYTES as u64)?
            .checked_add(records)?
            .checked_add(offset)?;
        (is_whole && end <= self.bytes).then_some(Chunk {
            cell,
            offset,
            records,
            sums,
        })
    }
}
