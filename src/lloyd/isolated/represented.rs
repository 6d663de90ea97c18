//! How many points of the scan seeds stand for, and how many are usual there.

use crate::{geometry::Local, lloyd::surface::Surface};

/// The points that a seed stands for are those nearer to it.
const OWN_IN_SPACINGS: f64 = 1.0;
/// The points that a seed alone stands for are those nearer to it: other seeds are hardly ever as near to them.
const NEAR_IN_SPACINGS: f64 = 0.5;
/// Number of voxels that the cell of a seed on a surface meets.
pub(super) const VOXELS_OF_A_SEED: f64 = 5.4;
/// Radius of the surroundings by which it is judged how many points are few: no more than the margin of an election.
const SURROUNDINGS_IN_SPACINGS: f64 = 8.0;

/// The numbers of points of the scan that one seed stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Represented {
    pub(super) own: f64,
    /// Those that are nearer to it than to any other seed.
    pub(super) near: f64,
}

impl Represented {
    /// The points of the scan that the `seed` stands for.
    pub(super) fn by(surface: Surface<'_>, seed: Local) -> Self {
        let mut points = Self {
            own: 0.0,
            near: 0.0,
        };
        let [own, near] = [OWN_IN_SPACINGS, NEAR_IN_SPACINGS].map(|r| r * surface.spacing());
        let samples = surface.scan.samples();
        samples.visit_around(seed, own, |sample, place| {
            let distance = (place - seed).norm();
            if distance < own {
                let count = surface.scan.points_of_sample(sample);
                points.own += count;
                points.near += if distance < near { count } else { 0.0 };
            }
        });
        points
    }
}

/// Whether `place` is one that one of the `seeds` stands for.
fn is_own(surface: Surface<'_>, seeds: &[Local], place: Local) -> bool {
    let own = OWN_IN_SPACINGS * surface.spacing();
    seeds.iter().any(|seed| (place - seed).norm() < own)
}

/// The number of points of the scan that the `seeds` stand for.
pub(super) fn own_points(surface: Surface<'_>, seeds: &[Local]) -> f64 {
    let mut points = 0.0;
    let reach = OWN_IN_SPACINGS * surface.spacing();
    for (k, &seed) in seeds.iter().enumerate() {
        let samples = surface.scan.samples();
        samples.visit_around(seed, reach, |sample, place| {
            let is_counted = is_own(surface, &seeds[..k], place);
            if !is_counted && (place - seed).norm() < reach {
                points += surface.scan.points_of_sample(sample);
            }
        });
    }
    points
}

/// The number of points that a seed of the whole cloud stands for on average.
pub(super) fn average_points(surface: Surface<'_>) -> f64 {
    1.0 / surface.options.seeds_per_point
}

/// The number of points that voxels around the `seeds` usually have: the mean over the points, not over the voxels, which
/// is that of dense surfaces amid sparse clutter.
pub(super) fn usual_points(surface: Surface<'_>, seeds: &[Local]) -> f64 {
    let around = SURROUNDINGS_IN_SPACINGS * surface.spacing();
    // Sums of whole numbers do not depend on their order.
    let (mut sum, mut squares) = (0.0, 0.0);
    let samples = surface.scan.samples();
    samples.visit_around(seeds[0], around, |sample, place| {
        if (place - seeds[0]).norm() < around && !is_own(surface, seeds, place) {
            let count = surface.scan.points_of_sample(sample);
            sum += count;
            squares += count * count;
        }
    });
    match sum > 0.0 {
        true => squares / sum,
        false => average_points(surface) / VOXELS_OF_A_SEED,
    }
}
