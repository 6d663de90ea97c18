//! Every point once, to the spill of its cell.
//!
//! ```text
//!   source ─► decoder ┐                      ┌ buffer of a cell ┐
//!   source ─► decoder ├─► bounded channel ─► ┤ buffer of a cell ├─► spill.bin
//!   source ─► decoder ┘   (back-pressure)    └ … a fixed number ┘   (appended)
//! ```
//!
//! Decoders take the sources in their order, one each, and sort a batch by cell
//! before they hand it on. One writer owns the buffers; when none is free, the
//! fullest is flushed, so that memory and open files stay the same however many
//! cells there are. The order of points within a cell depends on the threads;
//! whatever reads the spill sorts.

use std::{
    collections::HashMap,
    fs::File,
    io::Write,
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicBool, Ordering},
    },
};

use crossbeam::channel;

use crate::geometry::Stored;

use super::{
    CellGrid, CellKey, TileError,
    spill::{Bounds, Chunk, Index, SquareCounts, spill_path},
};

/// Why a source failed: said by the source, passed on as it is.
pub type SourceError = Box<dyn std::error::Error + Send + Sync>;

/// Opens a source, in the thread that reads it: five hundred inputs are not open
/// at once.
pub type Opener<'a> = Box<dyn FnOnce() -> Result<Box<dyn Source + 'a>, SourceError> + Send + 'a>;

/// A stream of records.
pub trait Source {
    /// Replaces `records` by the next ones and returns how many; 0 at the end.
    ///
    /// # Errors
    ///
    /// Whatever keeps the source from going on.
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<usize, SourceError>;
}

/// How a scatter is done.
#[derive(Clone, Copy, Debug)]
pub struct ScatterOptions {
    /// Length of a record in bytes.
    pub record_length: usize,
    /// Decoders at work.
    pub threads: usize,
    /// Memory for the buffers of the cells, in bytes.
    pub buffer_bytes: usize,
}

/// What a scatter did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scattered {
    /// Points of each source, in the order of the sources.
    pub points: Vec<u64>,
    /// Bytes appended to the spill.
    pub bytes: u64,
}

/// Bytes of one cell's buffer.
const BUFFER_BYTES: usize = 64 << 10;

/// Batches between decoders and writer, for each decoder.
const QUEUED_BATCHES: usize = 2;

/// A batch, sorted by cell.
struct Batch {
    source: usize,
    records: Vec<u8>,
    cells: Vec<(CellKey, u32)>,
}

/// Scatters `sources` over the cells of `grid` into the directory `dir`.
///
/// `progress` hears of points as they are taken in. The index is written last,
/// aside and renamed: its presence says that the spill is complete.
///
/// # Errors
///
/// [`TileError::Source`] as soon as a source fails, [`TileError::Io`] if the
/// spill cannot be written, [`TileError::Cancelled`] soon after `cancel` is
/// set. The spill is then of no use.
pub fn scatter(
    sources: Vec<Opener<'_>>,
    grid: CellGrid,
    dir: &Path,
    options: ScatterOptions,
    progress: &(dyn Fn(u64) + Sync),
    cancel: &AtomicBool,
) -> Result<Scattered, TileError> {
    let path = spill_path(dir);
    let file = File::create(&path).map_err(|source| TileError::io("create", &path, source))?;
    let mut writer = Writer::new(file, path, options, grid);
    let mut points = vec![0; sources.len()];
    let decoders = options.threads.clamp(1, sources.len().max(1));
    let waiting = Mutex::new(sources.into_iter().enumerate());
    let failed = AtomicBool::new(false);

    let (sender, receiver) =
        channel::bounded::<Result<Batch, SourceError>>(QUEUED_BATCHES * decoders);
    let result = std::thread::scope(|scope| {
        for _ in 0..decoders {
            let sender = sender.clone();
            let (waiting, failed) = (&waiting, &failed);
            scope.spawn(move || {
                loop {
                    // A decoder that panicked holds no lock: `next` does not.
                    let next = waiting
                        .lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner)
                        .next();
                    let Some((number, open)) = next else { return };
                    let stop = || failed.load(Ordering::Relaxed) || cancel.load(Ordering::Relaxed);
                    if let Err(error) = decode(number, open, grid, options, &sender, &stop) {
                        failed.store(true, Ordering::Relaxed);
                        // If the writer is gone it has an error of its own.
                        drop(sender.send(Err(error)));
                    }
                }
            });
        }
        drop(sender);
        for batch in receiver {
            let outcome = batch.map_err(TileError::Source).and_then(|batch| {
                let count = batch.records.len() / options.record_length;
                points[batch.source] += count as u64;
                progress(count as u64);
                writer.take(&batch)
            });
            if let Err(error) = outcome {
                failed.store(true, Ordering::Relaxed);
                // The rest of the channel is dropped with the receiver.
                return Err(error);
            }
        }
        Ok(())
    });
    result?;
    if cancel.load(Ordering::Relaxed) {
        return Err(TileError::Cancelled);
    }
    let bytes = writer.finish(dir)?;
    Ok(Scattered { points, bytes })
}

