//! One global spacing, from `--spacing`, `--count` or `--ratio`.
//!
//! How many seeds a spacing gives depends on the surfaces, which nobody knows
//! before. So it is tried: seeds are elected on a sample of the cloud (all of it
//! if there are few points), and the spacing is moved until the count is met.
//! The sample depends on the input alone, not on tiles, threads or memory.

use super::JobError;
use crate::{
    config::Settings,
    geometry::{Lattice, Stored},
    lloyd::{AREA_PER_SEED, Options, Scan, elected_in},
    tile::{Plan, PlanOptions, Spill, TileError},
};

/// Points to elect from, about; more would not move the count by one in a
/// hundred.
const SAMPLE_POINTS: u64 = 12_000_000;
/// Points for the first tries, which only have to come near, and how many there
/// may be of them.
const FIRST_POINTS: u64 = 1_500_000;
const ROUGH_TRIES: u32 = 3;
/// Points of a part of the cloud in which seeds are elected.
const PART_POINTS: u64 = 1_000_000;
/// A count met this closely is met.
const TOLERANCE: f64 = 0.004;
/// A count met this closely is corrected, and not tried again: over so little,
/// seeds go with a power of the spacing.
const NEARLY: f64 = 0.06;
/// More than so many points to each of the scan's, and hardly any would be where
/// something was scanned.
const MOST_PER_POINT: u64 = 16;
/// Tries; three are usual.
const TRIES: u32 = 12;
/// The slope on a plane: seeds go with the inverse square of the spacing.
const PLANE: f64 = -2.0;

/// The spacing (CRS units) that gives about `count` seeds on the points of
/// `spill`.
pub(super) fn for_count(
    spill: &Spill,
    lattice: &Lattice,
    settings: &Settings,
    count: u64,
) -> Result<f64, JobError> {
    if count > MOST_PER_POINT * spill.points() {
        return Err(JobError::Refused(format!(
            "--count {count} is more than the {} points of the scan can carry: at most {MOST_PER_POINT} \
             for each; ask for fewer, or for a --spacing",
            spill.points()
        )));
    }
    let extent = spill.bounds().extent() as f64 * lattice.scale;
    if extent == 0.0 {
        return Err(JobError::Refused(
            "all points of the scan are equal: there is no spacing between them".into(),
        ));
    }
    let occupied =
        spill.squares().count() as f64 * (spill.grid().square() as f64 * lattice.scale).powi(2);
    // Were it a plane, and half as much again for what stands upright.
    let guess = (1.5 * occupied / (AREA_PER_SEED * count as f64)).sqrt();
    let mut spacing = guess.clamp(4.0 * lattice.scale, extent);

    let seeds_per_point = count as f64 / spill.points() as f64;
    let mut tried: Vec<(f64, f64)> = Vec::new();
    let mut slope = PLANE;
    let mut is_rough = spill.points() > FIRST_POINTS;
    for number in 0..TRIES {
        let sample = if is_rough {
            FIRST_POINTS
        } else {
            SAMPLE_POINTS
        };
        let options = settings.solver(spacing, seeds_per_point);
        let found = seeds(spill, lattice, &options, sample)?;
        let error = (found / count as f64).ln();
        tried.push((spacing.ln(), error));
        slope = slope_of(&tried).unwrap_or(slope);
        let next = (spacing.ln() - error / slope).exp();
        let next = next.clamp(lattice.scale, 2.0 * extent);
        let is_near = error.abs() <= NEARLY;
        if is_rough {
            // Once near, all points are asked; the slope holds for them, too.
            is_rough = !is_near && number + 1 < ROUGH_TRIES;
            if !is_rough {
                tried.clear();
            }
        } else if error.abs() <= TOLERANCE {
            return Ok(spacing);
        } else if is_near {
            return Ok(next);
        }
        spacing = next;
    }
    let (best, error) = tried
        .iter()
        .copied()
        .min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        .unwrap_or((spacing.ln(), 0.0));
    if error < -0.05 {
        return Err(JobError::Refused(format!(
            "--count {count} is more than this scan can carry: at a spacing of {:.3e} it gives about \
             {:.0} points; ask for fewer",
            best.exp(),
            count as f64 * error.exp()
        )));
    }
    Ok(best.exp())
}

/// How the logarithm of the count goes with that of the spacing, by the last two
/// tries.
fn slope_of(tried: &[(f64, f64)]) -> Option<f64> {
    match tried {
        [.., (before, error_before), (last, error)] if (last - before).abs() > 1e-9 => {
            // Seeds fall with the spacing; anything else is noise of the sample.
            Some(((error - error_before) / (last - before)).clamp(-3.0, -0.5))
        }
        _ => None,
    }
}

/// Seeds that the cloud has at `spacing`, about.
pub(super) fn expected(
    spill: &Spill,
    lattice: &Lattice,
    settings: &Settings,
    spacing: f64,
) -> Result<f64, JobError> {
    seeds(
        spill,
        lattice,
        &settings.solver(spacing, 0.0),
        SAMPLE_POINTS,
    )
}

/// Seeds elected from `sample` points, for all of the cloud.
fn seeds(
    spill: &Spill,
    lattice: &Lattice,
    options: &Options,
    sample: u64,
) -> Result<f64, JobError> {
    let halo = 6.0 * options.spacing + options.fill;
    let margin = options.farthest_seed();
    let parts = parts(spill, lattice.units(halo), lattice.units(margin))?;
    let every = spill.points().div_ceil(sample.max(1)).max(1) as usize;
    let (mut elected, mut sampled) = (0, 0);
    for tile in parts.tiles.iter().step_by(every) {
        let mut points: Vec<Stored> = Vec::new();
        spill.gather(&tile.core.grown(parts.halo), |record| {
            points.push(Stored::of_record(record));
        })?;
        let scan = Scan::new(points, *lattice, options);
        elected += elected_in(&scan, options, &tile.core);
        sampled += tile.points_core;
    }
    Ok(elected as f64 * spill.points() as f64 / sampled.max(1) as f64)
}

/// The cloud in parts small enough for any budget, the same for all of them.
fn parts(spill: &Spill, halo: i64, margin: i64) -> Result<Plan, JobError> {
    let mut most_points = PART_POINTS;
    loop {
        let options = PlanOptions {
            halo,
            margin,
            tile_edge: None,
            most_points,
        };
        match Plan::make(spill, options) {
            Err(TileError::TooDense { points, .. }) => most_points = points,
            other => return Ok(other?),
        }
    }
}
