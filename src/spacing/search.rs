//! The search for the spacing that gives a count of sites.
//!
//! The logarithm of the count falls nearly linearly with that of the spacing: by 2 on a plane, by more among leaves, by
//! less where the scan is sparse. The voxels that it occupies, and those twice as wide, tell how steeply ([`Scaling`]); where
//! they do not, the search is a secant method on logarithms. A quarter of the drawn parts is tried first; the others are
//! tried only where that quarter comes near the count. Where a step would leave the range between a spacing with too many
//! sites and one with too few, as in clouds of few points, the range is halved.

use super::{
    MAX_SITES_PER_POINT, SpacingError,
    facing::dominant_normals,
    sample::{DrawnPart, Parts, SampleSize},
    scaling::Scaling,
    sites_of_the_plane,
};
use crate::{
    geometry::Quantization,
    lloyd::{DominantNormals, SolverOptions, SolverSettings},
    tiling::CountedCloud,
};

/// Approximate number of seeds in a part: the part sees a third of them again around itself.
const SEEDS_PER_PART: f64 = 1_500.0;
/// Points whose voxels are counted to meet a count.
const POINTS_FOR_COUNT: u64 = 30_000_000;
/// Points whose voxels are counted to estimate what a spacing gives.
const POINTS_FOR_ESTIMATE: u64 = 3_000_000;
/// Parts in which seeds are elected to estimate what a spacing gives.
const ESTIMATE_SAMPLE: SampleSize = SampleSize {
    parts: 8.0,
    share: 0.04,
};
/// With fewer sites for each point than this a small sample estimates what a spacing gives. How wide the holes are that are closed does
/// not depend on it there.
const DENSE_SITES_PER_POINT: f64 = 0.1;
/// Approximate number of seeds in a part of a dense scan. Where much stands upright there are more.
const SEEDS_PER_SMALL_PART: f64 = 300.0;
/// Parts in which seeds are elected to estimate what a spacing gives where the scan is dense. At 36 spacings of ten scans the estimate was
/// wrong by 2.3 % (root mean square), and by 6.3 % at the most; with twice as many parts by 1.3 % and 4 %, for twice the time. The number
/// of occupied voxels alone is wrong by 19 %, once by 44 %.
const SMALL_SAMPLE: SampleSize = SampleSize {
    parts: 4.0,
    share: 0.0,
};
/// Parts in which seeds are elected to meet a count. On six scans at three counts each the sites came out within 1.4 % of the
/// count, and within 1 % at 16 of the 18.
const COUNT_SAMPLE: SampleSize = SampleSize {
    parts: 32.0,
    share: 0.15,
};
/// One in this many drawn parts is tried first, and the others only where it comes near the count.
const FIRST_PART_IN: usize = 4;
/// Trials with the first parts alone.
const FIRST_TRIALS: u32 = 2;
/// Most trials; one or two are usual.
const MAX_TRIALS: u32 = 12;
/// Error of the logarithm of the count below which the spacing is taken.
const TOLERANCE: f64 = 0.004;
/// Difference of the logarithms of two spacings from which on the counts of the first parts tell a slope: noise of one or two percent
/// hides it over less. A terrestrial scan to one in 20 missed its count by 7.9 % for a slope over 0.04.
const FAR_FOR_SLOPE: f64 = 0.1;
/// Error of the first parts below which the others are tried, too.
const NEAR_FOR_FIRST_PARTS: f64 = 0.16;
/// Error at which the surfaces are said not to carry the count.
const NOT_CARRIED: f64 = -0.05;
/// Growth of the logarithm of the count, while the spacing is at least halved, below which no finer spacing is
/// tried. On a plane it is 1.39 for each halving, and none where points stand alone.
const LEAST_GROWTH: f64 = 0.05;
/// Where a count is not carried at the spacings around the guesses, the spacing for one site to so many points says where to look. Walls have no
/// area, seen from above, so that the guesses are too fine for holes to be closed.
const POINTS_TO_ONE_OF_FEWER: u64 = 4;
/// No slope of the logarithm of the count is steeper.
const STEEPEST_SLOPE: f64 = -3.0;
/// What two counts differ by beyond that is a step: more than the noise of their samples.
const LEAST_STEP: f64 = 0.04;
/// The slope on a plane, where the count is proportional to the inverse square of the spacing.
const SLOPE_OF_A_PLANE: f64 = -2.0;

