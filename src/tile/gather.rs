//! A tile's points from the spill: those of its core, and of its halo, which
//! is nothing but the neighbouring cells.

use std::fs::File;

use rayon::prelude::*;

use super::{Spill, TileError, map::window, spill::Chunk};
use crate::geometry::{Rect, Stored};

/// Bytes mapped at once.
const WINDOW_BYTES: u64 = 8 << 20;

impl Spill {
    /// Calls `visit` with every record whose point lies in `rect`, in no order
    /// that may be relied on.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if the spill cannot be read.
    pub fn gather(&self, rect: &Rect, mut visit: impl FnMut(&[u8])) -> Result<(), TileError> {
        let file = self.open_records()?;
        for chunks in &windows(&self.chunks(rect), WINDOW_BYTES) {
            self.visit_window(&file, chunks, rect, &mut visit)?;
        }
        Ok(())
    }

    /// The same in parallel: `visit` adds a record to what it has of the window that
    /// the record lies in. Results come in the order of the windows.
    ///
    /// # Errors
    ///
    /// As [`gather`](Self::gather).
    pub fn gather_each<T: Default + Send>(
        &self,
        rect: &Rect,
        visit: impl Fn(&mut T, &[u8]) + Sync,
    ) -> Result<Vec<T>, TileError> {
        let file = self.open_records()?;
        // Together the windows are as large as one alone.
        let most = WINDOW_BYTES / rayon::current_num_threads() as u64;
        windows(&self.chunks(rect), most)
            .par_iter()
            .map(|chunks| {
                let mut found = T::default();
                self.visit_window(&file, chunks, rect, &mut |record| visit(&mut found, record))?;
                Ok(found)
            })
            .collect()
    }

    fn open_records(&self) -> Result<File, TileError> {
        File::open(&self.path).map_err(|source| TileError::io("read", &self.path, source))
    }

    fn visit_window(
        &self,
        file: &File,
        chunks: &[Chunk],
        rect: &Rect,
        visit: &mut impl FnMut(&[u8]),
    ) -> Result<(), TileError> {
        let start = chunks.first().map_or(0, |chunk| chunk.offset);
        let end = chunks.last().map_or(0, |chunk| chunk.offset + chunk.bytes);
        // A window is a chunk or a few MiB.
        let map = window(file, start, (end - start) as usize)
            .map_err(|source| TileError::io("read", &self.path, source))?;
        for chunk in chunks {
            self.visit_chunk(chunk, start, &map, rect, visit);
        }
        Ok(())
    }

