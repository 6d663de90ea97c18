//! A tile's points from the spill: those of its core, and of its halo, which
//! is nothing but the neighbouring cells.

use std::{
    fs::File,
    io::{ErrorKind, Read, Seek, SeekFrom},
};

use rayon::prelude::*;

use super::{Spill, TileError, spill::Chunk};
use crate::geometry::{Rect, Stored};

/// Bytes read at once. They are read, not mapped: a disk that fails under a map ends
/// the program, and one that fails under a read is an error with a name.
const WINDOW_BYTES: u64 = 8 << 20;
/// Bytes of other cells that are read along rather than skipped.
const WIDEST_GAP: u64 = 64 << 10;
/// Windows that a thread reads before what was found in them is taken.
const WINDOWS_TO_A_THREAD: usize = 4;

impl Spill {
    /// Calls `visit` with every record whose point lies in `rect`, in no order
    /// that may be relied on.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if the spill cannot be read, [`TileError::Damaged`] if it
    /// has become shorter.
    pub fn gather(&self, rect: &Rect, mut visit: impl FnMut(&[u8])) -> Result<(), TileError> {
        let mut buffer = Vec::new();
        for chunks in &windows(&self.chunks(rect), WINDOW_BYTES) {
            self.visit_window(chunks, rect, &mut buffer, &mut visit)?;
        }
        Ok(())
    }

