//! Every point once, to the spill of its cell.
//!
//! ```text
//!   source ─► decoder ┐                      ┌ buffer of a cell ┐
//!   source ─► decoder ├─► bounded channel ─► ┤ buffer of a cell ├─► spill.bin
//!   source ─► decoder ┘   (back-pressure)    └ … a fixed number ┘   (appended)
//! ```
//!
//! Decoders take the sources in their order, one each, and sort a batch by cell
//! before they hand it on. One writer ([`Growing`]) owns the buffers; when none is
//! free, the fullest is flushed, so that memory and open files stay the same however
//! many cells there are. The order of points within a cell depends on the threads;
//! whatever reads the spill sorts.
//!
//! Now and then all buffers are flushed, and a checkpoint says how far every source
//! has come: a scatter that was killed goes on from there.

use std::{
    path::Path,
    sync::{
        Mutex,
        atomic::{AtomicBool, AtomicI64, Ordering},
    },
};

use crossbeam::channel;

use super::{CellGrid, CellKey, PointCounts, TileError, growing::Growing};
use crate::geometry::Stored;

/// Why a source failed: said by the source, passed on as it is.
pub type SourceError = Box<dyn std::error::Error + Send + Sync>;

/// Opens a source behind so many of its points, in the thread that reads it: five
/// hundred inputs are not open at once.
pub type Opener<'a> = Box<dyn FnOnce(u64) -> Result<Box<dyn Source + 'a>, SourceError> + Send + 'a>;

/// A stream of records.
pub trait Source {
    /// Replaces `records` by the next ones and says how many points they are of, left
    /// out ones included; none at the end.
    ///
    /// # Errors
    ///
    /// Whatever keeps the source from going on.
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError>;
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
    /// Bytes to be spilled between two checkpoints.
    pub checkpoint_bytes: u64,
    /// Whether the other sources are still read when one fails, so that all that fail
    /// are known.
    pub keep_going: bool,
}

/// Batches between decoders and writer, for each decoder.
const QUEUED_BATCHES: usize = 2;

/// A batch, sorted by cell.
pub(super) struct Batch {
    source: usize,
    counts: PointCounts,
    pub(super) records: Vec<u8>,
    /// The grid that it was sorted by …
    pub(super) grid: CellGrid,
    /// … and the records of each of its cells.
    pub(super) cells: Vec<(CellKey, u32)>,
}

/// What a decoder has to say.
enum Message {
    Batch(Batch),
    Done(usize),
    Failed(usize, SourceError),
}