/// The estimated number of sites that `cloud` gives at `spacing` (CRS units).
///
/// # Errors
///
/// [`SpacingError::Gather`] if a part of the cloud cannot be gathered.
pub(crate) fn estimated_count<C: CountedCloud>(
    cloud: &C,
    quantization: &Quantization,
    settings: &SolverSettings,
    spacing: f64,
) -> Result<f64, SpacingError<C::Error>> {
    let options = estimate_options(cloud, quantization, settings, spacing);
    // Where the spacing varies, the coarsest one says little of the number of sites.
    let is_dense = options.grading.is_none() && options.seeds_per_point < DENSE_SITES_PER_POINT;
    let (seeds_per_part, sample) = match is_dense {
        true => (SEEDS_PER_SMALL_PART, SMALL_SAMPLE),
        false => (SEEDS_PER_PART, ESTIMATE_SAMPLE),
    };
    let mut parts = Parts::cut(
        cloud,
        quantization,
        &options,
        seeds_per_part,
        POINTS_FOR_ESTIMATE,
    );
    if !parts.are_all_drawn(sample) {
        let counted = parts.count_voxels(&options);
        counted.map_err(SpacingError::Gather)?;
    }
    let elected = parts.elect(&parts.draw(sample), &options);
    Ok(parts.seeds(elected.map_err(SpacingError::Gather)?))
}

/// The options with which seeds are elected to estimate what `spacing` gives.
pub(super) fn estimate_options(
    cloud: &impl CountedCloud,
    quantization: &Quantization,
    settings: &SolverSettings,
    spacing: f64,
) -> SolverOptions {
    let guess = sites_of_the_plane(cloud, quantization, spacing);
    // Where a scan is sparser than that, points stand alone: nothing across wider holes is their surface,
    // and to look for it would only take time.
    let sites_per_point = (guess / cloud.points() as f64).min(MAX_SITES_PER_POINT as f64);
    settings.at(spacing, sites_per_point)
}

/// The spacing (CRS units) at which `cloud` gives approximately `count` sites.
///
/// # Errors
///
/// [`SpacingError::TooMany`], [`SpacingError::AllEqual`] and [`SpacingError::CannotCarry`] if there is no such
/// spacing, [`SpacingError::Gather`] if a part of the cloud cannot be gathered.
pub(crate) fn spacing_for_count<C: CountedCloud>(
    cloud: &C,
    quantization: &Quantization,
    settings: &SolverSettings,
    count: u64,
) -> Result<f64, SpacingError<C::Error>> {
    let points = cloud.points();
    if count > MAX_SITES_PER_POINT * points {
        return Err(SpacingError::TooMany { count, points });
    }
    let extent = cloud.bounds().extent() as f64 * quantization.scale;
    if extent == 0.0 {
        return Err(SpacingError::AllEqual { points });
    }
    // A first guess by the occupied squares, a second by the voxels that the guess makes.
    let scale = quantization.scale;
    let guess = (sites_of_the_plane(cloud, quantization, 1.0) / count as f64)
        .sqrt()
        .min(extent)
        .max(4.0 * scale);
    let sites_per_point = count as f64 / points as f64;
    let options = settings.at(guess, sites_per_point);
    let mut parts = Parts::cut(
        cloud,
        quantization,
        &options,
        SEEDS_PER_PART,
        POINTS_FOR_COUNT,
    );
    let counted = parts.count_voxels(&options);
    counted.map_err(SpacingError::Gather)?;
    let scaling = parts.scaling();
    let by_voxels = guess * scaling.factor(parts.voxels_of_cloud(), count as f64);

    // On lattices that are not tilted there are more seeds. The directions hardly depend on the spacing; where points stand
    // alone there are none.
    let range = [scale, 2.0 * extent];
    let dominant_normals = if sites_per_point < 1.0 {
        let options = settings.at(by_voxels.clamp(range[0], range[1]), sites_per_point);
        let found = dominant_normals(cloud, quantization, &options);
        found.map_err(SpacingError::Gather)?
    } else {
        DominantNormals::default()
    };

    let drawn = parts.draw(COUNT_SAMPLE);
    let search = Search {
        first: drawn.iter().copied().step_by(FIRST_PART_IN).collect(),
        others: drawn
            .chunks(FIRST_PART_IN)
            .flat_map(|few| &few[1..])
            .copied()
            .collect(),
        parts,
        settings,
        count: count as f64,
        points,
        sites_per_point,
        dominant_normals,
        scaling,
        range,
    };
    let is_not_carried =
        |found: &Result<_, _>| matches!(found, Err(SpacingError::CannotCarry { .. }));
    let mut found = search.run_from(by_voxels, guess);
    let fewer = points / POINTS_TO_ONE_OF_FEWER;
    if is_not_carried(&found) && (1..count).contains(&fewer) {
        let of_fewer = spacing_for_count(cloud, quantization, settings, fewer);
        if !is_not_carried(&of_fewer) {
            found = search.run(of_fewer? * (fewer as f64 / count as f64).sqrt());
        }
    }
    // The finer the spacing, the more points of a sparse scan are isolated: what is left is as many as there can be.
    if is_not_carried(&found) && settings.drops_isolated() {
        let settings = &settings.with_isolated();
        found = Search { settings, ..search }.run_from(by_voxels, guess);
    }
    found
}