    fn visit_chunk(
        &self,
        chunk: &Chunk,
        window_start: u64,
        window: &[u8],
        rect: &Rect,
        visit: &mut impl FnMut(&[u8]),
    ) {
        // A chunk lies in its window, which is no larger than memory.
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

/// Chunks that lie close together share a window of at most so many bytes; `chunks`
/// are in the order of the file.
fn windows(chunks: &[Chunk], most: u64) -> Vec<&[Chunk]> {
    let mut windows = Vec::new();
    let mut rest = chunks;
    while let Some(first) = rest.first() {
        let fits = |chunk: &&Chunk| chunk.offset + chunk.bytes <= first.offset + most;
        let count = rest.iter().take_while(fits).count().max(1);
        let (near, far) = rest.split_at(count);
        windows.push(near);
        rest = far;
    }
    windows
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::{
        geometry::spread,
        tile::{CellGrid, Opener, ScatterOptions, Source, SourceError, scatter},
    };

    struct Batches(std::vec::IntoIter<Vec<u8>>);

    impl Source for Batches {
        fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<usize, SourceError> {
            *records = self.0.next().unwrap_or_default();
            Ok(records.len() / 16)
        }
    }

    /// `n` records of 16 bytes: coordinates within ±`extent`, and a number.
    fn records(n: u64, extent: i64) -> Vec<Vec<u8>> {
        (0..n)
            .map(|i| {
                let c = |k: u64| (spread(4 * i + k) % (2 * extent as u64)) as i64 - extent;
                [c(0), c(1), c(2), i as i64]
                    .iter()
                    .flat_map(|&v| (v as i32).to_le_bytes())
                    .collect()
            })
            .collect()
    }

    fn spilled(records: &[Vec<u8>], edge: i64, threads: usize, dir: &std::path::Path) -> Spill {
        let sources: Vec<Opener<'_>> = records
            .chunks(records.len() / 5 + 1)
            .map(|part| {
                let batches: Vec<Vec<u8>> = part.chunks(97).map(<[_]>::concat).collect();
                Box::new(|| Ok(Box::new(Batches(batches.into_iter())) as Box<dyn Source>))
                    as Opener<'_>
            })
            .collect();
        let options = ScatterOptions {
            record_length: 16,
            threads,
            buffer_bytes: 0,
        };
        let done = scatter(
            sources,
            CellGrid::new(edge),
            dir,
            options,
            &|_| {},
            &AtomicBool::new(false),
        )
        .unwrap();
        assert_eq!(done.points.iter().sum::<u64>(), records.len() as u64);
        Spill::open(dir).unwrap()
    }

    fn gathered(spill: &Spill, rect: &Rect) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        spill
            .gather(rect, |record| found.push(record.to_vec()))
            .unwrap();
        found.sort();
        found
    }

    #[test]
    fn a_gather_matches_a_filter_of_all_points() {
        let all = records(20_000, 5000);
        for (edge, threads) in [(100, 1), (900, 3), (100_000, 2)] {
            let dir = tempfile::tempdir().unwrap();
            let spill = spilled(&all, edge, threads, dir.path());
            assert_eq!(spill.points(), 20_000);
            for k in 0..20 {
                let c = |j: u64| (spread(100 * k + j) % 10_000) as i64 - 5000;
                let rect = Rect {
                    min: [c(0), c(1)],
                    max: [c(0) + c(2).abs(), c(1) + c(3).abs()],
                };
                let mut truth: Vec<Vec<u8>> = all
                    .iter()
                    .filter(|r| rect.contains(Stored::of_record(r)))
                    .cloned()
                    .collect();
                truth.sort();
                assert_eq!(gathered(&spill, &rect), truth);
            }
        }
    }

    #[test]
    fn two_points_a_billion_apart_cost_two_cells() {
        let far: Vec<Vec<u8>> = [-1_000_000_000_i32, 1_000_000_000]
            .iter()
            .map(|&c| [c, c, 0, 7].iter().flat_map(|v| v.to_le_bytes()).collect())
            .collect();
        let dir = tempfile::tempdir().unwrap();
        let spill = spilled(&far, 8, 2, dir.path());
        assert_eq!(spill.squares().count(), 2);
        assert_eq!(spill.bounds().extent(), 2_000_000_000);
    }

    #[test]
    fn a_damaged_index_and_a_cut_spill_are_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        drop(spilled(&records(500, 100), 50, 1, dir.path()));
        let index = dir.path().join("spill.index");
        let good = std::fs::read(&index).unwrap();
        for at in (0..good.len()).step_by(13) {
            let mut bad = good.clone();
            bad[at] ^= 1;
            std::fs::write(&index, bad).unwrap();
            let error = Spill::open(dir.path()).unwrap_err().to_string();
            assert!(error.contains("spill.index"), "{error}");
        }
        std::fs::write(&index, &good).unwrap();
        let bin = dir.path().join("spill.bin");
        let cut = std::fs::read(&bin).unwrap();
        std::fs::write(&bin, &cut[..cut.len() - 1]).unwrap();
        let error = Spill::open(dir.path()).unwrap_err().to_string();
        assert!(error.contains("spill.bin"), "{error}");
    }

    #[test]
    fn a_directory_that_is_not_there_is_named() {
        let dir = tempfile::tempdir().unwrap().path().join("gone");
        let options = ScatterOptions {
            record_length: 16,
            threads: 1,
            buffer_bytes: 0,
        };
        let cancel = AtomicBool::new(false);
        let error = scatter(
            Vec::new(),
            CellGrid::new(8),
            &dir,
            options,
            &|_| {},
            &cancel,
        );
        assert!(error.unwrap_err().to_string().contains("gone"));
    }
}
