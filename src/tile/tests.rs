//! What is scattered is gathered again, whatever happens meanwhile.

use std::sync::atomic::AtomicBool;

use super::{
    cell_points::{CellPoints, Spilled},
    error::TileError,
    scatter::{ScatterOptions, scatter_into},
    source::{Opener, Source, SourceError},
    spill::Spill,
    storage::Storage,
};
use crate::{
    geometry::{Quantization, Rect, Stored, spread},
    las::PointCounts,
    lloyd::{SolverOptions, Thinning},
    tiling::CellGrid,
};

/// Batches of records, and whether the source fails after the last of them.
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

/// Scatters `records` from five sources, each of which fails after `most` of its batches. Returns
/// the number of points that were in the spill already.
fn try_scatter(
    records: &[Vec<u8>],
    edge: i64,
    options: ScatterOptions,
    most: usize,
    dir: &std::path::Path,
) -> Result<u64, TileError> {
    let storage = Storage::default();
    try_storing(records, edge, options, storage, most, dir).map(|(before, _)| before)
}

/// Scatters like [`try_scatter`] what `storage` keeps, and returns the spill, too.
fn try_storing(
    records: &[Vec<u8>],
    edge: i64,
    options: ScatterOptions,
    storage: Storage,
    most: usize,
    dir: &std::path::Path,
) -> Result<(u64, Spill), TileError> {
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
    let spill = scatter_into(
        sources,
        CellGrid::new(edge),
        &dir.join("spill"),
        options,
        storage,
        &progress,
        &cancel,
    )?;
    Ok((first.into_inner(), spill))
}

/// Makes `n` records of 16 bytes: coordinates within ±`extent`, and the number of the record.
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

/// The naïve twin of a gather: it tests every record.
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

/// The grids of the two spills have become coarser by different steps.
#[test]
fn joined_spills_equal_one_spill_of_all_sources() {
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
    // Cells of which none contains the other cannot be joined.
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
    // Where the chunks of a cell lie is read, and checked, when it is needed.
    let open_and_read = || {
        let everywhere = Rect {
            min: [-200; 2],
            max: [200; 2],
        };
        Spill::open(&dir.path().join("spill"))?.gather(&everywhere, |_| ())
    };
    open_and_read().unwrap();
    for at in (0..good.len()).step_by(13).chain([good.len() - 1]) {
        let mut bad = good.clone();
        bad[at] ^= 1;
        std::fs::write(&index, bad).unwrap();
        let error = open_and_read().unwrap_err().to_string();
        assert!(error.contains("spill.index"), "{error}");
    }
    std::fs::write(&index, &good[..good.len() - 1]).unwrap();
    let error = open_and_read().unwrap_err().to_string();
    assert!(error.contains("spill.index"), "{error}");
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
    // The first scatter fails after some checkpoints; the second continues from the last one.
    let error = try_scatter(&all, 300, options, 15, dir.path()).unwrap_err();
    assert!(error.to_string().contains("dried up"), "{error}");
    assert!(!Spill::is_complete(&dir.path().join("spill")));
    let before = try_scatter(&all, 300, options, usize::MAX, dir.path()).unwrap();
    assert!(before >= 2500, "{before} points were in the spill");
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

/// Points far apart would have a cell each. The grid becomes coarser with them, and its final edge
/// does not depend on their order.
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

/// What is thinned: a millimetre to a stored unit, voxels of 0.4.
fn thinning() -> Thinning {
    let quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };
    Thinning::new(&quantization, &SolverOptions::new(1.2))
}

/// Records and sums of the spill, thinned as one.
fn thinned(spill: &Spill) -> CellPoints {
    let everywhere = Rect {
        min: [-6000; 2],
        max: [6000; 2],
    };
    let mut all = CellPoints::default();
    spill
        .gather_each(
            &everywhere,
            |part: &mut CellPoints, spilled| match spilled {
                Spilled::Record(record) => part.records.extend(record),
                Spilled::Sum(sum) => part.sums.push(*sum),
            },
            |part| all.extend(&part.records, &part.sums),
        )
        .unwrap();
    sorted_and_thinned(all)
}

