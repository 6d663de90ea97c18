//! The points of a tile, read back from the spill: those of its core and of its halo, which lies
//! in the neighbouring cells.
//!
//! ```text
//!   spill.bin   ░░██░░░████████░░░░░░░░░░░█░░██░░░    █ chunks of cells that meet the rectangle
//!                 └──── window ────┘     └window┘     small gaps are read along
//! ```

use std::{
    collections::BTreeMap,
    fs::File,
    io::{Read, Seek, SeekFrom},
};

use rayon::prelude::*;

use super::{
    cell_points::{CellPoints, Spilled},
    chunk_table::Chunk,
    error::TileError,
    spill::{Place, Spill, SpillFile},
};
use crate::{
    geometry::{Rect, Stored},
    lloyd::PointSum,
    tiling::{CellGrid, CellKey},
};

/// Bytes that are read at once. They are read, not mapped: a disk that fails under a map ends the
/// program, and a disk that fails under a read gives an error that names the file.
const WINDOW_BYTES: u64 = 8 << 20;
/// The longest gap of other cells' records that is read along rather than skipped, in bytes.
const MAX_GAP_BYTES: u64 = 64 << 10;
/// The number of parts that each thread reads before the results are taken.
const PARTS_PER_THREAD: usize = 4;
/// The number of cells that are one part of a spill in memory.
const CELLS_PER_PART: usize = 32;