/// What stays the same from trial to trial.
struct Search<'a, C> {
    parts: Parts<'a, C>,
    first: Vec<DrawnPart>,
    others: Vec<DrawnPart>,
    settings: &'a SolverSettings,
    count: f64,
    /// Number of points of the cloud.
    points: u64,
    sites_per_point: f64,
    dominant_normals: DominantNormals,
    scaling: Scaling,
    /// The least and the largest spacing.
    range: [f64; 2],
}

/// A spacing that was tried.
#[derive(Clone, Copy)]
struct Trial {
    log_spacing: f64,
    /// The logarithm of the estimated count over the requested one.
    error: f64,
}

impl<C: CountedCloud> Search<'_, C> {
    /// Tries spacings, beginning with the guess `by_voxels`.
    fn run_from(&self, by_voxels: f64, guess: f64) -> Result<f64, SpacingError<C::Error>> {
        match self.run(by_voxels) {
            // Where points are farther apart than the output, each occupies a voxel of its own however fine
            // voxels are, so that the second guess is too fine for holes to be closed. The first one is coarse.
            Err(SpacingError::CannotCarry { .. }) => self.run(guess),
            found => found,
        }
    }

    /// Tries spacings, beginning with `start`, until the count is met.
    fn run(&self, start: f64) -> Result<f64, SpacingError<C::Error>> {
        let [least, most] = self.range;
        let mut spacing = start.clamp(least, most);
        let mut trials: Vec<Trial> = Vec::new();
        // The first parts are tried at every spacing: their counts say how steep the way is.
        let mut by_first_parts: Vec<Trial> = Vec::new();
        let mut all_parts = false;
        for number in 0..MAX_TRIALS {
            let (first_error, error_of_all) = self.errors(spacing, all_parts)?;
            let error = error_of_all.unwrap_or(first_error);
            if error_of_all.is_some() && !all_parts {
                // The trials of the first parts say nothing of the errors of all.
                all_parts = true;
                trials.clear();
            }
            if all_parts && error.abs() <= TOLERANCE {
                return Ok(spacing);
            }
            let log_spacing = spacing.ln();
            trials.push(Trial { log_spacing, error });
            by_first_parts.push(Trial {
                log_spacing,
                error: first_error,
            });
            if is_exhausted(&trials) {
                break;
            }
            let known = self.scaling.slope();
            let slope = known.or_else(|| slope_of(&by_first_parts));
            let slope = slope.unwrap_or(SLOPE_OF_A_PLANE);
            let next = kept_between(&trials, log_spacing - error / slope);
            let next = next.exp().clamp(least, most);
            if all_parts && error.abs() <= self.scaling.correctable(self.count, self.points) {
                let is_tried = has_step_towards(&by_first_parts, next.ln());
                return Ok(if is_tried { spacing } else { next });
            }
            if !all_parts && number + 1 == FIRST_TRIALS {
                all_parts = true;
                trials.clear();
            }
            spacing = next;
        }
        self.best_of(&trials)
    }

    /// The error of the count at `spacing` by the first parts, and that by all of them if `all_parts` or if the
    /// first are near.
    fn errors(
        &self,
        spacing: f64,
        all_parts: bool,
    ) -> Result<(f64, Option<f64>), SpacingError<C::Error>> {
        let options = SolverOptions {
            dominant_normals: self.dominant_normals,
            ..self.settings.at(spacing, self.sites_per_point)
        };
        // The logarithm of no site at all is no number.
        let error = |sample| (self.parts.seeds(sample).max(0.5) / self.count).ln();
        let elect = |drawn: &[DrawnPart]| {
            let counts = self.parts.elect(drawn, &options);
            counts.map_err(SpacingError::Gather)
        };
        let first = elect(&self.first)?;
        if !all_parts && error(first).abs() > NEAR_FOR_FIRST_PARTS {
            return Ok((error(first), None));
        }
        Ok((error(first), Some(error(first.and(elect(&self.others)?)))))
    }

    /// The best of `trials`, at least one of which was made, and none of which met the count.
    fn best_of(&self, trials: &[Trial]) -> Result<f64, SpacingError<C::Error>> {
        let best = trials
            .iter()
            .min_by(|a, b| a.error.abs().total_cmp(&b.error.abs()))
            .expect("a trial");
        let spacing = best.log_spacing.exp();
        let has_enough = trials.iter().any(|trial| trial.error > 0.0);
        if best.error < NOT_CARRIED && !has_enough {
            return Err(SpacingError::CannotCarry {
                count: self.count as u64,
                spacing,
                reached: self.count * best.error.exp(),
            });
        }
        Ok(spacing)
    }
}

