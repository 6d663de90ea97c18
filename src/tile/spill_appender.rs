//! A spill that grows: its buffers, its file, and its checkpoints.

use std::{
    collections::HashMap,
    fs::{self, File},
    io::{self, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use super::{
    batch::Batch,
    error::TileError,
    spill_index::{Chunk, SourceProgress, SpillIndex, checkpoint_path, index_path, spill_path},
};
use crate::{
    geometry::Stored,
    tiling::{CellGrid, CellKey},
};

/// Bytes of the buffer of one cell.
const BUFFER_BYTES: usize = 64 << 10;
/// The number of buffers, however little memory there is.
const MIN_BUFFERS: usize = 16;

/// The settings of a spill that grows.
#[derive(Clone, Copy, Debug)]
pub(super) struct AppendOptions {
    /// Length of a record in bytes.
    pub(super) record_length: usize,
    /// Memory for the buffers of the cells, in bytes.
    pub(super) buffer_bytes: usize,
    /// Bytes that are appended between two checkpoints.
    pub(super) checkpoint_bytes: u64,
}

/// Appends records to a spill. It is the only owner of the buffers and of the file.
pub(super) struct SpillAppender {
    /// The path of the spill's files, without their extensions.
    stem: PathBuf,
    /// The path of the records.
    path: PathBuf,
    file: File,
    /// The chunks that are in the file, and the counts and bounds of all records, including
    /// those in the buffers.
    index: SpillIndex,
    options: AppendOptions,
    /// The records that are not in the file as yet, for each cell that has a buffer.
    buffers: HashMap<CellKey, Vec<u8>>,
    max_buffers: usize,
    /// Bytes appended since the last checkpoint.
    since_checkpoint: u64,
}

impl SpillAppender {
    /// Opens the spill at `stem` as the last checkpoint left it, or makes a new one.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if its file cannot be made.
    pub(super) fn open(
        stem: &Path,
        grid: CellGrid,
        options: &AppendOptions,
        sources: usize,
    ) -> Result<Self, TileError> {
        let path = spill_path(stem);
        let index = checkpoint(stem, options, sources)
            .unwrap_or_else(|| SpillIndex::empty(grid, options.record_length, sources));
        // What follows the checkpoint is cut off: those records are scattered again.
        let open = || -> io::Result<File> {
            let mut file = File::options()
                .create(true)
                .truncate(false)
                .write(true)
                .open(&path)?;
            file.set_len(index.bytes)?;
            file.seek(SeekFrom::Start(index.bytes))?;
            Ok(file)
        };
        let file = open().map_err(|source| TileError::io("create", &path, source))?;
        Ok(Self {
            stem: stem.to_owned(),
            file,
            index,
            options: *options,
            buffers: HashMap::new(),
            max_buffers: (options.buffer_bytes / BUFFER_BYTES).max(MIN_BUFFERS),
            since_checkpoint: 0,
            path,
        })
    }

    /// The grid of the spill, as coarse as it has become.
    pub(super) fn grid(&self) -> CellGrid {
        self.index.grid
    }

    /// How far every source has been taken.
    pub(super) fn sources(&self) -> &[SourceProgress] {
        &self.index.sources
    }

    /// Records that the source with the index `source` has no more points.
    pub(super) fn end(&mut self, source: usize) {
        self.index.sources[source].is_done = true;
    }

    /// Appends the records of `batch`, and writes a checkpoint if it is due.
    pub(super) fn append(&mut self, batch: &Batch) -> Result<(), TileError> {
        let length = self.options.record_length;
        let mut start = 0;
        for &(cell, count) in &batch.cells {
            let records = &batch.records[start..start + count as usize * length];
            start += records.len();
            let cell = self.cell_in_this_grid(cell, batch.grid);
            let counts = self.index.counts.entry(cell);
            let counts = counts.or_insert_with(|| Box::new([0; _]));
            // Copies that stay in registers over the records of a cell.
            let (grid, mut bounds) = (self.index.grid, self.index.bounds);
            for record in records.chunks_exact(length) {
                let point = Stored::of_record(record);
                counts[grid.square_in_cell(point)] += 1;
                bounds.grow(point);
            }
            self.index.bounds = bounds;
            self.buffer(cell, records)?;
            while self.index.has_too_many_cells() {
                self.flush_all()?;
                self.index.coarsen();
            }
        }
        self.index.sources[batch.source].counts.add(&batch.counts);
        self.since_checkpoint += batch.records.len() as u64;
        if self.since_checkpoint >= self.options.checkpoint_bytes {
            self.flush_all()?;
            self.index.write(&checkpoint_path(&self.stem))?;
            self.since_checkpoint = 0;
        }
        Ok(())
    }

    /// Completes the spill.
    pub(super) fn finish(mut self) -> Result<(), TileError> {
        self.flush_all()?;
        self.index.write(&index_path(&self.stem))?;
        drop(fs::remove_file(checkpoint_path(&self.stem)));
        Ok(())
    }

    /// Returns the cell of this spill's grid that contains `cell` of `grid`, which is the same
    /// grid or a finer one.
    fn cell_in_this_grid(&self, mut cell: CellKey, mut grid: CellGrid) -> CellKey {
        while grid.edge() < self.index.grid.edge() {
            cell = cell.parent();
            grid = grid.coarser();
        }
        cell
    }

    /// Puts `records` into the buffer of `cell`, or into the file if they are too many.
    fn buffer(&mut self, cell: CellKey, records: &[u8]) -> Result<(), TileError> {
        if !self.buffers.contains_key(&cell) && self.buffers.len() == self.max_buffers {
            self.flush_fullest()?;
        }
        let buffer = self
            .buffers
            .entry(cell)
            .or_insert_with(|| Vec::with_capacity(BUFFER_BYTES));
        if buffer.len() + records.len() <= BUFFER_BYTES {
            buffer.extend_from_slice(records);
            return Ok(());
        }
        // Too much for the buffer: its content is written first, then the new records.
        self.flush(cell)?;
        if records.len() < BUFFER_BYTES / 2 {
            self.buffer(cell, records)
        } else {
            self.write(cell, records)
        }
    }

    /// Flushes the fullest buffer; of equally full buffers, that of the first cell.
    fn flush_fullest(&mut self) -> Result<(), TileError> {
        // A loop of comparisons: as `max_by_key` it took a seventh of the time of a scatter.
        let mut fullest: Option<(usize, CellKey)> = None;
        for (&cell, records) in &self.buffers {
            let length = records.len();
            let is_fuller = |(most, first)| length > most || length == most && cell < first;
            if fullest.is_none_or(is_fuller) {
                fullest = Some((length, cell));
            }
        }
        fullest.map_or(Ok(()), |(_, cell)| self.flush(cell))
    }

    /// Writes the buffer of `cell` to the file.
    fn flush(&mut self, cell: CellKey) -> Result<(), TileError> {
        match self.buffers.remove(&cell) {
            Some(records) if !records.is_empty() => self.write(cell, &records),
            _ => Ok(()),
        }
    }

    /// Writes `records` to the end of the file, as a chunk of `cell`.
    fn write(&mut self, cell: CellKey, records: &[u8]) -> Result<(), TileError> {
        self.file
            .write_all(records)
            .map_err(|source| TileError::io("write to", &self.path, source))?;
        let (offset, bytes) = (self.index.bytes, records.len() as u64);
        self.index.chunks.push(Chunk {
            cell,
            file: 0,
            offset,
            bytes,
        });
        self.index.bytes += bytes;
        Ok(())
    }

    /// Writes all buffers to the file, and waits until the disk has them.
    fn flush_all(&mut self) -> Result<(), TileError> {
        let mut waiting: Vec<CellKey> = self.buffers.keys().copied().collect();
        waiting.sort_unstable();
        for cell in waiting {
            self.flush(cell)?;
        }
        self.file
            .sync_all()
            .map_err(|source| TileError::io("flush", &self.path, source))
    }
}

/// Reads the last checkpoint at `stem`; `None` if there is none, if it belongs to another scatter,
/// or if the file is shorter than the checkpoint says.
fn checkpoint(stem: &Path, options: &AppendOptions, sources: usize) -> Option<SpillIndex> {
    let index = SpillIndex::read(&checkpoint_path(stem)).ok()??;
    let length = fs::metadata(spill_path(stem)).ok()?.len();
    let is_same = index.record_length == options.record_length && index.sources.len() == sources;
    (is_same && length >= index.bytes).then_some(index)
}
