//! The memory that a tile takes for each counting square, by the counts of points and voxels.
//!
//! What a tile holds of the scan is counted as it will be held: thinned. Its number of seeds is
//! estimated from its occupied voxels: one for seven where the scan is dense, one for each where it is
//! sparse, but no more there than the area has room for.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;

use super::scattered_cloud::ScatteredCloud;
use crate::{
    geometry::{CellIndex, Rect},
    job::{
        error::JobError,
        resources::{points_for, tile_bytes},
    },
    lloyd::{AREA_PER_SEED, SolverOptions, Thinning},
    tiling::{CountedCloud, Square},
};

/// A tile may have this factor more seeds than estimated.
const SEED_MARGIN: f64 = 1.25;
/// Occupied voxels to a seed where the scan is dense: five on a plane that is parallel to the axes.
const VOXELS_PER_DENSE_SEED: f64 = 7.0;
/// A tile takes this factor more where the spacing varies: for what is known of each point, the field, and points that are
/// thinned once more. On a simulated street of 4 M points to 178 K it was 1.26.
const GRADED_FACTOR: f64 = 1.4;
/// Number of points in memory while the points that remain after thinning are counted.
const THINNING_LIMIT: u64 = 1 << 20;

/// What a scan keeps of a counting square.
#[derive(Clone, Copy, Debug, Default)]
struct KeptCounts {
    /// Points and sums of points.
    points: u64,
    /// Occupied voxels.
    voxels: u64,
}

/// Lists the occupied counting squares, with the memory that a tile takes for each if the cloud has
/// approximately `points_out` sites.
///
/// # Errors
///
/// [`JobError::Tile`] if points cannot be read from the spill.
pub(super) fn costed_squares(
    cloud: &ScatteredCloud<'_>,
    options: &SolverOptions,
    points_out: u64,
) -> Result<Vec<Square>, JobError> {
    let spill = cloud.spill;
    let factor = match options.grading {
        None => 1.0,
        Some(_) => GRADED_FACTOR,
    };
    // If one tile has room for all points, it does not matter how many of them are where.
    let values = spill.values() as f64;
    let squares = |cost: &dyn Fn([i64; 2], u64) -> f64| -> Vec<Square> {
        let square = |(index, points)| Square {
            index,
            points,
            cost: cost(index, points).ceil() as u64,
        };
        spill.squares().map(square).collect()
    };
    let all_seeds = SEED_MARGIN * points_out as f64;
    let as_one = squares(&|_, points| {
        let share = points as f64 / spill.points() as f64;
        let points = share * values;
        factor * tile_bytes(points, points, share * all_seeds)
    });
    let cost_of_one: u64 = as_one.iter().map(|square| square.cost).sum();
    if cost_of_one <= cloud.budget().tile() {
        return Ok(as_one);
    }

    // Count what remains after thinning, and estimate the seeds.
    let kept = kept_counts(cloud, options)?;
    let edge = spill.grid().square() as f64 * cloud.quantization().scale;
    let room = (edge / options.finest_spacing()).powi(2) / AREA_PER_SEED;
    let seeds = |kept: &KeptCounts| {
        let voxels = kept.voxels as f64;
        (voxels / VOXELS_PER_DENSE_SEED).max(voxels.min(room))
    };
    let scale = all_seeds / kept.values().map(seeds).sum::<f64>().max(1.0);
    Ok(squares(&|index, points| {
        let kept = kept.get(&index).copied().unwrap_or(KeptCounts {
            points,
            voxels: points,
        });
        factor * tile_bytes(kept.points as f64, kept.voxels as f64, scale * seeds(&kept))
    }))
}

/// Counts the points and the voxels that remain after thinning in every square.
fn kept_counts(
    cloud: &ScatteredCloud<'_>,
    options: &SolverOptions,
) -> Result<BTreeMap<[i64; 2], KeptCounts>, JobError> {
    let (spill, quantization) = (cloud.spill, cloud.quantization());
    let (grid, thinning) = (spill.grid(), Thinning::new(quantization, options));
    // Several threads together may have the points in memory that one alone may.
    let threads = cloud.run.job.settings.resources.threads;
    let limit = THINNING_LIMIT.min(points_for(cloud.budget().tile())) / threads as u64;
    let count_in = |rect: &Rect| -> Result<HashMap<[i64; 2], KeptCounts>, JobError> {
        let points = CountedCloud::gather(spill, rect, quantization, options, limit)?;
        let points = thinning.thinned(points);
        let mut counts: HashMap<[i64; 2], KeptCounts> = HashMap::new();
        // Thinned points come voxel by voxel.
        let mut last: Option<CellIndex> = None;
        for &point in &points.kept {
            let counts = counts.entry(grid.square_of(point)).or_default();
            let voxel = Some(thinning.voxel_of(point));
            counts.points += 1;
            counts.voxels += u64::from(voxel != last);
            last = voxel;
        }
        for sum in &points.sums {
            counts.entry(grid.square_of(sum.mean())).or_default().points += 1;
        }
        Ok(counts)
    };
    // In order: costs are sums over them, and plans are the same whenever they are made.
    let mut counts = BTreeMap::new();
    let rectangles: Vec<Rect> = spill.cells().map(|cell| grid.rect(cell)).collect();
    // Were all rectangles given at once, a thread that waits for a part of one would begin another.
    for few in rectangles.chunks(threads) {
        let parts: Vec<_> = few.par_iter().map(count_in).collect::<Result<_, _>>()?;
        counts.extend(parts.into_iter().flatten());
    }
    Ok(counts)
}