/// Whether the last of `trials` has too few sites, and hardly more than one with twice its spacing or more:
/// its points stand alone, and finer spacings do not give more.
fn is_exhausted(trials: &[Trial]) -> bool {
    let Some((last, before)) = trials.split_last() else {
        return false;
    };
    let is_in_vain = |trial: &Trial| {
        trial.error < NOT_CARRIED
            && trial.log_spacing - last.log_spacing >= std::f64::consts::LN_2
            && last.error - trial.error < LEAST_GROWTH
    };
    last.error < NOT_CARRIED && before.iter().any(is_in_vain)
}

/// The logarithm `next` of a spacing, or if it is not between the coarsest of `trials` with too many sites and the finest with too few
/// the middle of these.
fn kept_between(trials: &[Trial], next: f64) -> f64 {
    let of = |is_it: fn(f64) -> bool| {
        let found = trials.iter().filter(move |trial| is_it(trial.error));
        found.map(|trial| trial.log_spacing)
    };
    let too_fine = of(|error| error > 0.0).max_by(f64::total_cmp);
    let too_coarse = of(|error| error < 0.0).min_by(f64::total_cmp);
    match (too_fine, too_coarse) {
        // Noise of the sample can put them the other way around.
        (Some(low), Some(high)) if low < high && !(low..high).contains(&next) => 0.5 * (low + high),
        _ => next,
    }
}

/// The slope of the logarithm of the count over that of the spacing: by the last of `trials` and the latest one before it that is far
/// enough away, or if none is the farthest.
fn slope_of(trials: &[Trial]) -> Option<f64> {
    let (last, before) = trials.split_last()?;
    let worth = |trial: &Trial| {
        (last.log_spacing - trial.log_spacing)
            .abs()
            .min(FAR_FOR_SLOPE)
    };
    // Of equals it is the latest.
    let other = before.iter().max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
    let way = last.log_spacing - other.log_spacing;
    // The count falls as the spacing grows; anything else is noise of the sample.
    (way.abs() > 1e-9).then(|| ((last.error - other.error) / way).clamp(STEEPEST_SLOPE, -0.5))
}

/// Whether the count has a step between the last of `trials` and the nearest other one towards the spacing with the logarithm `next`, as it
/// has where the gaps between profiles begin to be closed: no slope tells where it is, and sites that leave or come make up for less.
fn has_step_towards(trials: &[Trial], next: f64) -> bool {
    let Some((last, before)) = trials.split_last() else {
        return false;
    };
    let way = |trial: &Trial| trial.log_spacing - last.log_spacing;
    let is_towards = |trial: &&Trial| way(trial) * (next - last.log_spacing) > 0.0;
    let towards = before.iter().filter(is_towards);
    let nearest = towards.min_by(|a, b| way(a).abs().total_cmp(&way(b).abs()));
    nearest.is_some_and(|other| {
        (other.error - last.error).abs() > LEAST_STEP - STEEPEST_SLOPE * way(other).abs()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(log_spacing: f64, error: f64) -> Trial {
        Trial { log_spacing, error }
    }

    #[test]
    fn noise_of_near_trials_makes_no_slope() {
        // A plane, and 0.02 too many sites at the last of three trials, next to the second.
        let (first, near) = (trial(0.0, 0.4), trial(0.2, 0.0));
        let last = trial(0.23, -0.06 + 0.02);
        let slope = |trials: &[Trial]| slope_of(trials).unwrap();
        assert!((slope(&[first, near]) + 2.0).abs() < 1e-12);
        assert!((slope(&[first, near, last]) + 2.0).abs() < 0.1);
        // With none far enough away it is the farthest.
        let nearest = trial(0.24, -0.08);
        assert!((slope(&[near, nearest, last]) + 4.0 / 3.0).abs() < 1e-9);
        // Of several far ones it is the latest: the way bends.
        assert_eq!(slope(&[first, near, trial(0.4, -0.2)]), -1.0);
        assert_eq!(slope_of(&[last]), None);
        assert_eq!(slope_of(&[last, last]), None);
    }

    #[test]
    fn a_step_of_the_count_is_told_from_noise() {
        // Profiles five metres apart, to spacings about as wide.
        let sonar = [(5.10, 0.387), (6.19, 0.143), (6.55, -0.078), (6.27, -0.016)];
        let trials = sonar.map(|(spacing, error)| trial(f64::ln(spacing), error));
        assert!(has_step_towards(&trials, f64::ln(6.23)));
        // On the other side there is none.
        assert!(!has_step_towards(&trials, f64::ln(6.30)));
        // A plane, with an error of 0.02 at the last trial.
        let plane = [trial(0.0, 0.02), trial(0.02, -0.02 - 0.02)];
        assert!(!has_step_towards(&plane, 0.01));
        assert!(!has_step_towards(&plane[1..], 0.01));
    }
}
