//! A cloud is measured in four steps: survey, scatter, estimate of the spacing, and figures part
//! by part.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use serde::Serialize;

use super::{
    cloud_spacing::estimated_spacing,
    cloud_tally::Measurement,
    marked_points::{MARKED_BYTES, Mark, MarkedPoints},
    parts::parts,
};
use crate::{
    geometry::Quantization,
    job::{JobError, resources::Budget, stages::transfer::FARTHEST_MATCH_IN_SPACINGS},
    las::{InputFile, expand_inputs},
    quality::{DistanceFigures, Uniformity},
    tile::{Opener, ScatterOptions, Spill, scatter},
    tiling::CellGrid,
};

/// The figures of a cloud. Lengths are CRS units.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Measured {
    /// The number of points; coincident points count each.
    pub(crate) points: u64,
    /// The figures of uniformity.
    pub(crate) uniformity: Uniformity,
    /// The estimated spacing of a hexagonal lattice with as many points on the cloud's surface. It
    /// is the unit of the distances below.
    pub(crate) spacing: f64,
    /// The distances from the cloud to the nearest points of the scans it is compared with,
    /// searched for within eight spacings.
    pub(crate) accuracy: Option<DistanceFigures>,
    /// The distances from the scans to the nearest points of the cloud, searched for within eight
    /// spacings.
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
    let mut inputs = Vec::new();
    for (mark, paths) in [(Mark::Cloud, files), (Mark::Scan, against)] {
        if !paths.is_empty() {
            for path in expand_inputs(paths)? {
                inputs.push((mark, InputFile::survey(&path)?));
            }
        }
    }
    let dir = temporary.join(format!("lloydar-measure-{}", std::process::id()));
    std::fs::create_dir_all(&dir).map_err(|e| JobError::io("make", &dir, e))?;
    let measured = measure_in(&inputs, &dir, &Budget::new(memory, threads));
    // The files are removed whatever happened.
    drop(std::fs::remove_dir_all(&dir));
    measured
}

/// Measures `inputs` with temporary files in `dir`.
fn measure_in(
    inputs: &[(Mark, InputFile)],
    dir: &Path,
    budget: &Budget,
) -> Result<Measured, JobError> {
    // Cloud and scans, with marks, in one spill.
    let quantization = InputFile::common_quantization(inputs.iter().map(|(_, file)| file));
    let spill = scatter_marked(inputs, quantization, &dir.join("spill"), budget)?;

    // The spacing, from parts without a halo.
    let spacing = estimated_spacing(&spill, &parts(&spill, budget, 0)?, quantization)?;

    // The figures, from parts that contain all that their points depend on.
    let has_scans = inputs.iter().any(|(mark, _)| *mark == Mark::Scan);
    let reach = match has_scans {
        true => FARTHEST_MATCH_IN_SPACINGS * spacing,
        false => MEASURED_HALO_IN_SPACINGS * spacing,
    };
    let tally = Measurement {
        spill: &spill,
        plan: &parts(&spill, budget, quantization.units(reach))?,
        quantization,
        spacing,
        comparison_reach: has_scans.then_some(reach),
    }
    .tally()?;
    Ok(Measured {
        points: tally.points,
        uniformity: tally.uniformity.figures(),
        spacing,
        accuracy: has_scans.then(|| tally.accuracy.figures()),
        coverage: has_scans.then(|| tally.coverage.figures()),
        truth: None,
    })
}

/// Scatters the marked points of `inputs` into the spill at `stem`.
fn scatter_marked(
    inputs: &[(Mark, InputFile)],
    quantization: Quantization,
    stem: &Path,
    budget: &Budget,
) -> Result<Spill, JobError> {
    let sources: Vec<Opener<'_>> = inputs
        .iter()
        .map(|(mark, file)| {
            Box::new(move |_| MarkedPoints::open(file, *mark, quantization)) as Opener<'_>
        })
        .collect();
    let options = ScatterOptions {
        record_length: MARKED_BYTES,
        threads: budget.decoders(),
        buffer_bytes: budget.buffers(),
        // A measurement is not resumed.
        checkpoint_bytes: u64::MAX,
        keep_going: false,
    };
    let extent = inputs.iter().fold(0.0, |extent: f64, (_, file)| {
        let [min, max] = file.bounds;
        extent.max(max[0] - min[0]).max(max[1] - min[1])
    });
    let grid = CellGrid::for_extent((extent / quantization.scale) as i64, MEASURED_CELL_EDGE);
    let never = AtomicBool::new(false);
    scatter(sources, grid, stem, options, &|_| {}, &never)?;
    Ok(Spill::open(stem)?)
}
