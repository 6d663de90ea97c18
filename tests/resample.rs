//! Points in memory: what the library gives, and that a job on a file gives the same.

use std::{f64::consts::TAU, ops::ControlFlow, path::Path, sync::Mutex};

use las::Reader;
use lloydar::{Options, ResampleError, Resampled, resample, resample_with_progress};

use crate::running::{street, succeed};

/// Even points of the unit sphere, by the golden angle.
fn sphere(count: usize) -> Vec<[f64; 3]> {
    let golden = TAU * (1.0 - 0.618_033_988_749_895);
    (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / count as f64;
            let (sin, cos) = (golden * i as f64).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            [radius * cos, radius * sin, z]
        })
        .collect()
}

/// A sheet of 2 × 2 at a northing of five million, with its corner at `corner`.
fn sheet(side: usize, corner: [f64; 3]) -> Vec<[f64; 3]> {
    let step = 2.0 / side as f64;
    (0..side * side)
        .map(|i| {
            let (x, y) = ((i % side) as f64 * step, (i / side) as f64 * step);
            [corner[0] + x, corner[1] + y, corner[2]]
        })
        .collect()
}

fn distance_squared(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum()
}

struct Scan {
    points: Vec<[f64; 3]>,
    times: Vec<f64>,
    intensities: Vec<u16>,
    scale: f64,
}

fn read(path: &Path) -> Scan {
    let mut reader = Reader::from_path(path).unwrap();
    let scale = reader.header().transforms().x.scale;
    let points = reader.read_all().unwrap();
    let columns = points.x().zip(points.y()).zip(points.z());
    Scan {
        points: columns.map(|((x, y), z)| [x, y, z]).collect(),
        times: points.gps_time().unwrap().collect(),
        intensities: points.intensity().collect(),
        scale,
    }
}

/// Holds a job on a file to the library's result for the points of that file.
fn compare(scan: &Path, options: &[&str], in_memory: impl Fn(f64) -> Options) {
    let dir = tempfile::tempdir().unwrap();
    let output = dir.path().join("even.las");
    succeed(scan, &output, options);
    let (scan, written) = (read(scan), read(&output));
    let even = resample(&scan.points, &in_memory(scan.scale)).unwrap();

    assert_eq!(even.points.len(), written.points.len(), "{options:?}");
    for (index, written_point) in written.points.iter().enumerate() {
        for axis in 0..3 {
            let apart = (even.points[index][axis] - written_point[axis]).abs();
            assert!(
                apart <= 0.5001 * written.scale,
                "{options:?} point {index}: {apart}"
            );
        }
        // A job looks for the nearest of the points that thinning keeps, from the position as it is
        // written: it may be a little farther away.
        let is_taken = |&source: &usize| {
            scan.times[source] == written.times[index]
                && scan.intensities[source] == written.intensities[index]
        };
        if is_taken(&even.source[index]) {
            continue;
        }
        let distance = |source: usize| distance_squared(scan.points[source], *written_point).sqrt();
        let taken = (0..scan.points.len()).filter(is_taken).map(distance);
        let taken = taken.fold(f64::INFINITY, f64::min);
        let farther = taken - distance(even.source[index]);
        assert!(
            (-2.0 * written.scale..0.5 * even.spacing).contains(&farther),
            "{options:?} point {index}: the job's source is {farther} farther than the library's"
        );
    }
}

#[test]
fn a_job_on_a_file_gives_the_points_of_the_library() {
    let dir = tempfile::tempdir().unwrap();
    let scan = street(dir.path()).join("pass-1.laz");
    compare(&scan, &["--spacing", "0.3"], |scale| {
        Options::with_spacing(0.3).scale(scale)
    });
    compare(&scan, &["--count", "8000"], |scale| {
        Options::with_count(8000).scale(scale)
    });
    compare(&scan, &["--count", "7777", "--exact"], |scale| {
        Options::with_count(7777).exact().scale(scale)
    });
    let several = [
        "--ratio", "0.05", "--fill", "0", "--smooth", "0.8", "--seeds", "poisson",
    ];
    compare(&scan, &several, |scale| {
        let options = Options::with_ratio(0.05).fill(0.0).smooth(0.8);
        options.seeds(lloydar::SeedRule::Poisson).scale(scale)
    });
}

#[test]
fn the_source_is_the_nearest_input_point() {
    let points = sphere(3000);
    let even = resample(&points, &Options::with_spacing(0.2)).unwrap();
    for (point, &source) in even.points.iter().zip(&even.source) {
        let squared = |index: usize| distance_squared(points[index], *point);
        let nearest = (0..points.len()).min_by(|&a, &b| squared(a).total_cmp(&squared(b)));
        let nearest = squared(nearest.unwrap());
        // Distances are taken from a nearer origin, where they round otherwise.
        assert!(squared(source) <= nearest * (1.0 + 1e-9));
    }
}

