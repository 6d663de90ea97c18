//! One global spacing, from `--spacing`, `--count` or `--ratio`.
//!
//! How many seeds a spacing gives depends on the surfaces, which nobody knows
//! before. So it is tried: seeds are elected on parts of the cloud, and the spacing
//! is moved until the count is met. For the rest of the cloud they go with the
//! voxels that its points occupy. Which parts are tried depends on the input alone,
//! not on tiles, threads or memory.

use rayon::prelude::*;

use super::{JobError, gathering::gather_points};
use crate::{
    config::Settings,
    geometry::{OccupiedCells, Quantization, Stored, cell_of},
    lloyd::{AREA_PER_SEED, Scan, SolverOptions, elected_in},
    tile::{Plan, PlanOptions, Spill, Tile},
};

/// Seeds of a part, about: what it sees around itself is a third of that.
const PART_SEEDS: f64 = 1_500.0;
/// Points that a part has at least, and at most.
const PART_POINTS: [f64; 2] = [22_500.0, 1_000_000.0];
/// Points of the parts that are held at a time.
const POINTS_AT_ONCE: u64 = 1_000_000;
/// Points of a part beyond which they are thinned as they come.
const CROWD: u64 = 2 * PART_POINTS[1] as u64;
/// Points that are looked at for the voxels that they occupy, to meet a count …
const VOXEL_POINTS: u64 = 30_000_000;
/// … and to tell beforehand what a spacing will give, about.
const EXPECTED_POINTS: u64 = 3_000_000;
/// Parts that are looked at even so.
const FEWEST: usize = 24;
/// Parts in which seeds are elected, at least, and the share of all: to tell beforehand …
const ROUGH: (f64, f64) = (12.0, 0.04);
/// … and to meet a count. Of four counts on three scans the spacing came out within 0.2 % of
/// what all parts give, within 0.4 % with half as many parts again.
const FINE: (f64, f64) = (40.0, 0.2);
/// One in so many of these is asked first, and the others only where it is near.
const FIRST: usize = 4;
/// What a part sees around it, in spacings of the first guess: for a count, not for
/// seeds that others agree with. With 3 the count of three scans came out within 0.3 % of
/// that.
const HALO: f64 = 2.0;
/// Tries with the first parts alone.
const ROUGH_TRIES: u32 = 3;
/// A count met this closely is met.
const TOLERANCE: f64 = 0.004;
/// A count met this closely is corrected, and not tried again: over so little,
/// seeds go with a power of the spacing.
const NEARLY: f64 = 0.08;
/// A count of the first parts met this closely will do to come near with the next spacing.
const ROUGHLY: f64 = 0.3;
/// Seeds to an occupied voxel of the spacing's edge, about: 0.77 on planes at all angles,
/// 1.15 on those along the axes.
const SEEDS_PER_VOXEL: f64 = 0.9;
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
    quantization: &Quantization,
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
    let extent = spill.bounds().extent() as f64 * quantization.scale;
    if extent == 0.0 {
        return Err(JobError::Refused(
            "all points of the scan are equal: there is no spacing between them".into(),
        ));
    }
    let guess = (plane_seeds(spill, quantization, 1.0) / count as f64)
        .sqrt()
        .clamp(4.0 * quantization.scale, extent);

    let seeds_per_point = count as f64 / spill.points() as f64;
    let options = settings.solver.at(guess, seeds_per_point);
    let sample = Sample::of(spill, quantization, &options, VOXEL_POINTS)?;
    let in_voxels = SEEDS_PER_VOXEL * sample.voxels() * sample.weight;
    let by_voxels = guess * (in_voxels / count as f64).sqrt();
    let mut spacing = by_voxels.clamp(quantization.scale, 2.0 * extent);
    let mut tried: Vec<(f64, f64)> = Vec::new();
    let mut slope = PLANE;
    let chosen = sample.choose(FINE);
    let first: Vec<Chosen> = chosen.iter().copied().step_by(FIRST).collect();
    let others: Vec<Chosen> = chosen
        .chunks(FIRST)
        .flat_map(|few| &few[1..])
        .copied()
        .collect();
    let mut asks_all = false;
    for number in 0..TRIES {
        let options = settings.solver.at(spacing, seeds_per_point);
        let error = |elected| (sample.seeds(elected) / count as f64).ln();
        let mut elected = sample.elect(&first, &options)?;
        if !asks_all && error(elected).abs() <= NEARLY {
            asks_all = true;
            tried.clear();
        }
        if asks_all {
            elected = elected.and(sample.elect(&others, &options)?);
        }
        let error = error(elected);
        if asks_all && error.abs() <= TOLERANCE {
            return Ok(spacing);
        }
        tried.push((spacing.ln(), error));
        slope = slope_of(&tried).unwrap_or(slope);
        let next = (spacing.ln() - error / slope).exp();
        let next = next.clamp(quantization.scale, 2.0 * extent);
        if asks_all && error.abs() <= NEARLY {
            return Ok(next);
        }
        if !asks_all && (error.abs() <= ROUGHLY || number + 1 == ROUGH_TRIES) {
            // From here on all are asked; the slope holds for them, too.
            asks_all = true;
            tried.clear();
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
    quantization: &Quantization,
    settings: &Settings,
    spacing: f64,
) -> Result<f64, JobError> {
    let about = plane_seeds(spill, quantization, spacing);
    let options = settings.solver.at(spacing, about / spill.points() as f64);
    let sample = Sample::of(spill, quantization, &options, EXPECTED_POINTS)?;
    Ok(sample.seeds(sample.elect(&sample.choose(ROUGH), &options)?))
}

/// Seeds that the occupied part of the plane has room for at `spacing`, and half as
/// many again for what stands upright.
fn plane_seeds(spill: &Spill, quantization: &Quantization, spacing: f64) -> f64 {
    let square = (spill.grid().square() as f64 * quantization.scale).powi(2);
    1.5 * spill.squares().count() as f64 * square / (AREA_PER_SEED * spacing * spacing)
}

/// A part of the cloud, and the odds that it was chosen by.
#[derive(Clone, Copy)]
struct Chosen {
    part: usize,
    odds: f64,
}

/// Seeds elected in some parts, and the voxels of those, each part for as many as its odds
/// say.
#[derive(Clone, Copy, Default)]
struct Elected {
    seeds: f64,
    voxels: f64,
}

impl Elected {
    fn and(self, other: Self) -> Self {
        Self {
            seeds: self.seeds + other.seeds,
            voxels: self.voxels + other.voxels,
        }
    }
}

/// A cloud in parts small enough for any budget, the same for all of them.
struct Sample<'a> {
    spill: &'a Spill,
    quantization: &'a Quantization,
    halo: i64,
    /// Parts of the cloud, with the voxels that the points of each occupy.
    parts: Vec<(Tile, u64)>,
    /// Points of the cloud to each of the parts'.
    weight: f64,
}

