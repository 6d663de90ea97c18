//! The points of a tile, read back from the spill: those of its core and of its halo, which lies
//! in the neighbouring cells.
//!
//! ```text
//!   spill.bin   ░░██░░░████████░░░░░░░░░░░█░░██░░░    █ chunks of cells that meet the rectangle
//!                 └──── window ────┘     └window┘     small gaps are read along
//! ```

use std::{
    fs::File,
    io::{ErrorKind, Read, Seek, SeekFrom},
};

use rayon::prelude::*;

use super::{error::TileError, spill::Spill, spill_index::Chunk};
use crate::geometry::{Rect, Stored};

/// Bytes that are read at once. They are read, not mapped: a disk that fails under a map ends the
/// program, and a disk that fails under a read gives an error that names the file.
const WINDOW_BYTES: u64 = 8 << 20;
/// The longest gap of other cells' records that is read along rather than skipped, in bytes.
const MAX_GAP_BYTES: u64 = 64 << 10;
/// The number of windows that each thread reads before the results are taken.
const WINDOWS_PER_THREAD: usize = 4;

impl Spill {
    /// Calls `visit` with every record whose point lies in `rect`. The order of the records
    /// depends on the threads of the scatter.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if the spill cannot be read, [`TileError::Damaged`] if it has become
    /// shorter.
    pub fn gather(&self, rect: &Rect, mut visit: impl FnMut(&[u8])) -> Result<(), TileError> {
        let mut buffer = Vec::new();
        for chunks in &windows(&self.chunks(rect), WINDOW_BYTES) {
            self.visit_window(chunks, rect, &mut buffer, &mut visit)?;
        }
        Ok(())
    }

    /// Reads the records whose points lie in `rect` in parallel. `visit` adds a record to the
    /// result of the window that contains it. `take` receives the results of a few windows, in
    /// the order of the windows, before the next windows are read.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if the spill cannot be read, [`TileError::Damaged`] if it has become
    /// shorter.
    pub(crate) fn gather_each<T: Default + Send>(
        &self,
        rect: &Rect,
        visit: impl Fn(&mut T, &[u8]) + Sync,
        mut take: impl FnMut(T),
    ) -> Result<(), TileError> {
        // The windows of all threads together take as much memory as the window of one.
        let threads = rayon::current_num_threads();
        let chunks = self.chunks(rect);
        let windows = windows(&chunks, WINDOW_BYTES / threads as u64);
        for few in windows.chunks(WINDOWS_PER_THREAD * threads) {
            let found: Vec<T> = few
                .par_iter()
                .map_init(Vec::new, |buffer, chunks| {
                    let mut found = T::default();
                    let mut visit = |record: &[u8]| visit(&mut found, record);
                    self.visit_window(chunks, rect, buffer, &mut visit)?;
                    Ok(found)
                })
                .collect::<Result<_, TileError>>()?;
            found.into_iter().for_each(&mut take);
        }
        Ok(())
    }

    /// Reads the window of `chunks` into `buffer`, and visits its records in `rect`.
    fn visit_window(
        &self,
        chunks: &[Chunk],
        rect: &Rect,
        buffer: &mut Vec<u8>,
        visit: &mut impl FnMut(&[u8]),
    ) -> Result<(), TileError> {
        let start = chunks.first().map_or(0, |chunk| chunk.offset);
        let end = chunks.last().map_or(0, |chunk| chunk.offset + chunk.bytes);
        // A window is one chunk or a few MiB, and fits in memory.
        buffer.resize((end - start) as usize, 0);
        let path = &self.files[chunks.first().map_or(0, |chunk| chunk.file as usize)];
        let read = File::open(path).and_then(|mut file| {
            file.seek(SeekFrom::Start(start))?;
            file.read_exact(buffer)
        });
        read.map_err(|source| match source.kind() {
            ErrorKind::UnexpectedEof => TileError::damaged(path),
            _ => TileError::io("read", path, source),
        })?;
        for chunk in chunks {
            self.visit_chunk(chunk, start, buffer, rect, visit);
        }
        Ok(())
    }

    /// Visits the records of `chunk` in `rect`; `window` begins at `window_start` in the file.
    fn visit_chunk(
        &self,
        chunk: &Chunk,
        window_start: u64,
        window: &[u8],
        rect: &Rect,
        visit: &mut impl FnMut(&[u8]),
    ) {
        let start = (chunk.offset - window_start) as usize;
        let records = &window[start..start + chunk.bytes as usize];
        let is_inside = rect.covers(&self.grid().rect(chunk.cell));
        for record in records.chunks_exact(self.record_length()) {
            if is_inside || rect.contains(Stored::of_record(record)) {
                visit(record);
            }
        }
    }
}

/// Divides `chunks`, which are in the order of the files, into windows of chunks that lie close
/// together. A window has at most `max_bytes`, or is a single chunk.
fn windows(chunks: &[Chunk], max_bytes: u64) -> Vec<&[Chunk]> {
    let mut windows = Vec::new();
    let mut rest = chunks;
    while let Some(first) = rest.first() {
        let is_near = |pair: &&[Chunk]| {
            let end = pair[0].offset + pair[0].bytes;
            let is_close = pair[0].file == pair[1].file && pair[1].offset - end <= MAX_GAP_BYTES;
            is_close && pair[1].offset + pair[1].bytes <= first.offset + max_bytes
        };
        let count = 1 + rest.windows(2).take_while(is_near).count();
        let (near, far) = rest.split_at(count);
        windows.push(near);
        rest = far;
    }
    windows
}
