//! Every point once, to the spill of its cell.
//!
//! ```text
//!   source ─► decoder ┐                      ┌ buffer of a cell ┐
//!   source ─► decoder ├─► bounded channel ─► ┤ buffer of a cell ├─► spill.bin
//!   source ─► decoder ┘   (back-pressure)    └ … a fixed number ┘   (appended)
//! ```
//!
//! Decoders take the sources in their order, one at a time each, and sort a batch by cell, or thin it,
//! before they send it. One [`SpillAppender`] owns the buffers; when none is free, the fullest is
//! flushed, so that memory and open files stay the same however many cells there are. The order
//! of points within a cell depends on the threads; whatever reads the spill sorts.
//!
//! Now and then all buffers are flushed, and a checkpoint records how many points of every source
//! have been taken: a scatter that was killed continues from there.

use std::{
    path::Path,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, AtomicI64, Ordering},
    },
};

use crossbeam::channel::{self, Receiver, Sender};

use super::{
    batch::Batch,
    error::TileError,
    source::{Opener, SourceError},
    spill::Spill,
    spill_appender::{AppendOptions, SpillAppender},
    storage::Storage,
    voxel_batch::VoxelBatch,
};
use crate::{lloyd::Thinning, tiling::CellGrid};

/// The settings of a scatter.
#[derive(Clone, Copy, Debug)]
pub struct ScatterOptions {
    /// Length of a record in bytes.
    pub record_length: usize,
    /// The number of decoders that work at the same time.
    pub threads: usize,
    /// Memory for the buffers of the cells, in bytes.
    pub buffer_bytes: usize,
    /// Bytes that are spilled between two checkpoints.
    pub checkpoint_bytes: u64,
    /// Whether the other sources are still read when one fails, so that all failures are
    /// reported.
    pub keep_going: bool,
}

/// The number of batches that wait between decoders and appender, for each decoder.
const QUEUED_BATCHES: usize = 2;

/// A decoder thins its batches as long as no more than this share of their bytes is left.
const WORTHWHILE_SHARE: f64 = 0.75;
/// The number of calls of a source whose points are not thinned after a batch that was not worth it.
const CALLS_BETWEEN_TRIALS: u32 = 15;

/// What a decoder sends to the appender.
enum Message {
    /// Records of a source.
    Batch(Batch),
    /// The source with this index has ended.
    Done(usize),
    /// The source with this index has failed.
    Failed(usize, SourceError),
}

/// Scatters `sources` over the cells of `grid`, or of a coarser grid if there are too many cells,
/// into the spill at `stem`; continues from a checkpoint of the same sources.
///
/// `progress` receives the number of points as they are taken. The index is written last, under
/// another name, and renamed: its presence means that the spill is complete.
///
/// # Errors
///
/// [`TileError::Sources`] if sources fail, [`TileError::Io`] if the spill cannot be written,
/// [`TileError::Cancelled`] soon after `cancel` is set.
pub fn scatter(
    sources: Vec<Opener<'_>>,
    grid: CellGrid,
    stem: &Path,
    options: ScatterOptions,
    progress: &(dyn Fn(u64) + Sync),
    cancel: &AtomicBool,
) -> Result<(), TileError> {
    let storage = Storage::default();
    scatter_into(sources, grid, stem, options, storage, progress, cancel).map(drop)
}

/// Scatters like [`scatter`], but keeps points as `storage` says; returns the spill.
///
/// # Errors
///
/// A [`TileError`], for the reasons that [`scatter`] has.
pub(crate) fn scatter_into(
    sources: Vec<Opener<'_>>,
    grid: CellGrid,
    stem: &Path,
    options: ScatterOptions,
    storage: Storage,
    progress: &(dyn Fn(u64) + Sync),
    cancel: &AtomicBool,
) -> Result<Spill, TileError> {
    let to_append = AppendOptions {
        record_length: options.record_length,
        buffer_bytes: options.buffer_bytes,
        checkpoint_bytes: options.checkpoint_bytes,
        storage,
    };
    let mut appender = SpillAppender::open(stem, grid, &to_append, sources.len())?;
    let before = appender.sources().to_vec();
    progress(before.iter().map(|source| source.counts.read).sum());
    let missing: Vec<MissingSource<'_>> = (0..)
        .zip(sources)
        .zip(&before)
        .filter(|(_, source)| !source.is_done)
        .map(|((index, open), source)| MissingSource {
            index,
            skip: source.counts.read,
            open,
        })
        .collect();
    let decoders = options.threads.clamp(1, missing.len().max(1));
    let decoding = Decoding {
        waiting: Mutex::new(missing.into_iter()),
        edge: AtomicI64::new(appender.grid().edge()),
        record_length: options.record_length,
        checkpoint_bytes: options.checkpoint_bytes,
        thinning: storage.thinning,
        has_failed: AtomicBool::new(false),
        cancel,
    };
    let (sender, receiver) = channel::bounded(QUEUED_BATCHES * decoders);
    let failures = std::thread::scope(|scope| {
        for _ in 0..decoders {
            let (decoding, sender) = (&decoding, sender.clone());
            scope.spawn(move || decoding.decode_sources(sender));
        }
        drop(sender);
        decoding.append_all(receiver, &mut appender, options.keep_going, progress)
    })?;
    if cancel.load(Ordering::Relaxed) {
        return Err(TileError::Cancelled);
    }
    if !failures.is_empty() {
        return Err(TileError::Sources(failures));
    }
    appender.finish()
}