impl<'a> Sample<'a> {
    /// Parts that hold some `most_points`.
    fn of(
        spill: &'a Spill,
        quantization: &'a Quantization,
        options: &SolverOptions,
        most_points: u64,
    ) -> Result<Self, JobError> {
        let halo = quantization.units(HALO * options.spacing);
        let margin = quantization.units(options.farthest_seed());
        let tiles = parts(spill, halo, margin, options.seeds_per_point);
        let every = spill.points().div_ceil(most_points) as usize;
        let every = every.min(tiles.len() / FEWEST).max(1);
        let tiles: Vec<Tile> = tiles.into_iter().step_by(every).collect();
        let voxels = at_once(&tiles, |tile| {
            let points = gather_points(spill, &tile.core, quantization, options, CROWD)?;
            let voxel = |&point: &Stored| cell_of(quantization.local(point), options.spacing);
            Ok(OccupiedCells::sort(&points, voxel).0.len() as u64)
        })?;
        let points: u64 = tiles.iter().map(|tile| tile.points_core).sum();
        Ok(Self {
            spill,
            quantization,
            halo,
            parts: tiles.into_iter().zip(voxels).collect(),
            weight: spill.points() as f64 / points.max(1) as f64,
        })
    }

    /// Voxels that the points of all parts occupy.
    fn voxels(&self) -> f64 {
        self.parts.iter().map(|&(_, voxels)| voxels as f64).sum()
    }

