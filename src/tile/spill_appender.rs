//! A spill that grows: its buffers, its file, and its checkpoints.
//!
//! ```text
//!   batch ─► buffer of its cell ─► thinned when it is full ─► file, or the spill in memory
//! ```
//!
//! As long as the points have room in memory every cell has a buffer, and there is no file. When
//! they have none any more, all go to the file, and a fixed number of buffers remains.

use std::{
    collections::HashMap,
    fs::{self, File},
    io::{self, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use super::{
    batch::{Batch, CellOfBatch},
    cell_points::CellPoints,
    chunk_table::Chunk,
    error::TileError,
    spill::Spill,
    spill_index::{SourceProgress, SpillIndex, checkpoint_path, index_path, spill_path},
    storage::Storage,
};
use crate::tiling::{CellGrid, CellKey};

/// Bytes of the buffer of one cell.
const BUFFER_BYTES: usize = 64 << 10;
/// The number of buffers, however little memory there is.
const MIN_BUFFERS: usize = 16;
/// Bytes of a buffer in memory that is thinned for the first time.
const FIRST_THINNED_BYTES: usize = 16 << 10;
/// Points stay in memory if thinning all of them leaves no more than this share of what may stay.
const LARGEST_SHARE_LEFT: f64 = 0.75;

/// The settings of a spill that grows.
#[derive(Clone, Copy, Debug)]
pub(super) struct AppendOptions {
    /// Length of a record in bytes.
    pub(super) record_length: usize,
    /// Memory for the buffers of the cells, in bytes.
    pub(super) buffer_bytes: usize,
    /// Bytes that are appended between two checkpoints.
    pub(super) checkpoint_bytes: u64,
    /// What is kept, and where.
    pub(super) storage: Storage,
}

/// Appends records to a spill. It is the only owner of the buffers and of the file.
pub(super) struct SpillAppender {
    /// The path of the spill's files, without their extensions.
    stem: PathBuf,
    /// The file of the points; `None` as long as they have room in memory.
    file: Option<GrowingFile>,
    /// The counts and bounds of all points, including those in the buffers.
    index: SpillIndex,
    /// The chunks that are in the file.
    chunks: Vec<Chunk>,
    options: AppendOptions,
    /// The points that are not in the file as yet, for each cell that has a buffer.
    buffers: HashMap<CellKey, Buffer>,
    max_buffers: usize,
    /// Bytes of all buffers.
    buffered: usize,
    /// Bytes read since the last checkpoint.
    since_checkpoint: u64,
}

/// The file of a spill that grows.
struct GrowingFile {
    path: PathBuf,
    file: File,
}

/// The points of a cell that are not in the file.
#[derive(Default)]
struct Buffer {
    points: CellPoints,
    /// Bytes that thinning has left.
    thinned_bytes: usize,
}

impl GrowingFile {
    /// Opens the file at `path`, or makes one, and cuts off what follows its first `bytes`.
    fn open(path: PathBuf, bytes: u64) -> Result<Self, TileError> {
        let open = || -> io::Result<File> {
            let mut file = File::options()
                .create(true)
                .truncate(false)
                .write(true)
                .open(&path)?;
            file.set_len(bytes)?;
            file.seek(SeekFrom::Start(bytes))?;
            Ok(file)
        };
        match open() {
            Ok(file) => Ok(Self { path, file }),
            Err(source) => Err(TileError::io("create", &path, source)),
        }
    }
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
        let found = checkpoint(stem, options, sources);
        let is_in_memory = found.is_none() && options.storage.memory_bytes > 0;
        let nothing = || {
            let index = SpillIndex::empty(grid, options.record_length, sources);
            (index, Vec::new())
        };
        let (index, chunks) = found.unwrap_or_else(nothing);
        // What follows the checkpoint is cut off: those records are scattered again.
        let file = match is_in_memory {
            true => None,
            false => Some(GrowingFile::open(spill_path(stem), index.bytes)?),
        };
        Ok(Self {
            stem: stem.to_owned(),
            file,
            index,
            chunks,
            options: *options,
            buffers: HashMap::new(),
            max_buffers: (options.buffer_bytes / BUFFER_BYTES).max(MIN_BUFFERS),
            buffered: 0,
            since_checkpoint: 0,
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

    /// Appends the points of `batch`, and writes a checkpoint if it is due.
    pub(super) fn append(&mut self, batch: &Batch) -> Result<(), TileError> {
        for part in &batch.cells {
            let cell = self.index.count(part.cell, batch.grid, &part.squares);
            match self.file {
                None => self.keep(cell, part, &batch.points),
                Some(_) => self.buffer(cell, part, &batch.points)?,
            }
            while self.index.has_too_many_cells() {
                self.coarsen()?;
            }
        }
        self.index.bounds.join(&batch.bounds);
        self.index.sources[batch.source].counts.add(&batch.counts);
        self.make_room()?;
        self.since_checkpoint += batch.bytes_read as u64;
        if self.file.is_some() && self.since_checkpoint >= self.options.checkpoint_bytes {
            self.flush_all()?;
            let path = checkpoint_path(&self.stem);
            self.index.write(&path, &mut self.chunks)?;
            self.since_checkpoint = 0;
        }
        Ok(())
    }

    /// Completes the spill.
    pub(super) fn finish(mut self) -> Result<Spill, TileError> {
        if self.file.is_some() {
            self.flush_all()?;
            let path = index_path(&self.stem);
            self.index.write(&path, &mut self.chunks)?;
            drop(fs::remove_file(checkpoint_path(&self.stem)));
            return Spill::open(&self.stem);
        }
        self.thin_all();
        let cells = self.buffers.into_iter().map(|(cell, buffer)| {
            let mut points = buffer.points;
            points.records.shrink_to_fit();
            points.sums.shrink_to_fit();
            (cell, points)
        });
        let thinned_by = self.options.storage.thinning;
        Ok(Spill::in_memory(cells.collect(), self.index, thinned_by))
    }

    /// Puts a part of a batch into the buffer of `cell`, in memory.
    fn keep(&mut self, cell: CellKey, part: &CellOfBatch, points: &CellPoints) {
        let buffer = self.buffers.entry(cell).or_default();
        let before = buffer.points.capacity();
        buffer.add(part, points);
        if let Some(thinning) = &self.options.storage.thinning {
            let bytes = buffer.points.bytes();
            if bytes >= FIRST_THINNED_BYTES.max(2 * buffer.thinned_bytes) {
                buffer.points.thin(self.options.record_length, thinning);
                buffer.thinned_bytes = buffer.points.bytes();
            }
        }
        self.buffered = self.buffered + buffer.points.capacity() - before;
    }

    /// Thins the points in memory if they take more room than they may, and begins a file if they
    /// still do.
    fn make_room(&mut self) -> Result<(), TileError> {
        let most = self.options.storage.memory_bytes;
        if self.file.is_some() || self.buffered as u64 <= most {
            return Ok(());
        }
        self.thin_all();
        if self.buffered as f64 <= LARGEST_SHARE_LEFT * most as f64 {
            return Ok(());
        }
        self.file = Some(GrowingFile::open(spill_path(&self.stem), 0)?);
        self.flush_all()
    }

    /// Thins all buffers, in parallel.
    fn thin_all(&mut self) {
        let Some(thinning) = self.options.storage.thinning else {
            return;
        };
        let record_length = self.options.record_length;
        self.buffers.par_iter_mut().for_each(|(_, buffer)| {
            buffer.points.thin(record_length, &thinning);
            buffer.thinned_bytes = buffer.points.bytes();
        });
        self.measure_buffers();
    }

    /// Finds the bytes of all buffers anew, after all of them have changed.
    fn measure_buffers(&mut self) {
        let buffers = self.buffers.values();
        self.buffered = buffers.map(|buffer| buffer.points.capacity()).sum();
    }

    /// Makes the grid coarser: every four buffers become one.
    fn coarsen(&mut self) -> Result<(), TileError> {
        if self.file.is_some() {
            self.flush_all()?;
        }
        self.index.coarsen();
        for chunk in &mut self.chunks {
            chunk.cell = chunk.cell.parent();
        }
        for (cell, finer) in std::mem::take(&mut self.buffers) {
            let buffer = self.buffers.entry(cell.parent()).or_default();
            let CellPoints { records, sums } = &finer.points;
            buffer.points.extend(records, sums);
            buffer.thinned_bytes += finer.thinned_bytes;
        }
        self.measure_buffers();
        Ok(())
    }

    /// Puts a part of a batch into the buffer of `cell`, and the buffer into the file if it is
    /// full of points that thinning keeps.
    fn buffer(
        &mut self,
        cell: CellKey,
        part: &CellOfBatch,
        points: &CellPoints,
    ) -> Result<(), TileError> {
        if !self.buffers.contains_key(&cell) && self.buffers.len() >= self.max_buffers {
            self.flush_fullest()?;
        }
        let buffer = self.buffers.entry(cell).or_default();
        buffer.add(part, points);
        if buffer.points.bytes() < BUFFER_BYTES {
            return Ok(());
        }
        if let Some(thinning) = &self.options.storage.thinning {
            buffer.points.thin(self.options.record_length, thinning);
        }
        if buffer.points.bytes() > BUFFER_BYTES / 2 {
            self.flush(cell)?;
        }
        Ok(())
    }

    /// Flushes the fullest buffer; of equally full buffers, that of the first cell.
    fn flush_fullest(&mut self) -> Result<(), TileError> {
        // A loop of comparisons: as `max_by_key` it took a seventh of the time of a scatter.
        let mut fullest: Option<(usize, CellKey)> = None;
        for (&cell, buffer) in &self.buffers {
            let length = buffer.points.bytes();
            let is_fuller = |(most, first)| length > most || length == most && cell < first;
            if fullest.is_none_or(is_fuller) {
                fullest = Some((length, cell));
            }
        }
        fullest.map_or(Ok(()), |(_, cell)| self.flush(cell))
    }

    /// Writes the buffer of `cell` to the end of the file, as a chunk.
    fn flush(&mut self, cell: CellKey) -> Result<(), TileError> {
        let (Some(buffer), Some(spill)) = (self.buffers.remove(&cell), &mut self.file) else {
            return Ok(());
        };
        let CellPoints { mut records, sums } = buffer.points;
        let chunk = Chunk {
            cell,
            offset: self.index.bytes,
            records: records.len() as u64,
            sums: sums.len() as u64,
        };
        CellPoints::encode_sums(&sums, &mut records);
        spill
            .file
            .write_all(&records)
            .map_err(|source| TileError::io("write to", &spill.path, source))?;
        self.index.add_chunk(&chunk);
        self.chunks.push(chunk);
        Ok(())
    }

    /// Writes all buffers to the file, and waits until the disk has them.
    fn flush_all(&mut self) -> Result<(), TileError> {
        let mut waiting: Vec<CellKey> = self.buffers.keys().copied().collect();
        waiting.sort_unstable();
        for cell in waiting {
            self.flush(cell)?;
        }
        match &self.file {
            Some(GrowingFile { path, file }) => file
                .sync_all()
                .map_err(|source| TileError::io("flush", path, source)),
            None => Ok(()),
        }
    }
}

impl Buffer {
    /// Adds a part of a batch.
    fn add(&mut self, part: &CellOfBatch, points: &CellPoints) {
        let (records, sums) = (&points.records[part.records.clone()], &points.sums);
        self.points.extend(records, &sums[part.sums.clone()]);
    }
}

/// Reads the last checkpoint at `stem`; `None` if there is none, if it belongs to another scatter,
/// or if the file is shorter than the checkpoint says.
fn checkpoint(
    stem: &Path,
    options: &AppendOptions,
    sources: usize,
) -> Option<(SpillIndex, Vec<Chunk>)> {
    let (index, table) = SpillIndex::read(&checkpoint_path(stem)).ok()??;
    let chunks = table.all_chunks().ok()?;
    let length = fs::metadata(spill_path(stem)).ok()?.len();
    let is_same = index.record_length == options.record_length && index.sources.len() == sources;
    (is_same && length >= index.bytes).then_some((index, chunks))
}