impl Spill {
    /// Calls `visit` with every record whose point lies in `rect`. The order of the records
    /// depends on the threads of the scatter.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if the spill cannot be read, [`TileError::Damaged`] if it has become
    /// shorter.
    pub fn gather(&self, rect: &Rect, mut visit: impl FnMut(&[u8])) -> Result<(), TileError> {
        let mut visit = |spilled: Spilled<'_>| {
            if let Spilled::Record(record) = spilled {
                visit(record);
            }
        };
        match &self.place {
            Place::Memory(cells) => {
                for (cell, points) in cells_in(cells, self.grid(), rect) {
                    let cell = self.grid().rect(*cell);
                    self.visit_cell(&cell, &points.records, &points.sums, rect, &mut visit);
                }
            }
            Place::Files(files) => {
                let mut buffer = Vec::new();
                for file in files {
                    for chunks in windows(&file.chunks.chunks_in(rect)?, WINDOW_BYTES) {
                        self.visit_window(file, chunks, rect, &mut buffer, &mut visit)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Reads the points in `rect` in parallel. `visit` adds what it is given to the result of a
    /// part of the spill. `take` receives the results of a few parts, in their order, before the
    /// next ones are read.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if the spill cannot be read, [`TileError::Damaged`] if it has become
    /// shorter.
    pub(crate) fn gather_each<T: Default + Send>(
        &self,
        rect: &Rect,
        visit: impl Fn(&mut T, Spilled<'_>) + Sync,
        mut take: impl FnMut(T),
    ) -> Result<(), TileError> {
        let threads = rayon::current_num_threads();
        let files = match &self.place {
            Place::Files(files) => files,
            Place::Memory(cells) => {
                let cells: Vec<_> = cells_in(cells, self.grid(), rect).collect();
                for few in cells.chunks(CELLS_PER_PART * PARTS_PER_THREAD * threads) {
                    let read = |cells: &[(&CellKey, &CellPoints)]| {
                        let mut found = T::default();
                        let mut visit = |spilled: Spilled<'_>| visit(&mut found, spilled);
                        for (cell, points) in cells {
                            let (records, sums) = (&points.records, &points.sums);
                            let cell = self.grid().rect(**cell);
                            self.visit_cell(&cell, records, sums, rect, &mut visit);
                        }
                        found
                    };
                    let parts: Vec<T> = few.par_chunks(CELLS_PER_PART).map(read).collect();
                    parts.into_iter().for_each(&mut take);
                }
                return Ok(());
            }
        };
        // The windows of all threads together take as much memory as the window of one.
        let chunks = |file: &SpillFile| file.chunks.chunks_in(rect);
        let chunks: Vec<Vec<Chunk>> = files.iter().map(chunks).collect::<Result<_, _>>()?;
        let max_bytes = WINDOW_BYTES / threads as u64;
        let windows: Vec<(&SpillFile, &[Chunk])> = (files.iter().zip(&chunks))
            .flat_map(|(file, chunks)| windows(chunks, max_bytes).map(move |few| (file, few)))
            .collect();
        for few in windows.chunks(PARTS_PER_THREAD * threads) {
            let parts: Vec<T> = few
                .par_iter()
                .map_init(Vec::new, |buffer, (file, chunks)| {
                    let mut found = T::default();
                    let mut visit = |spilled: Spilled<'_>| visit(&mut found, spilled);
                    self.visit_window(file, chunks, rect, buffer, &mut visit)?;
                    Ok(found)
                })
                .collect::<Result<_, TileError>>()?;
            parts.into_iter().for_each(&mut take);
        }
        Ok(())
    }

    /// Reads the window of `chunks` of `file` into `buffer`, and visits its points in `rect`.
    fn visit_window(
        &self,
        file: &SpillFile,
        chunks: &[Chunk],
        rect: &Rect,
        buffer: &mut Vec<u8>,
        visit: &mut impl FnMut(Spilled<'_>),
    ) -> Result<(), TileError> {
        let start = chunks.first().map_or(0, |chunk| chunk.offset);
        let end = chunks.last().map_or(0, Chunk::end);
        // A window is one chunk or a few MiB, and fits in memory.
        buffer.resize((end - start) as usize, 0);
        let path = &file.path;
        let read = File::open(path).and_then(|mut file| {
            file.seek(SeekFrom::Start(start))?;
            file.read_exact(buffer)
        });
        read.map_err(|source| TileError::unreadable(path, source))?;
        for chunk in chunks {
            let from = (chunk.offset - start) as usize;
            let (records, sums) =
                buffer[from..from + chunk.bytes() as usize].split_at(chunk.records as usize);
            let sums = sums.chunks_exact(CellPoints::SUM_BYTES);
            let sums: Vec<PointSum> = sums.map(CellPoints::decode_sum).collect();
            let cell = file.chunks.grid.rect(chunk.cell);
            self.visit_cell(&cell, records, &sums, rect, visit);
        }
        Ok(())
    }

    /// Visits those of the `records` and `sums` of `cell` that lie in `rect`. A sum lies where the
    /// mean of its points does.
    fn visit_cell(
        &self,
        cell: &Rect,
        records: &[u8],
        sums: &[PointSum],
        rect: &Rect,
        visit: &mut impl FnMut(Spilled<'_>),
    ) {
        let is_inside = rect.covers(cell);
        for record in records.chunks_exact(self.record_length()) {
            if is_inside || rect.contains(Stored::of_record(record)) {
                visit(Spilled::Record(record));
            }
        }
        for sum in sums {
            if is_inside || rect.contains(sum.mean()) {
                visit(Spilled::Sum(sum));
            }
        }
    }
}

/// The `cells` that intersect `rect`.
fn cells_in<'a>(
    cells: &'a BTreeMap<CellKey, CellPoints>,
    grid: CellGrid,
    rect: &Rect,
) -> impl Iterator<Item = (&'a CellKey, &'a CellPoints)> {
    let rect = *rect;
    cells
        .iter()
        .filter(move |(cell, _)| grid.rect(**cell).intersects(&rect))
}

/// Divides `chunks`, which are in the order of their file, into windows of chunks that lie close
/// together. A window has at most `max_bytes`, or is a single chunk.
fn windows(chunks: &[Chunk], max_bytes: u64) -> impl Iterator<Item = &[Chunk]> {
    let mut rest = chunks;
    std::iter::from_fn(move || {
        let first = rest.first()?;
        let is_near = |pair: &&[Chunk]| {
            let gap = pair[1].offset.saturating_sub(pair[0].end());
            gap <= MAX_GAP_BYTES && pair[1].end() <= first.offset + max_bytes
        };
        let count = 1 + rest.windows(2).take_while(is_near).count();
        let (near, far) = rest.split_at(count);
        rest = far;
        Some(near)
    })
}
