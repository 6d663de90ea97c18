//! A whole job, 5 million points to 100 thousand, against decoding the same LAZ
//! once with `las` on as many threads as there are files.

use std::{
    path::{Path, PathBuf},
    process::Command,
};

use criterion::{Criterion, criterion_group, criterion_main};
use las::{PointDataBuilder, Reader};

fn lloydar(arguments: &[&str]) {
    let done = Command::new(env!("CARGO_BIN_EXE_lloydar"))
        .args(arguments)
        .output()
        .expect("the program starts");
    assert!(done.status.success(), "{done:?}");
}

fn decode(path: &Path) -> usize {
    let mut reader = Reader::from_path(path).expect("the scan opens");
    let mut batch = PointDataBuilder::new().for_header(reader.header()).build();
    let (total, mut left) = (
        reader.header().number_of_points(),
        reader.header().number_of_points(),
    );
    while left > 0 {
        left -= reader
            .fill_points(left.min(50_000), &mut batch)
            .expect("the scan decodes");
    }
    total as usize
}

fn benches(criterion: &mut Criterion) {
    let dir = tempfile::tempdir().expect("there is room");
    let scans = dir.path().join("scans");
    let text = |path: &Path| path.display().to_string();
    lloydar(&["simulate", "--points", "5M", "-o", &text(&scans)]);
    let files: Vec<PathBuf> = [1, 2].map(|k| scans.join(format!("pass-{k}.laz"))).into();
    let out = dir.path().join("out.laz");

    let mut group = criterion.benchmark_group("5 M to 100 K");
    group.sample_size(10);
    group.bench_function("decode", |b| {
        b.iter(|| {
            std::thread::scope(|scope| {
                let threads: Vec<_> = files.iter().map(|f| scope.spawn(|| decode(f))).collect();
                let points = threads.into_iter().map(|t| t.join().expect("it decodes"));
                assert_eq!(points.sum::<usize>(), 5_000_000);
            });
        });
    });
    group.bench_function("job", |b| {
        b.iter(|| {
            lloydar(&[
                "run",
                &text(&scans),
                "-o",
                &text(&out),
                "--count",
                "100K",
                "--overwrite",
            ]);
        });
    });
    group.finish();
}

criterion_group!(all, benches);
criterion_main!(all);