#[test]
fn a_sphere_is_a_closed_surface_of_known_area_and_curvature() {
    let even = resample(sphere(60_000), &Options::with_count(2000).exact()).unwrap();
    let count = even.points.len();
    assert_eq!(count, 2000);
    let area: f64 = even.areas.iter().sum();
    assert!((area / (2.0 * TAU) - 1.0).abs() < 0.01, "area {area}");
    let mut mutual = 0;
    let mut edges = 0;
    for index in 0..count {
        let radius = distance_squared(even.points[index], [0.0; 3]).sqrt();
        assert!((radius - 1.0).abs() < 2e-3, "radius {radius}");
        assert!((even.curvatures[index].abs() - 1.0).abs() < 0.1);
        let along: f64 = (0..3)
            .map(|axis| even.normals[index][axis] * even.points[index][axis])
            .sum();
        assert!(along.abs() > 0.995, "the normal is radial: {along}");
        let ring = even.ring(index);
        assert!(ring.is_closed && ring.neighbors.len() >= 3);
        for &neighbor in ring.neighbors {
            edges += 1;
            mutual += usize::from(
                even.ring(neighbor as usize)
                    .neighbors
                    .contains(&(index as u32)),
            );
        }
    }
    // Cells on patches that differ a little may disagree about a very short edge.
    assert!(mutual * 100 >= edges * 99, "{mutual} of {edges}");
    assert!(even.uniformity.energy_ratio < 1.03, "{:?}", even.uniformity);
}

#[test]
fn rings_run_counter_clockwise_around_the_normal() {
    let even = resample(sheet(200, [0.0; 3]), &Options::with_spacing(0.1)).unwrap();
    let mut closed = 0;
    for index in 0..even.points.len() {
        let ring = even.ring(index);
        if !ring.is_closed {
            continue;
        }
        closed += 1;
        let angle = |&neighbor: &u32| {
            let [x, y] =
                [0, 1].map(|axis| even.points[neighbor as usize][axis] - even.points[index][axis]);
            y.atan2(x)
        };
        let angles: Vec<f64> = ring.neighbors.iter().map(angle).collect();
        let turns: f64 = (0..angles.len())
            .map(|k| (angles[(k + 1) % angles.len()] - angles[k]).rem_euclid(TAU))
            .sum();
        assert!((turns - TAU).abs() < 1e-9, "point {index}: {angles:?}");
    }
    assert!(closed * 2 > even.points.len(), "{closed} closed rings");
}

#[test]
fn positions_far_from_the_origin_are_as_exact_as_near_it() {
    let options = Options::with_spacing(0.1);
    let near = resample(sheet(120, [0.0; 3]), &options).unwrap();
    let corner = [500_000.0, 5_000_000.0, 300.0];
    let far = resample(sheet(120, corner), &options).unwrap();
    assert!((far.points.len() as f64 / near.points.len() as f64 - 1.0).abs() < 0.02);
    assert!((far.uniformity.delta - near.uniformity.delta).abs() < 0.02);
    for point in &far.points {
        assert!((point[2] - 300.0).abs() < 1e-4, "{point:?}");
    }
}

#[test]
fn neither_the_order_of_the_points_nor_the_pool_changes_the_result() {
    let points = sphere(20_000);
    let options = Options::with_count(700);
    let one = resample(&points, &options).unwrap();
    let turned: Vec<[f64; 3]> = points.iter().rev().copied().collect();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(3)
        .build()
        .unwrap();
    let other = pool.install(|| resample(&turned, &options)).unwrap();
    assert_eq!(one.points, other.points);
    assert_eq!(one.spacing.to_bits(), other.spacing.to_bits());
    let back = |resampled: &Resampled| -> Vec<usize> {
        resampled
            .source
            .iter()
            .map(|&source| points.len() - 1 - source)
            .collect()
    };
    assert_eq!(one.source, back(&other));
}

#[test]
fn more_points_may_come_out_than_go_in() {
    let even = resample(sheet(40, [0.0; 3]), &Options::with_ratio(4.0)).unwrap();
    let ratio = even.points.len() as f64 / 1600.0;
    assert!((3.5..4.5).contains(&ratio), "{ratio}");
}

