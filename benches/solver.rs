//! What a tile costs: the scan sorted and sampled, and one Lloyd iteration.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lloydar::{
    geometry::{Lattice, Local, Patch, PatchKind, Stored},
    lloyd::{Domain, Options, Scan, solve},
};

const LATTICE: Lattice = Lattice {
    scale: 1e-5,
    offset: [0.0; 3],
};

/// Even points over a wavy sheet of 2 × 2.
fn sheet(n: u64) -> Vec<Stored> {
    let mut state = 7_u64;
    let mut roll = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..n)
        .map(|_| {
            let (x, y) = (2.0 * roll(), 2.0 * roll());
            let z = 0.1 * (5.0 * x).sin() * (4.0 * y).cos();
            LATTICE.quantise([x, y, z]).expect("the sheet is small")
        })
        .collect()
}

fn benches(criterion: &mut Criterion) {
    let points = sheet(200_000);
    let options = Options {
        iterations: 1,
        ..Options::new(0.022)
    };
    let scan = || Scan::new(points.clone(), LATTICE, &options);

    let mut group = criterion.benchmark_group("tile");
    group.sample_size(10);
    group.throughput(Throughput::Elements(points.len() as u64));
    group.bench_function("scan", |b| b.iter(|| black_box(scan())));
    let ready = scan();
    group.bench_function("one iteration, seeds and figures", |b| {
        b.iter(|| black_box(solve(&ready, &Domain::everything(), &options)));
    });
    group.finish();

    let near: Vec<Local> = points
        .iter()
        .take(50)
        .map(|&p| LATTICE.local(p) * 0.01)
        .collect();
    criterion.bench_function("fit of a patch to 50 samples", |b| {
        b.iter(|| black_box(Patch::fit(near[0], &near, 0.03, PatchKind::Quadratic)));
    });
}

criterion_group!(solver, benches);
criterion_main!(solver);
