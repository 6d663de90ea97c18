//! A spill that grows: its buffers, its file, and its checkpoints.

use std::{
    collections::HashMap,
    fs::{self, File},
    io::{self, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use super::{
    CellGrid, CellKey, PointCounts, ScatterOptions, TileError,
    scatter::Batch,
    spill::{Chunk, Index, SourceProgress, checkpoint_path, index_path, spill_path},
};
use crate::geometry::Stored;

/// Bytes of one cell's buffer.
const BUFFER_BYTES: usize = 64 << 10;

/// The one owner of the buffers and of the file.
pub(super) struct Growing {
    /// Its files, without their endings.
    stem: PathBuf,
    path: PathBuf,
    file: File,
    /// What is in the file already, and the counts of what waits, too.
    index: Index,
    options: ScatterOptions,
    /// Records waiting, for each cell that has a buffer.
    buffers: HashMap<CellKey, Vec<u8>>,
    most_buffers: usize,
    /// Bytes taken since the last checkpoint.
    since_checkpoint: u64,
}

impl Growing {
    /// The spill at `stem` as the last checkpoint left it, or a new one.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if its file cannot be made.
    pub(super) fn open(
        stem: &Path,
        grid: CellGrid,
        options: &ScatterOptions,
        sources: usize,
    ) -> Result<Self, TileError> {
        let path = spill_path(stem);
        let index = checkpoint(stem, options, sources)
            .unwrap_or_else(|| Index::empty(grid, options.record_length, sources));
        // What was written after the checkpoint is written again.
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
            most_buffers: (options.buffer_bytes / BUFFER_BYTES).max(16),
            since_checkpoint: 0,
            path,
        })
    }

    /// The grid, as coarse as it has become.
    pub(super) fn grid(&self) -> CellGrid {
        self.index.grid
    }

    /// How far every source has come.
    pub(super) fn sources(&self) -> &[SourceProgress] {
        &self.index.sources
    }

    /// Says that `source` has no more points.
    pub(super) fn end(&mut self, source: usize) {
        self.index.sources[source].is_done = true;
    }

    /// Takes a batch of `source`, which stands for so many of its points.
    pub(super) fn take(
        &mut self,
        batch: &Batch,
        source: usize,
        points: &PointCounts,
    ) -> Result<(), TileError> {
        let length = self.options.record_length;
        let mut start = 0;
        for &(cell, count) in &batch.cells {
            let records = &batch.records[start..start + count as usize * length];
            start += records.len();
            let cell = self.grid_cell(cell, batch.grid);
            let counts = self.index.counts.entry(cell);
            let counts = counts.or_insert_with(|| Box::new([0; _]));
            for record in records.chunks_exact(length) {
                let point = Stored::of_record(record);
                counts[self.index.grid.square_in_cell(point)] += 1;
                self.index.bounds.grow(point);
            }
            self.append(cell, records)?;
            while self.index.is_crowded() {
                self.flush_all()?;
                self.index.coarsen();
            }
        }
        self.index.sources[source].counts.add(points);
        self.since_checkpoint += batch.records.len() as u64;
        if self.since_checkpoint >= self.options.checkpoint_bytes {
            self.flush_all()?;
            self.index.write(&checkpoint_path(&self.stem))?;
            self.since_checkpoint = 0;
        }
        Ok(())
    }

    /// The cell that a `cell` of a `finer` grid, or of this one, lies in.
    fn grid_cell(&self, mut cell: CellKey, mut finer: CellGrid) -> CellKey {
        while finer.edge() < self.index.grid.edge() {
            cell = cell.parent();
            finer = finer.coarser();
        }
        cell
    }

    fn append(&mut self, cell: CellKey, records: &[u8]) -> Result<(), TileError> {
        if !self.buffers.contains_key(&cell) && self.buffers.len() == self.most_buffers {
            // The fullest, and of equally full ones the first cell.
            let fullest = self
                .buffers
                .iter()
                .max_by_key(|(key, held)| (held.len(), std::cmp::Reverse(**key)))
                .map(|(&key, _)| key);
            if let Some(fullest) = fullest {
                self.flush(fullest)?;
            }
        }
        let buffer = self
            .buffers
            .entry(cell)
            .or_insert_with(|| Vec::with_capacity(BUFFER_BYTES));
        if buffer.len() + records.len() <= BUFFER_BYTES {
            buffer.extend_from_slice(records);
            return Ok(());
        }
        // Too much for the buffer: what waits goes out, then what came.
        self.flush(cell)?;
        if records.len() < BUFFER_BYTES / 2 {
            self.append(cell, records)
        } else {
            self.write(cell, records)
        }
    }

    fn flush(&mut self, cell: CellKey) -> Result<(), TileError> {
        match self.buffers.remove(&cell) {
            Some(records) if !records.is_empty() => self.write(cell, &records),
            _ => Ok(()),
        }
    }

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

    /// Brings all that was taken to the disk.
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

    /// Completes the spill.
    pub(super) fn finish(mut self) -> Result<(), TileError> {
        self.flush_all()?;
        self.index.write(&index_path(&self.stem))?;
        drop(fs::remove_file(checkpoint_path(&self.stem)));
        Ok(())
    }
}

/// The last checkpoint at `stem`, if it is of such a scatter and what it speaks of is
/// there.
fn checkpoint(stem: &Path, options: &ScatterOptions, sources: usize) -> Option<Index> {
    let index = Index::read(&checkpoint_path(stem)).ok()??;
    let held = fs::metadata(spill_path(stem)).ok()?.len();
    let is_same = index.record_length == options.record_length && index.sources.len() == sources;
    (is_same && held >= index.bytes).then_some(index)
}