#[test]
fn what_is_wrong_is_named_with_its_numbers() {
    let points = sheet(50, [0.0; 3]);
    let error = |points: &[[f64; 3]], options: Options| resample(points, &options).unwrap_err();

    assert_eq!(
        error(&[], Options::with_spacing(0.1)),
        ResampleError::NoPoints
    );
    let mut damaged = points.clone();
    damaged[7][1] = f64::NAN;
    assert!(matches!(
        error(&damaged, Options::with_spacing(0.1)),
        ResampleError::InvalidPoint { index: 7, .. }
    ));
    damaged[7][1] = 1e300;
    let text = error(&damaged, Options::with_spacing(0.1)).to_string();
    assert!(text.starts_with("point 7: "), "{text}");
    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(
            error(&points, Options::with_spacing(spacing)),
            ResampleError::InvalidOption {
                option: "spacing",
                ..
            }
        ));
    }
    assert!(matches!(
        error(&points, Options::with_spacing(0.1).fill(-1.0)),
        ResampleError::InvalidOption { option: "fill", .. }
    ));
    assert!(matches!(
        error(&points, Options::with_spacing(5.0)),
        ResampleError::TooWide { spacing: 5.0, .. }
    ));
    assert_eq!(
        error(&points, Options::with_count(100_000)),
        ResampleError::TooMany {
            count: 100_000,
            points: 2500
        }
    );
    assert_eq!(
        error(&[[1.0, 2.0, 3.0]; 9], Options::with_count(2)),
        ResampleError::AllEqual { points: 9 }
    );
}

#[test]
fn lengths_are_answered_however_short_they_are() {
    let points = |edge: f64| -> Vec<[f64; 3]> {
        let sheet = sheet(60, [0.0; 3]).into_iter();
        sheet.map(|point| point.map(|c| 0.5 * edge * c)).collect()
    };
    for edge in [1e-200, 1e-150, 1e-320, 1e-13] {
        for options in [Options::with_count(200), Options::with_ratio(0.1)] {
            for options in [
                options.clone(),
                options.scale(0.01 * f64::max(edge, 1e-300)),
            ] {
                let refused = resample(points(edge), &options).unwrap_err();
                assert!(
                    matches!(refused, ResampleError::TooSmall { .. }),
                    "{edge:e}: {refused}"
                );
            }
        }
        let refused = resample(points(1.0), &Options::with_spacing(edge)).unwrap_err();
        let text = refused.to_string();
        assert!(
            text.starts_with(&format!("spacing {edge:e}: must be at least 1e-12")),
            "{text}"
        );
    }
    for scale in [1e-200, 5e-324, 1e200] {
        let options = Options::with_spacing(0.1).scale(scale).iterations(2);
        assert!(resample(points(1.0), &options).unwrap().points.len() > 80);
    }
    // What is not refused is as even as anywhere.
    for edge in [1.0, 1e-9, 2e-12] {
        let even = resample(points(edge), &Options::with_count(200)).unwrap();
        assert!(
            (198..=202).contains(&even.points.len()),
            "{edge:e}: {}",
            even.points.len()
        );
        assert!(
            even.uniformity.cell_area_cv < 0.1,
            "{edge:e}: {:?}",
            even.uniformity
        );
    }
}

#[test]
fn few_points_and_equal_points_are_resampled() {
    let one = resample([[1.0, 2.0, 3.0]; 5], &Options::with_spacing(0.5)).unwrap();
    assert_eq!(one.points.len(), 1);
    assert_eq!(one.source, [0]);
    let line: Vec<[f64; 3]> = (0..100).map(|i| [0.1 * f64::from(i), 0.0, 0.0]).collect();
    let even = resample(&line, &Options::with_spacing(1.0)).unwrap();
    assert!(!even.points.is_empty());
}

#[test]
fn progress_rises_to_one_and_a_break_ends_the_work_at_every_step() {
    let points = sphere(5000);
    let options = Options::with_count(300).iterations(3);
    let shares = Mutex::new(Vec::new());
    let record = |share: f64| {
        shares.lock().unwrap().push(share);
        ControlFlow::Continue(())
    };
    resample_with_progress(&points, &options, &record).unwrap();
    let shares = shares.into_inner().unwrap();
    let latest = shares.iter().copied().fold(0.0, f64::max);
    assert_eq!(latest, 1.0);
    assert!(shares.len() > 8, "{shares:?}");

    for stop_at in [0.0, 0.1, 0.12, 0.5, 0.95, 1.0] {
        let stop = |share: f64| match share >= stop_at {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let stopped = resample_with_progress(&points, &options, &stop);
        assert_eq!(stopped.unwrap_err(), ResampleError::Cancelled, "{stop_at}");
    }
}