/// Scatters `sources` over the cells of `grid`, or a coarser one if those are too
/// many, to the spill at `stem`; goes on from a checkpoint of the same sources.
///
/// `progress` hears of points as they are taken in. The index is written last,
/// aside and renamed: its presence says that the spill is complete.
///
/// # Errors
///
/// [`TileError::Sources`] if sources fail, [`TileError::Io`] if the spill cannot be
/// written, [`TileError::Cancelled`] soon after `cancel` is set.
pub fn scatter(
    sources: Vec<Opener<'_>>,
    grid: CellGrid,
    stem: &Path,
    options: ScatterOptions,
    progress: &(dyn Fn(u64) + Sync),
    cancel: &AtomicBool,
) -> Result<(), TileError> {
    let mut growing = Growing::open(stem, grid, &options, sources.len())?;
    let before = growing.sources().to_vec();
    progress(before.iter().map(|source| source.counts.read).sum());
    let missing: Vec<(usize, u64, Opener<'_>)> = (0..)
        .zip(sources)
        .zip(&before)
        .filter(|(_, source)| !source.is_done)
        .map(|((number, open), source)| (number, source.counts.read, open))
        .collect();
    let decoders = options.threads.clamp(1, missing.len().max(1));
    let waiting = Mutex::new(missing.into_iter());
    let edge = AtomicI64::new(growing.grid().edge());
    let failed = AtomicBool::new(false);
    let stop = || failed.load(Ordering::Relaxed) || cancel.load(Ordering::Relaxed);

    let (sender, receiver) = channel::bounded(QUEUED_BATCHES * decoders);
    let mut failures = Vec::new();
    std::thread::scope(|scope| {
        for _ in 0..decoders {
            let sender = sender.clone();
            let (waiting, edge, stop) = (&waiting, &edge, &stop);
            scope.spawn(move || {
                loop {
                    // A decoder that panicked holds no lock: `next` does not.
                    let next = waiting
                        .lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner)
                        .next();
                    let Some((number, skip, open)) = next else {
                        return;
                    };
                    let grid = || CellGrid::new(edge.load(Ordering::Relaxed));
                    let send = |batch| sender.send(Message::Batch(batch)).is_ok() && !stop();
                    let last = match decode(number, skip, open, &grid, &options, &send) {
                        Ok(true) => Message::Done(number),
                        Ok(false) => return,
                        Err(error) => Message::Failed(number, error),
                    };
                    if sender.send(last).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for message in receiver {
            let outcome = match message {
                Message::Batch(batch) => {
                    progress(batch.counts.read);
                    growing.take(&batch, batch.source, &batch.counts)
                }
                Message::Done(source) => {
                    growing.end(source);
                    Ok(())
                }
                Message::Failed(source, error) => {
                    failures.push((source, error));
                    match options.keep_going {
                        true => Ok(()),
                        false => Err(TileError::Sources(std::mem::take(&mut failures))),
                    }
                }
            };
            if let Err(error) = outcome {
                failed.store(true, Ordering::Relaxed);
                // The rest of the channel is dropped with the receiver.
                return Err(error);
            }
            edge.store(growing.grid().edge(), Ordering::Relaxed);
        }
        Ok(())
    })?;
    if cancel.load(Ordering::Relaxed) {
        return Err(TileError::Cancelled);
    }
    if !failures.is_empty() {
        return Err(TileError::Sources(failures));
    }
    growing.finish()
}

/// Hands the rest of a source to `send`, as long as that wants more; whether the
/// source came to its end.
fn decode(
    number: usize,
    skip: u64,
    open: Opener<'_>,
    grid: &dyn Fn() -> CellGrid,
    options: &ScatterOptions,
    send: &dyn Fn(Batch) -> bool,
) -> Result<bool, SourceError> {
    let mut source = open(skip)?;
    let mut records = Vec::new();
    loop {
        let counts = source.next_batch(&mut records)?;
        if counts.read == 0 {
            return Ok(true);
        }
        let batch = sorted_by_cell(number, counts, &records, grid(), options.record_length);
        if !send(batch) {
            return Ok(false);
        }
    }
}

pub(super) fn sorted_by_cell(
    source: usize,
    counts: PointCounts,
    records: &[u8],
    grid: CellGrid,
    record_length: usize,
) -> Batch {
    // Scanners sweep: most neighbours in time are in one cell already.
    let mut runs: Vec<(CellKey, usize, usize)> = Vec::new();
    for (record, place) in records.chunks_exact(record_length).zip(0..) {
        let cell = grid.cell(Stored::of_record(record));
        match runs.last_mut() {
            Some((last, _, end)) if *last == cell => *end = place + 1,
            _ => runs.push((cell, place, place + 1)),
        }
    }
    runs.sort_unstable();
    let mut sorted = Vec::with_capacity(records.len());
    let mut cells: Vec<(CellKey, u32)> = Vec::new();
    for (cell, start, end) in runs {
        sorted.extend_from_slice(&records[start * record_length..end * record_length]);
        let points = (end - start) as u32;
        match cells.last_mut() {
            Some((last, count)) if *last == cell => *count += points,
            _ => cells.push((cell, points)),
        }
    }
    Batch {
        source,
        counts,
        records: sorted,
        grid,
        cells,
    }
}
