//! A cloud is measured in five steps: survey, scatter, estimate of the spacing, figures of uniformity part
//! by part, and the comparison with scans.

use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
};

use serde::Serialize;

use super::{
    bare_points::{BARE_BYTES, BarePoints},
    cloud_spacing::estimated_spacing,
    comparison_plan::ComparisonPlan,
    measurement::Measurement,
    parts::parts,
    scan_comparison::{ComparedDistances, ScanComparison},
};
use crate::{
    geometry::{Quantization, Rect, Stored},
    job::{JobError, resources::Budget},
    las::{InputFile, PointFilter, expand_inputs},
    quality::{DistanceFigures, Uniformity},
    tile::{Opener, ScatterOptions, Source, Spill, TileError, scatter},
    tiling::CellGrid,
};

/// The figures of a cloud. Lengths are CRS units.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measured {
    /// The number of points; coincident points count each.
    pub(crate) points: u64,
    /// The figures of uniformity.
    pub(crate) uniformity: Uniformity,
    /// The spacing of a hexagonal lattice with as many points to the area, by the cells of the cloud; where there are none,
    /// it is estimated from the nearest distances. It is the unit of the distances below.
    pub(crate) spacing: f64,
    /// The nearest distances of the points that the figures of uniformity leave out because they have no
    /// neighbour within four spacings; `None` if there is no such point.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) alone: Option<DistanceFigures>,
    /// The distances from the cloud to the nearest points of the scans it is compared with.
    pub(crate) accuracy: Option<DistanceFigures>,
    /// The distances from the scans to the nearest points of the cloud.
    pub(crate) coverage: Option<DistanceFigures>,
    /// The distances from the cloud to surfaces that are known exactly, if they were given.
    pub(crate) truth: Option<DistanceFigures>,
}

/// The width around a part whose points decide the cells at its border, in spacings.
const MEASURED_HALO_IN_SPACINGS: f64 = 6.0;
/// The usual edge of a cell of the spill's grid, in stored units.
const MEASURED_CELL_EDGE: i64 = 64;

/// Measures the cloud in `files`, and compares it with the scans in `against` if there are any.
/// Temporary files lie in a directory of their own in `temporary`.
///
/// # Errors
///
/// [`JobError`] if a file cannot be read, temporary files cannot be written, or `memory` is too
/// little.
pub(crate) fn measure(
    files: &[PathBuf],
    against: &[PathBuf],
    temporary: &Path,
    memory: Option<u64>,
    threads: usize,
) -> Result<Measured, JobError> {
    // Several threads of a process may measure at once.
    static MEASUREMENTS: AtomicU64 = AtomicU64::new(0);
    let cloud = survey(files)?;
    let scans = in_crs_of(&cloud, survey(against)?)?;
    let (process, number) = (
        std::process::id(),
        MEASUREMENTS.fetch_add(1, Ordering::Relaxed),
    );
    let dir = temporary.join(format!("lloydar-measure-{process}-{number}"));
    std::fs::create_dir_all(&dir).map_err(|e| JobError::io("make", &dir, e))?;
    let measured = measure_in(&cloud, &scans, &dir, &Budget::new(memory, threads));
    // The files are removed whatever happened.
    drop(std::fs::remove_dir_all(&dir));
    measured
}

/// The files that `paths` stand for, by their headers.
fn survey(paths: &[PathBuf]) -> Result<Vec<InputFile>, JobError> {
    if paths.is_empty() {
        return Ok(Vec::new());
    }
    let files = expand_inputs(paths, &PointFilter::default())?;
    Ok(files
        .iter()
        .map(|path| InputFile::survey(path))
        .collect::<Result<_, _>>()?)
}

/// The `scans` in the CRS of `cloud`, if theirs is another one.
///
/// # Errors
///
/// [`JobError::Inputs`] with every scan from whose CRS there is no way to that of the cloud.
fn in_crs_of(cloud: &[InputFile], scans: Vec<InputFile>) -> Result<Vec<InputFile>, JobError> {
    let Some(target) = cloud.iter().find_map(|file| file.crs.as_ref()) else {
        return Ok(scans);
    };
    let (mut done, mut problems) = (Vec::new(), Vec::new());
    for scan in scans {
        let path = scan.path.display().to_string();
        match scan.in_crs(target) {
            Ok(scan) => done.push(scan),
            Err(problem) => problems.push(format!("{path}: {problem}")),
        }
    }
    match problems.is_empty() {
        true => Ok(done),
        false => Err(JobError::Inputs(problems)),
    }
}