    /// Elects seeds in the `chosen` parts.
    fn elect(&self, chosen: &[Chosen], options: &SolverOptions) -> Result<Elected, JobError> {
        let tiles: Vec<Tile> = chosen.iter().map(|c| self.parts[c.part].0).collect();
        let elected = at_once(&tiles, |tile| {
            let seen = tile.core.grown(self.halo);
            let points = gather_points(self.spill, &seen, self.quantization, options, CROWD)?;
            let scan = Scan::new(points, *self.quantization, options);
            Ok(elected_in(&scan, options, &tile.core) as u64)
        })?;
        let of_part = |(chosen, seeds): (&Chosen, u64)| Elected {
            seeds: seeds as f64 / chosen.odds,
            voxels: self.parts[chosen.part].1 as f64 / chosen.odds,
        };
        let each = chosen.iter().zip(elected).map(of_part);
        Ok(each.fold(Elected::default(), Elected::and))
    }

    /// Seeds of the cloud, by those `elected` in some parts.
    fn seeds(&self, elected: Elected) -> f64 {
        let per_voxel = elected.seeds / f64::max(elected.voxels, 1.0);
        per_voxel * self.voxels() * self.weight
    }

    /// Some of the parts, evenly over the cloud: at `least` about so many, or this
    /// `share` of them. The odds go with the voxels of a part: few far, sparse parts can
    /// have most of the seeds.
    fn choose(&self, (least, share): (f64, f64)) -> Vec<Chosen> {
        let wanted = least.max(share * self.parts.len() as f64);
        let odds = |factor: f64| {
            let parts = self.parts.iter();
            parts.map(move |&(_, voxels)| (factor * voxels as f64).min(1.0))
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if odds(middle).sum::<f64>() < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        let mut passed = 0.5;
        let mut is_chosen = |odds: f64| {
            let before = f64::floor(passed);
            passed += odds;
            passed.floor() > before
        };
        (0..)
            .zip(odds(high))
            .filter(|&(_, odds)| is_chosen(odds))
            .map(|(part, odds)| Chosen { part, odds })
            .collect()
    }
}

/// Calls `work` for every one of `tiles`, for as many at once as hold no more than
/// [`POINTS_AT_ONCE`]; results come in their order.
fn at_once(
    tiles: &[Tile],
    work: impl Fn(&Tile) -> Result<u64, JobError> + Sync,
) -> Result<Vec<u64>, JobError> {
    let most = tiles.iter().map(|tile| tile.points_seen).max().unwrap_or(0);
    let together = (POINTS_AT_ONCE / most.max(1)).max(1) as usize;
    let mut results = Vec::with_capacity(tiles.len());
    for tiles in tiles.chunks(together) {
        let part: Result<Vec<u64>, JobError> =
            tiles.par_iter().with_max_len(1).map(&work).collect();
        results.extend(part?);
    }
    Ok(results)
}

/// The parts of a cloud that has so many seeds to the point.
fn parts(spill: &Spill, halo: i64, margin: i64, seeds_per_point: f64) -> Vec<Tile> {
    let [least, most] = PART_POINTS;
    let options = PlanOptions {
        halo,
        margin,
        tile_edge: None,
        most_cost: (PART_SEEDS / seeds_per_point).clamp(least, most) as u64,
    };
    Plan::by_points(spill.squares(), spill.grid().square(), &options).tiles
}
