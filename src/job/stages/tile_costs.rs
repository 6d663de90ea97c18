//! The memory that a tile takes for each counting square, by the counts of points and seeds.
//!
//! The points of a square are counted. Its number of seeds is estimated as the mean of two numbers,
//! since a tile contains dense and sparse parts of the scan: in dense parts seeds are proportional to
//! points, in sparse parts each point is a seed as far as the area has room for it.

use std::collections::HashMap;

use rayon::prelude::*;

use super::scattered_cloud::ScatteredCloud;
use crate::{
    geometry::Rect,
    job::{
        error::JobError,
        resources::{points_for, tile_bytes},
    },
    lloyd::{AREA_PER_SEED, Scan, SolverOptions},
    tiling::{CellKey, CountedCloud, Square},
};

/// A tile may have this factor more seeds per point than the mean of the cloud.
const SEED_MARGIN: f64 = 1.25;
/// Number of points in memory while the points that remain after thinning are counted.
const THINNING_LIMIT: u64 = 1 << 20;
/// Number of points of a cell beyond which its squares are thinned one by one.
const LARGE_CELL_POINTS: u64 = 4 << 20;

/// Numbers of points that remain after thinning, by counting square.
type ThinnedCounts = HashMap<[i64; 2], u64>;

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
    let squares = squares(cloud, options, points_out, &ThinnedCounts::new());
    // If one tile has room for all points, it does not matter how many remain after thinning.
    if squares.iter().map(|square| square.cost).sum::<u64>() <= cloud.run.budget.tile() {
        return Ok(squares);
    }
    let thinned = thinned_counts(cloud, options)?;
    Ok(self::squares(cloud, options, points_out, &thinned))
}

/// Lists the occupied counting squares with their costs, where only the `thinned` numbers of points
/// remain in some of them.
fn squares(
    cloud: &ScatteredCloud<'_>,
    options: &SolverOptions,
    points_out: u64,
    thinned: &ThinnedCounts,
) -> Vec<Square> {
    let spill = cloud.spill;
    let edge = spill.grid().square() as f64 * cloud.quantization().scale;
    let mean = SEED_MARGIN * points_out as f64 / spill.points() as f64;
    // Where the scan is sparse it has more seeds per point: up to one, or more where holes are
    // filled, but no more than there is room for.
    let room = (edge / options.spacing).powi(2) / AREA_PER_SEED;
    let sparse = |points: f64| room.min(points * f64::max(1.0, 2.0 * mean));
    let all_sparse: f64 = spill
        .squares()
        .map(|(_, points)| sparse(points as f64))
        .sum();
    // Upright surfaces have seeds above each other.
    let layers = SEED_MARGIN * points_out as f64 / all_sparse;
    spill
        .squares()
        .map(|(index, points)| {
            let resident = thinned.get(&index).map_or(points, |&n| n.min(points));
            let seeds = 0.5 * (points as f64 * mean + layers * sparse(points as f64));
            Square {
                index,
                points,
                cost: tile_bytes(resident as f64, seeds).ceil() as u64,
            }
        })
        .collect()
}

/// Counts the points that remain after thinning in every square with more points than the scan of a
/// plane keeps there.
fn thinned_counts(
    cloud: &ScatteredCloud<'_>,
    options: &SolverOptions,
) -> Result<ThinnedCounts, JobError> {
    let (spill, quantization) = (cloud.spill, cloud.quantization());
    let grid = spill.grid();
    // Several threads together may have the points in memory that one alone may.
    let threads = cloud.run.job.settings.resources.threads;
    let limit = THINNING_LIMIT.min(points_for(cloud.run.budget.tile())) / threads as u64;
    let count_in = |rect: &Rect| -> Result<ThinnedCounts, JobError> {
        let points = CountedCloud::gather(spill, rect, quantization, options, limit)?;
        let mut counts = ThinnedCounts::new();
        for point in Scan::thinned(points, quantization, options) {
            *counts.entry(grid.square_of(point)).or_default() += 1;
        }
        Ok(counts)
    };
    let mut counts = ThinnedCounts::new();
    // Were all rectangles given at once, a thread that waits for a part of one would begin another.
    for few in crowded_rectangles(cloud, options).chunks(threads) {
        let parts: Vec<_> = few.par_iter().map(count_in).collect::<Result<_, _>>()?;
        counts.extend(parts.into_iter().flatten());
    }
    Ok(counts)
}

/// The rectangles of all squares with more points than the scan of a plane keeps there: whole cells,
/// or single squares of large cells.
fn crowded_rectangles(cloud: &ScatteredCloud<'_>, options: &SolverOptions) -> Vec<Rect> {
    let spill = cloud.spill;
    let grid = spill.grid();
    let edge = grid.square() as f64 * cloud.quantization().scale;
    let most = Scan::most_on_square(edge, cloud.quantization(), options);
    let mut crowded: Vec<([i64; 2], CellKey)> = Vec::new();
    let mut points_in_cell: HashMap<CellKey, u64> = HashMap::new();
    for (index, points) in spill.squares() {
        let cell = grid.cell_of_square(index);
        *points_in_cell.entry(cell).or_default() += points;
        if points as f64 > most {
            crowded.push((index, cell));
        }
    }
    let mut rectangles: Vec<Rect> = crowded
        .into_iter()
        .map(
            |(index, cell)| match points_in_cell[&cell] > LARGE_CELL_POINTS {
                true => grid.rect_of_square(index),
                false => grid.rect(cell),
            },
        )
        .collect();
    rectangles.sort_unstable_by_key(|rect| rect.min);
    rectangles.dedup();
    rectangles
}