/// Measures `cloud`, and compares it with `scans`, with temporary files in `dir`.
fn measure_in(
    cloud: &[InputFile],
    scans: &[InputFile],
    dir: &Path,
    budget: &Budget,
) -> Result<Measured, JobError> {
    // Whether a comparison fits is known beforehand.
    let cloud_points = cloud.iter().map(|file| file.points_claimed).sum();
    let comparison = match scans {
        [] => None,
        _ => Some(ComparisonPlan::new(cloud_points, budget)?),
    };

    // The points of the cloud by cell.
    let quantization = InputFile::common_quantization(cloud.iter().chain(scans));
    let spill = scatter_cloud(cloud, quantization, &dir.join("spill"), budget)?;

    // The spacing, from parts without a halo.
    let spacing = estimated_spacing(&spill, &parts(&spill, budget, 0)?, quantization)?;

    // The figures of uniformity, from parts that contain all that their points depend on.
    let halo = quantization.units(MEASURED_HALO_IN_SPACINGS * spacing);
    let tally = Measurement {
        spill: &spill,
        plan: &parts(&spill, budget, halo)?,
        quantization,
        spacing,
    }
    .tally()?;

    // Nearest distances alone would make an uneven cloud look denser than it is, and an even one sparser.
    let uniformity = tally.uniformity.figures();
    let by_cells = uniformity.mean / uniformity.packing;
    let spacing = match by_cells.is_finite() && by_cells > 0.0 {
        true => by_cells,
        false => spacing,
    };

    // The distances to the scans and from them.
    let compared = comparison
        .map(|plan| compare(&spill, scans, quantization, spacing, &plan))
        .transpose()?;
    Ok(Measured {
        points: tally.points,
        uniformity,
        spacing,
        alone: (tally.alone.figures().count > 0).then(|| tally.alone.figures()),
        accuracy: compared.as_ref().map(|c| c.accuracy.figures()),
        coverage: compared.as_ref().map(|c| c.coverage.figures()),
        truth: None,
    })
}

/// Compares the points of `spill` with `scans`.
fn compare(
    spill: &Spill,
    scans: &[InputFile],
    quantization: Quantization,
    spacing: f64,
    plan: &ComparisonPlan,
) -> Result<ComparedDistances, JobError> {
    let bounds = spill.bounds();
    let everything = Rect {
        min: [bounds.min[0].into(), bounds.min[1].into()],
        max: [i64::from(bounds.max[0]) + 1, i64::from(bounds.max[1]) + 1],
    };
    // A vector that grows by itself would take twice the memory.
    let mut cloud = Vec::with_capacity(spill.points() as usize);
    spill.gather(&everything, |record| cloud.push(Stored::of_record(record)))?;
    ScanComparison::new(cloud, quantization, spacing)
        .with_scans(scans, plan)
        .map_err(|e| JobError::Tile(TileError::Sources(vec![(0, e)])))
}

