//! What a tile costs: the scan sorted and sampled, a Lloyd iteration, and what they are made
//! of; the solver alone on a street; and the triangles between its points.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use lloydar::{
    Options,
    internals::{
        BOUNDING_SIDES, Cell, Local, Neighbor, Patch, PatchKind, Quantization, Scan, SolverOptions,
        Stored, Street, StreetOptions, TileRegion, solve,
    },
    resample,
};

const QUANTIZATION: Quantization = Quantization {
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
            QUANTIZATION
                .quantise([x, y, z])
                .expect("the sheet is small")
        })
        .collect()
}

fn benches(criterion: &mut Criterion) {
    let points = sheet(200_000);
    let options = SolverOptions {
        iterations: 1,
        ..SolverOptions::new(0.022)
    };
    let scan = || Scan::new(points.clone(), QUANTIZATION, &options);

    let mut group = criterion.benchmark_group("tile");
    group.sample_size(10);
    group.throughput(Throughput::Elements(points.len() as u64));
    group.bench_function("scan", |b| b.iter(|| black_box(scan())));
    let ready = scan();
    group.bench_function("one iteration, seeds and figures", |b| {
        b.iter(|| black_box(solve(&ready, &TileRegion::everything(), &options)));
    });
    group.finish();

    let near: Vec<Local> = points
        .iter()
        .take(50)
        .map(|&p| QUANTIZATION.local(p) * 0.01)
        .collect();
    criterion.bench_function("fit of a patch to 50 samples", |b| {
        b.iter(|| black_box(Patch::fit(near[0], &near, 0.03, PatchKind::Quadratic)));
    });
    cells(criterion);
    triangles(criterion, &points);
    street(criterion);
}

/// The triangles between the even points of a sheet.
fn triangles(criterion: &mut Criterion, points: &[Stored]) {
    let positions: Vec<[f64; 3]> = points
        .iter()
        .map(|&p| QUANTIZATION.local(p).into())
        .collect();
    let even = resample(&positions, &Options::with_count(20_000)).expect("the sheet is a surface");
    let mut group = criterion.benchmark_group("mesh");
    group.throughput(Throughput::Elements(even.points.len() as u64));
    group.bench_function("triangles", |b| b.iter(|| black_box(even.triangles())));
    group.finish();
}

/// The solver alone, at twenty points to the seed: what 21 iterations take longer than one
/// is what twenty take. (The first shares its cells with the figures of the seeds.)
fn street(criterion: &mut Criterion) {
    let street = Street::new(StreetOptions {
        points: 1_000_000,
        length: 60.0,
        ..StreetOptions::default()
    });
    let places: Vec<[f64; 3]> = (0..street.options().passes)
        .flat_map(|pass| (0..street.slices(pass)).map(move |slice| (pass, slice)))
        .flat_map(|(pass, slice)| street.slice(pass, slice))
        .map(|point| point.position)
        .collect();
    let bound = |pick: fn(f64, f64) -> f64, from: f64| {
        [0, 1, 2].map(|axis| {
            places
                .iter()
                .fold(from, |bound, place| pick(bound, place[axis]))
        })
    };
    let quantization =
        Quantization::around(bound(f64::min, f64::MAX), bound(f64::max, f64::MIN), 0.0005);
    let stored = places
        .iter()
        .filter_map(|&place| quantization.quantise(place));
    let options = SolverOptions::new(0.2287);
    let scan = Scan::new(stored.collect(), quantization, &options);
    let seeds = solve(
        &scan,
        &TileRegion::everything(),
        &SolverOptions {
            iterations: 0,
            ..options
        },
    )
    .sites;

    let mut group = criterion.benchmark_group("street, 20 points to the seed");
    group.sample_size(10);
    group.throughput(Throughput::Elements(20 * seeds.len() as u64));
    for iterations in [1, 21] {
        let options = SolverOptions {
            iterations,
            ..options
        };
        group.bench_function(format!("{iterations} iterations"), |b| {
            b.iter(|| black_box(solve(&scan, &TileRegion::everything(), &options)));
        });
    }
    group.finish();
}

/// One cell on a bent patch: from its domain, from a square, and where it was.
fn cells(criterion: &mut Criterion) {
    let steps = || (-6..=6).map(f64::from);
    let bent = |x: f64, y: f64| Local::new(x, y, 0.05 * (x * x - 0.5 * y * y));
    let samples: Vec<Local> = steps()
        .flat_map(|i| steps().map(move |j| bent(0.2 * i, 0.2 * j)))
        .collect();
    let patch = Patch::fit(Local::zeros(), &samples, 1.2, PatchKind::Quadratic)
        .expect("the samples are no line");
    let site = patch.foot_point(Local::zeros());
    let mut neighbors: Vec<Neighbor> = (0..)
        .zip(steps().flat_map(|i| steps().map(move |j| (i, j))))
        .filter(|&(_, (i, j))| (i, j) != (0.0, 0.0))
        .map(|(index, (i, j))| {
            let position = patch.foot_point(bent(i + 0.5 * j + 0.03 * (i * j).sin(), 0.866 * j));
            Neighbor {
                distance_squared: (position - site).norm_squared(),
                index,
                position,
            }
        })
        .filter(|neighbor| neighbor.distance_squared < 1.6 * 1.6)
        .collect();
    neighbors.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared));

    let mut group = criterion.benchmark_group("cell");
    let mut cell = Cell::new();
    group.bench_function("clipped from its domain", |b| {
        b.iter(|| cell.clip(&patch, site, &[1.0; BOUNDING_SIDES], black_box(&neighbors)));
    });
    let links: Vec<u32> = cell.neighbors().collect();
    let is_linked = |link: &u32| neighbors.iter().find(|n| n.index == *link).copied();
    let ring: Vec<Neighbor> = links.iter().filter_map(is_linked).collect();
    group.bench_function("clipped from a square", |b| {
        b.iter(|| cell.clip_within(&patch, site, 0.8, black_box(&neighbors)));
    });
    let mut scratch = Vec::new();
    group.bench_function("closed where it was", |b| {
        b.iter(|| {
            scratch.clone_from(&ring);
            assert!(cell.close(&patch, site, 0.8, &mut scratch, black_box(&neighbors)));
        });
    });
    group.bench_function("moments", |b| {
        b.iter(|| black_box(cell.moments(&patch, site)));
    });
    group.finish();
}

criterion_group!(solver, benches);
criterion_main!(solver);
