//! What the way through the disk costs: a million records scattered and gathered, and two
//! tiles stitched.

use std::{hint::black_box, path::Path, sync::atomic::AtomicBool};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lloydar::internals::{
    CellGrid, Local, NeighborSites, Opener, PointCounts, Rect, ScatterOptions, SeamTally,
    SolvedSite, Source, SourceError, Spill, Stored, blend, scatter,
};

const RECORD: usize = 36;
const POINTS: u64 = 1_000_000;
/// Edge of the cells, in stored units: 1 m on a scale of a millimetre.
const CELL: i64 = 1000;

/// Batches as a decoder hands them on.
struct Batches<'a>(std::slice::Chunks<'a, u8>);

impl Source for Batches<'_> {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        records.clear();
        records.extend(self.0.next().unwrap_or_default());
        Ok(PointCounts {
            read: (records.len() / RECORD) as u64,
            ..PointCounts::default()
        })
    }
}

/// A scanner that drives along a street 30 m wide and sweeps across it.
fn street() -> Vec<u8> {
    let mut records = Vec::with_capacity(POINTS as usize * RECORD);
    for i in 0..POINTS as i64 {
        let (sweep, step) = (i / 500, i % 500);
        for c in [sweep * 50, step * 60, (step * 7919) % 40] {
            records.extend((c as i32).to_le_bytes());
        }
        records.resize(records.len() + RECORD - 12, 7);
    }
    records
}

fn scattered(records: &[u8], stem: &Path) -> Spill {
    let sources: Vec<Opener<'_>> = records
        .chunks(records.len() / 4)
        .map(|part| {
            let open = move |_| {
                let batches = Batches(part.chunks(65_536 * RECORD));
                Ok(Box::new(batches) as Box<dyn Source>)
            };
            Box::new(open) as Opener<'_>
        })
        .collect();
    let options = ScatterOptions {
        record_length: RECORD,
        threads: 2,
        buffer_bytes: 32 << 20,
        checkpoint_bytes: u64::MAX,
        keep_going: false,
    };
    let cancel = AtomicBool::new(false);
    scatter(
        sources,
        CellGrid::new(CELL),
        stem,
        options,
        &|_| {},
        &cancel,
    )
    .expect("there is room");
    Spill::open(stem).expect("it was just written")
}

fn through_the_disk(criterion: &mut Criterion) {
    let dir = tempfile::tempdir().expect("there is room");
    let stem = dir.path().join("spill");
    let records = street();
    let mut group = criterion.benchmark_group("a million records");
    group.sample_size(10);
    group.throughput(Throughput::Elements(POINTS));
    group.bench_function("scatter", |b| {
        b.iter_batched(
            || drop(std::fs::remove_file(stem.with_extension("index"))),
            |()| black_box(scattered(&records, &stem)),
            criterion::BatchSize::PerIteration,
        );
    });
    let spill = scattered(&records, &stem);
    let all = Rect {
        min: [i64::MIN / 4; 2],
        max: [i64::MAX / 4; 2],
    };
    group.bench_function("gather", |b| {
        b.iter(|| {
            let mut sum = 0;
            spill
                .gather(&all, |record| sum += i64::from(Stored::of_record(record).x))
                .expect("it was just written");
            black_box(sum)
        });
    });
    group.finish();
}

/// Two tiles of 250 000 sites each, that know a tenth of each other's.
fn stitch(criterion: &mut Criterion) {
    let site = |i: i32, j: i32| SolvedSite {
        identity: Stored { x: i, y: j, z: 0 },
        position: Local::new(f64::from(i), f64::from(j), 0.0),
        is_exact: true,
    };
    let rect = |min: i64, max: i64| Rect {
        min: [min, 0],
        max: [max, 500],
    };
    let sites = |columns: std::ops::Range<i32>| -> Vec<SolvedSite> {
        columns
            .flat_map(|i| (0..500).map(move |j| site(i, j)))
            .collect()
    };
    let own = sites(0..500);
    let neighbors = [NeighborSites {
        core: rect(500, 1000),
        sites: sites(450..500),
    }];
    let mut group = criterion.benchmark_group("stitch");
    group.throughput(Throughput::Elements(own.len() as u64));
    group.bench_function("a tile and what its neighbour says of it", |b| {
        b.iter(|| {
            let mut tally = SeamTally::new(1.0);
            black_box(blend(&rect(0, 500), &own, &neighbors, 50, &mut tally))
        });
    });
    group.finish();
}

criterion_group!(all, through_the_disk, stitch);
criterion_main!(all);