    /// The same in parallel: `visit` adds a record to what it has of the window that
    /// the record lies in. What was found in a few windows goes to `take`, in the
    /// order of the windows, before the next are read.
    ///
    /// # Errors
    ///
    /// As [`gather`](Self::gather).
    pub(crate) fn gather_each<T: Default + Send>(
        &self,
        rect: &Rect,
        visit: impl Fn(&mut T, &[u8]) + Sync,
        mut take: impl FnMut(T),
    ) -> Result<(), TileError> {
        // Together the windows are as large as one alone.
        let threads = rayon::current_num_threads();
        let chunks = self.chunks(rect);
        let windows = windows(&chunks, WINDOW_BYTES / threads as u64);
        for few in windows.chunks(WINDOWS_TO_A_THREAD * threads) {
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

    fn visit_window(
        &self,
        chunks: &[Chunk],
        rect: &Rect,
        buffer: &mut Vec<u8>,
        visit: &mut impl FnMut(&[u8]),
    ) -> Result<(), TileError> {
        let start = chunks.first().map_or(0, |chunk| chunk.offset);
        let end = chunks.last().map_or(0, |chunk| chunk.offset + chunk.bytes);
        // A window is a chunk or a few MiB.
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
/// are in the order of the files.
fn windows(chunks: &[Chunk], most: u64) -> Vec<&[Chunk]> {
    let mut windows = Vec::new();
    let mut rest = chunks;
    while let Some(first) = rest.first() {
        let is_near = |pair: &&[Chunk]| {
            let end = pair[0].offset + pair[0].bytes;
            let is_close = pair[0].file == pair[1].file && pair[1].offset - end <= WIDEST_GAP;
            is_close && pair[1].offset + pair[1].bytes <= first.offset + most
        };
        let count = 1 + rest.windows(2).take_while(is_near).count();
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
        tile::{CellGrid, Opener, PointCounts, ScatterOptions, Source, SourceError, scatter},
    };

    /// Batches of records, and whether a failure follows on them.
    struct Batches(std::vec::IntoIter<Vec<u8>>, bool);

    impl Source for Batches {
        fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
            *records = self.0.next().unwrap_or_default();
            if self.1 && records.is_empty() {
                return Err("the source dried up".into());
            }
            Ok(PointCounts {
                read: records.len() as u64 / 16,
                ..PointCounts::default()
            })
        }
    }

    const OPTIONS: ScatterOptions = ScatterOptions {
        record_length: 16,
        threads: 2,
        buffer_bytes: 0,
        checkpoint_bytes: u64::MAX,
        keep_going: false,
    };

    /// Scatters `records` from five sources, each of which fails after `most` of its
    /// batches.
    fn try_scatter(
        records: &[Vec<u8>],
        edge: i64,
        options: ScatterOptions,
        most: usize,
        dir: &std::path::Path,
    ) -> Result<u64, TileError> {
        let sources: Vec<Opener<'_>> = records
            .chunks(records.len() / 5 + 1)
            .map(|part| {
                Box::new(move |skip: u64| {
                    let rest = &part[skip as usize..];
                    let mut batches: Vec<Vec<u8>> = rest.chunks(97).map(<[_]>::concat).collect();
                    let fails = batches.len() > most;
                    batches.truncate(most);
                    Ok(Box::new(Batches(batches.into_iter(), fails)) as Box<dyn Source>)
                }) as Opener<'_>
            })
            .collect();
        let first = std::sync::atomic::AtomicU64::new(u64::MAX);
        let progress = |points: u64| {
            let _ = first.compare_exchange(
                u64::MAX,
                points,
                std::sync::atomic::Ordering::Relaxed,
                std::sync::atomic::Ordering::Relaxed,
            );
        };
        let cancel = AtomicBool::new(false);
        scatter(
            sources,
            CellGrid::new(edge),
            &dir.join("spill"),
            options,
            &progress,
            &cancel,
        )?;
        Ok(first.into_inner())
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
        let options = ScatterOptions { threads, ..OPTIONS };
        try_scatter(records, edge, options, usize::MAX, dir).unwrap();
        let spill = Spill::open(&dir.join("spill")).unwrap();
        assert_eq!(spill.points(), records.len() as u64);
        spill
    }

    fn gathered(spill: &Spill, rect: &Rect) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        spill
            .gather(rect, |record| found.push(record.to_vec()))
            .unwrap();
        found.sort();
        found
    }

    /// The twin: every record looked at.
    fn filtered(records: &[Vec<u8>], rect: &Rect) -> Vec<Vec<u8>> {
        let is_inside = |record: &&Vec<u8>| rect.contains(Stored::of_record(record));
        let mut found: Vec<Vec<u8>> = records.iter().filter(is_inside).cloned().collect();
        found.sort();
        found
    }

    #[test]
    fn a_gather_matches_a_filter_of_all_points() {
        let all = records(20_000, 5000);
        for (edge, threads) in [(100, 1), (900, 3), (100_000, 2)] {
            let dir = tempfile::tempdir().unwrap();
            let spill = spilled(&all, edge, threads, dir.path());
            for k in 0..20 {
                let c = |j: u64| (spread(100 * k + j) % 10_000) as i64 - 5000;
                let rect = Rect {
                    min: [c(0), c(1)],
                    max: [c(0) + c(2).abs(), c(1) + c(3).abs()],
                };
                assert_eq!(gathered(&spill, &rect), filtered(&all, &rect));
            }
        }
    }

    /// As if their sources had been scattered together, whatever became of their grids.
    #[test]
    fn spills_are_joined() {
        let (near, far) = (records(20_000, 5000), records(30_000, 1_000_000_000));
        let dirs = [(); 3].map(|()| tempfile::tempdir().unwrap());
        let stems = dirs.each_ref().map(|dir| dir.path().join("spill"));
        drop(spilled(&near, 8, 2, dirs[0].path()));
        drop(spilled(&far, 8, 2, dirs[1].path()));
        let all = [near, far].concat();
        let one = spilled(&all, 8, 2, dirs[2].path());
        let joined = Spill::join(&stems[..2]).unwrap();
        assert_eq!(joined.grid(), one.grid());
        assert_eq!(joined.bounds(), one.bounds());
        assert_eq!(joined.points(), one.points());
        assert!(joined.squares().eq(one.squares()));
        assert_eq!(joined.sources().count(), 10);
        for reach in [3000, 400_000_000] {
            let rect = Rect {
                min: [-reach; 2],
                max: [reach, 2 * reach],
            };
            let expected = filtered(&all, &rect);
            assert!(!expected.is_empty());
            assert_eq!(gathered(&joined, &rect), expected);
        }
        // Cells that do not lie in each other cannot be joined.
        drop(spilled(&all, 24, 2, dirs[2].path()));
        let error = Spill::join(&stems[1..]).unwrap_err().to_string();
        assert!(error.contains("spill.index"), "{error}");
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
            let error = Spill::open(&dir.path().join("spill"))
                .unwrap_err()
                .to_string();
            assert!(error.contains("spill.index"), "{error}");
        }
        std::fs::write(&index, &good).unwrap();
        let bin = dir.path().join("spill.bin");
        let cut = std::fs::read(&bin).unwrap();
        std::fs::write(&bin, &cut[..cut.len() - 1]).unwrap();
        let error = Spill::open(&dir.path().join("spill"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("spill.bin"), "{error}");
    }

    #[test]
    fn a_directory_that_is_not_there_is_named() {
        let dir = tempfile::tempdir().unwrap().path().join("gone");
        let error = try_scatter(&[], 8, OPTIONS, usize::MAX, &dir);
        assert!(error.unwrap_err().to_string().contains("gone"));
    }
    #[test]
    fn a_stopped_scatter_goes_on_from_its_checkpoint() {
        let all = records(20_000, 5000);
        let everywhere = Rect {
            min: [-6000; 2],
            max: [6000; 2],
        };
        let options = ScatterOptions {
            checkpoint_bytes: 40_000,
            keep_going: true,
            ..OPTIONS
        };
        let dir = tempfile::tempdir().unwrap();
        // A try that fails where it may, and one that goes on from there.
        let error = try_scatter(&all, 300, options, 15, dir.path()).unwrap_err();
        assert!(error.to_string().contains("dried up"), "{error}");
        assert!(!Spill::is_complete(&dir.path().join("spill")));
        let before = try_scatter(&all, 300, options, usize::MAX, dir.path()).unwrap();
        assert!(before >= 2500, "{before} points were kept");
        let mut truth = all.clone();
        truth.sort();
        let spill = Spill::open(&dir.path().join("spill")).unwrap();
        assert_eq!(gathered(&spill, &everywhere), truth);
        let read: Vec<u64> = spill.sources().map(|counts| counts.read).collect();
        assert_eq!(read, [4001, 4001, 4001, 4001, 3996]);
    }

    #[test]
    fn sources_that_fail_are_all_named_when_asked_for() {
        let all = records(5_000, 5000);
        let dir = tempfile::tempdir().unwrap();
        for (keep_going, expected) in [(true, 5), (false, 1)] {
            let options = ScatterOptions {
                keep_going,
                ..OPTIONS
            };
            match try_scatter(&all, 300, options, 2, dir.path()) {
                Err(TileError::Sources(failed)) => assert_eq!(failed.len(), expected),
                other => panic!("{other:?}"),
            }
        }
    }

    /// Points far apart would each have a cell; the grid grows with them, and comes
    /// out the same whatever their order.
    #[test]
    fn a_grid_of_too_many_cells_is_made_coarser() {
        let all = records(30_000, 1_000_000_000);
        let mut turned = all.clone();
        turned.reverse();
        let edges: Vec<i64> = [all, turned]
            .iter()
            .map(|records| {
                let dir = tempfile::tempdir().unwrap();
                let spill = spilled(records, 8, 2, dir.path());
                let rect = Rect {
                    min: [-300_000_000, 0],
                    max: [100_000_000, 700_000_000],
                };
                assert_eq!(gathered(&spill, &rect), filtered(records, &rect));
                let counted: u64 = spill.squares().map(|(_, count)| count).sum();
                assert_eq!(counted, 30_000);
                spill.grid().edge()
            })
            .collect();
        assert_eq!(edges[0], edges[1]);
        assert!((10_000_000..100_000_000).contains(&edges[0]), "{edges:?}");
    }
}