fn sorted_and_thinned(mut points: CellPoints) -> CellPoints {
    points.thin(16, &thinning());
    let mut records: Vec<&[u8]> = points.records.chunks(16).collect();
    records.sort_unstable();
    let mut sums = points.sums.clone();
    sums.sort_unstable();
    CellPoints {
        records: records.concat(),
        sums,
    }
}

/// Records in crowded voxels, some at one position with different numbers.
fn crowded() -> Vec<Vec<u8>> {
    let mut all = records(30_000, 1500);
    for again in 0..6_000 {
        let mut record = all[again].clone();
        record[12..].copy_from_slice(&(40_000 + again as u32).to_le_bytes());
        all.push(record);
    }
    all
}

#[test]
fn points_thinned_as_they_come_are_those_thinned_at_once() {
    let all = crowded();
    let at_once = sorted_and_thinned(CellPoints {
        records: all.concat(),
        sums: Vec::new(),
    });
    assert!(at_once.records.len() < 16 * all.len() / 4);
    let storage = |memory_bytes| Storage {
        thinning: Some(thinning()),
        memory_bytes,
    };
    // In a file, in memory, and in a file because memory was too small after all.
    for (memory_bytes, is_in_memory) in [(0, false), (1 << 30, true), (60_000, false)] {
        for edge in [8, 900] {
            let dir = tempfile::tempdir().unwrap();
            let (_, spill) = try_storing(
                &all,
                edge,
                OPTIONS,
                storage(memory_bytes),
                usize::MAX,
                dir.path(),
            )
            .unwrap();
            assert_eq!(spill.points(), all.len() as u64);
            assert_eq!(spill.resident_bytes() > 0, is_in_memory);
            assert_eq!(dir.path().join("spill.bin").exists(), !is_in_memory);
            // Cells that are narrower than voxels have little to thin.
            let is_thinned = spill.values() < all.len() as u64 / 3;
            assert!(is_thinned || edge == 8 || !is_in_memory);
            let found = thinned(&spill);
            assert_eq!(found.records, at_once.records);
            assert_eq!(found.sums, at_once.sums);
        }
    }
}

#[test]
fn a_stopped_scatter_of_thinned_points_goes_on_from_its_checkpoint() {
    let all = crowded();
    let options = ScatterOptions {
        checkpoint_bytes: 40_000,
        keep_going: true,
        ..OPTIONS
    };
    let storage = Storage {
        thinning: Some(thinning()),
        memory_bytes: 0,
    };
    let dir = tempfile::tempdir().unwrap();
    try_storing(&all, 300, options, storage, 15, dir.path()).unwrap_err();
    let (before, spill) = try_storing(&all, 300, options, storage, usize::MAX, dir.path()).unwrap();
    assert!(before >= 2500, "{before} points were in the spill");
    let at_once = sorted_and_thinned(CellPoints {
        records: all.concat(),
        sums: Vec::new(),
    });
    let found = thinned(&spill);
    assert_eq!(found.records, at_once.records);
    assert_eq!(found.sums, at_once.sums);
}

/// The counts by which tiles are cut are those of all points, thinned or not.
#[test]
fn thinned_points_are_counted_by_squares_as_all_points_are() {
    let all = crowded();
    let dirs = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let plain = spilled(&all, 300, 2, dirs[0].path());
    let storage = Storage {
        thinning: Some(thinning()),
        memory_bytes: 1 << 30,
    };
    let (_, spill) = try_storing(&all, 300, OPTIONS, storage, usize::MAX, dirs[1].path()).unwrap();
    assert!(spill.squares().eq(plain.squares()));
    assert_eq!(spill.bounds(), plain.bounds());
}
