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
    spill::{
        Bounds, Chunk, Index, SourceProgress, SquareCounts, checkpoint_path, index_path, spill_path,
    },
};
use crate::geometry::Stored;

/// Bytes of one cell's buffer.
const BUFFER_BYTES: usize = 64 << 10;
/// Occupied cells at the most: with more the grid is made coarser. Their number goes
/// with the points alone, whatever their order, so the grid does, too.
const MOST_CELLS: usize = 8192;

/// The one owner of the buffers and of the file.
pub(super) struct Growing {
    /// Its files, without their endings.
    stem: PathBuf,
    path: PathBuf,
    file: File,
    grid: CellGrid,
    options: ScatterOptions,
    /// Records waiting, for each cell that has a buffer.
    buffers: HashMap<CellKey, Vec<u8>>,
    most_buffers: usize,
    written: u64,
    /// Bytes taken since the last checkpoint.
    since_checkpoint: u64,
    chunks: Vec<Chunk>,
    counts: HashMap<CellKey, Box<SquareCounts>>,
    bounds: Bounds,
    sources: Vec<SourceProgress>,
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
        let index = checkpoint(stem, options, sources).unwrap_or_else(|| Index {
            grid,
            record_length: options.record_length,
            bytes: 0,
            bounds: Bounds::empty(),
            chunks: Vec::new(),
            counts: Vec::new(),
            sources: vec![SourceProgress::default(); sources],
        });
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
            grid: index.grid,
            options: *options,
            buffers: HashMap::new(),
            most_buffers: (options.buffer_bytes / BUFFER_BYTES).max(16),
            written: index.bytes,
            since_checkpoint: 0,
            chunks: index.chunks,
            counts: index.counts.into_iter().collect(),
            bounds: index.bounds,
            sources: index.sources,
            path,
        })
    }

    /// The grid, as coarse as it has become.
    pub(super) fn grid(&self) -> CellGrid {
        self.grid
    }

    /// How far every source has come.
    pub(super) fn sources(&self) -> &[SourceProgress] {
        &self.sources
    }

    /// Says that `source` has no more points.
    pub(super) fn end(&mut self, source: usize) {
        self.sources[source].is_done = true;
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
            let counts = self.counts.entry(cell).or_insert_with(|| Box::new([0; _]));
            for record in records.chunks_exact(length) {
                let point = Stored::of_record(record);
                counts[self.grid.square_in_cell(point)] += 1;
                self.bounds.grow(point);
            }
            self.append(cell, records)?;
            while self.counts.len() > MOST_CELLS {
                self.coarsen()?;
            }
        }
        self.sources[source].counts.add(points);
        self.since_checkpoint += batch.records.len() as u64;
        if self.since_checkpoint >= self.options.checkpoint_bytes {
            self.flush_all()?;
            self.index().write(&checkpoint_path(&self.stem))?;
            self.since_checkpoint = 0;
        }
        Ok(())
    }

    /// The cell that a `cell` of a `finer` grid, or of this one, lies in.
    fn grid_cell(&self, mut cell: CellKey, mut finer: CellGrid) -> CellKey {
        while finer.edge() < self.grid.edge() {
            cell = cell.parent();
            finer = finer.coarser();
        }
        cell
    }

    /// Makes every four cells one.
    fn coarsen(&mut self) -> Result<(), TileError> {
        self.flush_all()?;
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
        Ok(())
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
        self.chunks.push(Chunk {
            cell,
            offset: self.written,
            bytes: records.len() as u64,
        });
        self.written += records.len() as u64;
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

    fn index(&self) -> Index {
        let mut chunks = self.chunks.clone();
        chunks.sort_unstable_by_key(|c| (c.cell, c.offset));
        let mut counts: Vec<(CellKey, Box<SquareCounts>)> = self
            .counts
            .iter()
            .map(|(&cell, squares)| (cell, squares.clone()))
            .collect();
        counts.sort_unstable_by_key(|&(cell, _)| cell);
        Index {
            grid: self.grid,
            record_length: self.options.record_length,
            bytes: self.written,
            bounds: self.bounds,
            chunks,
            counts,
            sources: self.sources.clone(),
        }
    }

    /// Completes the spill.
    pub(super) fn finish(mut self) -> Result<(), TileError> {
        self.flush_all()?;
        self.index().write(&index_path(&self.stem))?;
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