/// A source that is not, or not completely, in the spill.
struct MissingSource<'a> {
    index: usize,
    /// The number of its points that are in the spill already.
    skip: u64,
    open: Opener<'a>,
}

/// What the decoders and the appender share.
struct Decoding<'a, Waiting> {
    /// The sources that no decoder has taken as yet.
    waiting: Mutex<Waiting>,
    /// The edge of the appender's grid (stored units). It grows as the grid becomes coarser; a
    /// batch that was sorted by a finer grid is still right, but slower to append.
    edge: AtomicI64,
    record_length: usize,
    /// Bytes that are spilled between two checkpoints.
    checkpoint_bytes: u64,
    thinning: Option<Thinning>,
    /// Whether the appender has given up.
    has_failed: AtomicBool,
    cancel: &'a AtomicBool,
}

impl<'a, Waiting: Iterator<Item = MissingSource<'a>>> Decoding<'_, Waiting> {
    /// Decodes one source after the other, until none is left or nothing more is wanted.
    fn decode_sources(&self, sender: Sender<Message>) {
        loop {
            // A decoder that panicked has left the list whole: `next` does not panic.
            let next = self
                .waiting
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .next();
            let Some(MissingSource { index, skip, open }) = next else {
                return;
            };
            let last = match self.decode(index, skip, open, &sender) {
                Ok(true) => Message::Done(index),
                Ok(false) => return,
                Err(error) => Message::Failed(index, error),
            };
            if sender.send(last).is_err() {
                return;
            }
        }
    }

    /// Sends the rest of a source in batches, and returns whether the source has ended; it has
    /// not if nothing more is wanted.
    fn decode(
        &self,
        index: usize,
        skip: u64,
        open: Opener<'_>,
        sender: &Sender<Message>,
    ) -> Result<bool, SourceError> {
        let mut source = open(skip)?;
        let mut records = Vec::new();
        let grid = || CellGrid::new(self.edge.load(Ordering::Relaxed));
        let send = |batch| sender.send(Message::Batch(batch)).is_ok();
        let length = self.record_length;
        let mut voxels = (self.thinning).map(|thinning| VoxelBatch::new(length, grid(), thinning));
        // Points that thinning hardly reduces are thinned by the appender, cell by cell.
        let mut calls_unthinned = 0;
        while !self.is_stopped() {
            let counts = match source.next_batch(&mut records) {
                Ok(counts) => counts,
                Err(error) => {
                    // What was read before need not be read again.
                    voxels.map(|mut voxels| send(voxels.take(index, grid())));
                    return Err(error);
                }
            };
            let has_ended = counts.read == 0;
            let is_sent = match &mut voxels {
                Some(voxels) if calls_unthinned == 0 => {
                    voxels.add(&counts, &records);
                    if !voxels.is_complete(self.checkpoint_bytes) && !has_ended {
                        continue;
                    }
                    let batch = voxels.take(index, grid());
                    let left = batch.points.bytes() as f64 / batch.bytes_read.max(1) as f64;
                    if left > WORTHWHILE_SHARE {
                        calls_unthinned = CALLS_BETWEEN_TRIALS;
                    }
                    send(batch)
                }
                _ => {
                    calls_unthinned = calls_unthinned.saturating_sub(1);
                    let batch = Batch::sorted_by_cell(index, counts, &records, grid(), length);
                    has_ended || send(batch)
                }
            };
            if has_ended || !is_sent {
                return Ok(is_sent);
            }
        }
        Ok(false)
    }

    fn is_stopped(&self) -> bool {
        self.has_failed.load(Ordering::Relaxed) || self.cancel.load(Ordering::Relaxed)
    }

    /// Appends what the decoders send, until all have ended; returns the sources that failed.
    fn append_all(
        &self,
        receiver: Receiver<Message>,
        appender: &mut SpillAppender,
        keep_going: bool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<Vec<(usize, SourceError)>, TileError> {
        let mut failures = Vec::new();
        for message in receiver {
            let outcome = match message {
                Message::Batch(batch) => {
                    progress(batch.counts.read);
                    appender.append(&batch)
                }
                Message::Done(source) => {
                    appender.end(source);
                    Ok(())
                }
                Message::Failed(source, error) => {
                    failures.push((source, error));
                    match keep_going {
                        true => Ok(()),
                        false => Err(TileError::Sources(std::mem::take(&mut failures))),
                    }
                }
            };
            if let Err(error) = outcome {
                self.has_failed.store(true, Ordering::Relaxed);
                // The rest of the channel is dropped with the receiver.
                return Err(error);
            }
            self.edge.store(appender.grid().edge(), Ordering::Relaxed);
        }
        Ok(failures)
    }
}