fn decode(
    number: usize,
    open: Opener<'_>,
    grid: CellGrid,
    options: ScatterOptions,
    sender: &channel::Sender<Result<Batch, SourceError>>,
    stop: &dyn Fn() -> bool,
) -> Result<(), SourceError> {
    let mut source = open()?;
    let mut records = Vec::new();
    while !stop() && source.next_batch(&mut records)? > 0 {
        if sender
            .send(Ok(sorted_by_cell(
                number,
                &records,
                grid,
                options.record_length,
            )))
            .is_err()
        {
            break;
        }
    }
    Ok(())
}

fn sorted_by_cell(source: usize, records: &[u8], grid: CellGrid, record_length: usize) -> Batch {
    let mut order: Vec<(CellKey, u32)> = records
        .chunks_exact(record_length)
        .zip(0..)
        .map(|(record, place)| (grid.cell(Stored::of_record(record)), place))
        .collect();
    // Scanners sweep: most neighbours in time are in one cell already.
    order.sort_unstable();
    let mut sorted = Vec::with_capacity(records.len());
    let mut cells: Vec<(CellKey, u32)> = Vec::new();
    for (cell, place) in order {
        let start = place as usize * record_length;
        sorted.extend_from_slice(&records[start..start + record_length]);
        match cells.last_mut() {
            Some((last, count)) if *last == cell => *count += 1,
            _ => cells.push((cell, 1)),
        }
    }
    Batch {
        source,
        records: sorted,
        cells,
    }
}

/// The one owner of the buffers and of the file.
struct Writer {
    file: File,
    path: PathBuf,
    grid: CellGrid,
    record_length: usize,
    /// Records waiting, for each cell that has a buffer.
    buffers: HashMap<CellKey, Vec<u8>>,
    most_buffers: usize,
    written: u64,
    chunks: Vec<Chunk>,
    counts: HashMap<CellKey, Box<SquareCounts>>,
    bounds: Bounds,
}

impl Writer {
    fn new(file: File, path: PathBuf, options: ScatterOptions, grid: CellGrid) -> Self {
        Self {
            file,
            path,
            grid,
            record_length: options.record_length,
            buffers: HashMap::new(),
            most_buffers: (options.buffer_bytes / BUFFER_BYTES).max(16),
            written: 0,
            chunks: Vec::new(),
            counts: HashMap::new(),
            bounds: Bounds::empty(),
        }
    }

    fn take(&mut self, batch: &Batch) -> Result<(), TileError> {
        let mut start = 0;
        for &(cell, count) in &batch.cells {
            let end = start + count as usize * self.record_length;
            let records = &batch.records[start..end];
            start = end;
            let counts = self.counts.entry(cell).or_insert_with(|| Box::new([0; _]));
            for record in records.chunks_exact(self.record_length) {
                let point = Stored::of_record(record);
                counts[self.grid.square_in_cell(point)] += 1;
                self.bounds.grow(point);
            }
            self.append(cell, records)?;
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

    fn finish(mut self, dir: &Path) -> Result<u64, TileError> {
        let mut waiting: Vec<CellKey> = self.buffers.keys().copied().collect();
        waiting.sort_unstable();
        for cell in waiting {
            self.flush(cell)?;
        }
        self.file
            .sync_all()
            .map_err(|source| TileError::io("flush", &self.path, source))?;
        self.chunks.sort_unstable_by_key(|c| (c.cell, c.offset));
        let mut counts: Vec<(CellKey, Box<SquareCounts>)> = self.counts.into_iter().collect();
        counts.sort_unstable_by_key(|&(cell, _)| cell);
        Index {
            grid: self.grid,
            record_length: self.record_length,
            bytes: self.written,
            bounds: self.bounds,
            chunks: self.chunks,
            counts,
        }
        .write(dir)?;
        Ok(self.written)
    }
}