/// Scatters the points of `cloud` into the spill at `stem`.
fn scatter_cloud(
    cloud: &[InputFile],
    quantization: Quantization,
    stem: &Path,
    budget: &Budget,
) -> Result<Spill, JobError> {
    let open = |file| {
        let points = BarePoints::open(file, 0..file.points_claimed, quantization)?;
        Ok(Box::new(points) as Box<dyn Source>)
    };
    let sources = cloud
        .iter()
        .map(|file| Box::new(move |_| open(file)) as Opener<'_>)
        .collect();
    let options = ScatterOptions {
        record_length: BARE_BYTES,
        threads: budget.decoders(cloud.iter().any(InputFile::is_remote)),
        buffer_bytes: budget.buffers(),
        // A measurement is not resumed.
        checkpoint_bytes: u64::MAX,
        keep_going: false,
    };
    let extent = cloud.iter().fold(0.0, |extent: f64, file| {
        let [min, max] = file.bounds;
        extent.max(max[0] - min[0]).max(max[1] - min[1])
    });
    let grid = CellGrid::for_extent((extent / quantization.scale) as i64, MEASURED_CELL_EDGE);
    let never = AtomicBool::new(false);
    scatter(sources, grid, stem, options, &|_| {}, &never)?;
    Ok(Spill::open(stem)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// A text of points, in the PLY format.
    fn write_cloud(path: &Path, points: &[[f64; 3]]) {
        let mut text = format!(
            "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\n\
             property double z\nend_header\n",
            points.len()
        );
        for [x, y, z] in points {
            text += &format!("{x} {y} {z}\n");
        }
        std::fs::write(path, text).unwrap();
    }

    fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
        (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
    }

    /// The distances from each of `points` to the nearest of `others` that is not at the same position: the slow, obvious twin.
    fn nearest(points: &[[f64; 3]], others: &[[f64; 3]]) -> Vec<f64> {
        let to_nearest = |point: &[f64; 3]| {
            let distances = others.iter().map(|other| distance(point, other));
            distances.filter(|&d| d > 0.0).fold(f64::INFINITY, f64::min)
        };
        points.iter().map(to_nearest).collect()
    }

    fn assert_figures(figures: &DistanceFigures, distances: &[f64]) {
        let count = distances.len() as f64;
        let mean = distances.iter().sum::<f64>() / count;
        let max = distances.iter().copied().fold(0.0, f64::max);
        assert_eq!(figures.count, distances.len() as u64);
        assert!((figures.mean - mean).abs() <= 1e-9 * mean, "{figures:?}");
        assert!((figures.max - max).abs() <= 1e-9 * max, "{figures:?}");
    }

    /// Four sheets of points 0.1 apart, cut into several parts, and strays up to a
    /// kilometre away; two of the sheets are not in the scan, which has strays of its own.
    #[test]
    fn the_nearest_point_is_found_however_far_away_it_is() {
        let sheet = |k: u32| -> Vec<[f64; 3]> {
            let (x, y) = (60.0 * f64::from(k % 2), 70.0 * f64::from(k / 2));
            let position = |i: u32| {
                [
                    x + 0.1 * f64::from(i % 100),
                    y + 0.1 * f64::from(i / 100),
                    0.0,
                ]
            };
            (0..10_000).map(position).collect()
        };
        let coordinate = |k: u64| (spread(k) % 1_000_000) as f64 * 0.001 - 400.0;
        let strays: Vec<[f64; 3]> = (0..40)
            .map(|i| {
                [
                    coordinate(3 * i),
                    coordinate(3 * i + 1),
                    5.0 + coordinate(3 * i + 2).abs(),
                ]
            })
            .collect();
        let sheets: Vec<[f64; 3]> = (0..4).flat_map(sheet).collect();
        let cloud = [sheets.clone(), strays.clone()].concat();
        let beside = strays.iter().map(|[x, y, z]| [x + 3.0, y - 20.0, z + 1.0]);
        let scan = [sheet(0), sheet(3), beside.collect()].concat();

        let dir = tempfile::tempdir().unwrap();
        let files = ["cloud.ply", "scan.ply"].map(|name| dir.path().join(name));
        write_cloud(&files[0], &cloud);
        write_cloud(&files[1], &scan);
        let [cloud_file, scan_file] = files.each_ref().map(std::slice::from_ref);
        // So little memory that there are several parts.
        let least = Budget::new(Some(0), 2).least();
        let measured = |against| measure(cloud_file, against, dir.path(), Some(least), 2).unwrap();

        let alone = measured(&[]);
        assert_eq!(alone.uniformity.alone, strays.len() as u64);
        assert_figures(&alone.alone.unwrap(), &nearest(&strays, &cloud));

        let against = measured(scan_file);
        let missed = [sheet(1), sheet(2), strays].concat();
        let mut to_scan = vec![0.0; 20_000];
        to_scan.extend(nearest(&missed, &scan));
        assert_figures(&against.accuracy.unwrap(), &to_scan);
        let mut to_cloud = vec![0.0; 20_000];
        to_cloud.extend(nearest(&scan[20_000..], &cloud));
        assert_figures(&against.coverage.unwrap(), &to_cloud);
    }

    #[test]
    fn an_even_cloud_has_no_point_alone() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sheet.ply");
        let position = |i: u32| [0.1 * f64::from(i % 60), 0.1 * f64::from(i / 60), 1.0];
        write_cloud(&path, &(0..3600).map(position).collect::<Vec<_>>());
        let measured = measure(&[path], &[], dir.path(), None, 2).unwrap();
        assert!(measured.alone.is_none() && measured.uniformity.alone == 0);
        // A hexagonal lattice with as many points is wider than the square one.
        let hexagonal = 0.1 * (2.0 / 3.0_f64.sqrt()).sqrt();
        assert!(
            (measured.spacing / hexagonal - 1.0).abs() < 0.01,
            "{}",
            measured.spacing
        );
    }

    #[test]
    fn a_cloud_of_doubled_points_is_measured() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("doubled.ply");
        let position = |i: u32| [0.1 * f64::from(i / 2 % 60), 0.1 * f64::from(i / 120), 1.0];
        write_cloud(&path, &(0..7200).map(position).collect::<Vec<_>>());
        let measured = measure(&[path], &[], dir.path(), None, 2).unwrap();
        assert_eq!(measured.points, 7200);
        assert!(
            (0.09..0.13).contains(&measured.spacing),
            "{}",
            measured.spacing
        );
    }
}
