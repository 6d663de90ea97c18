//! How many points of the scan seeds stand for, and how many are usual there.

use super::blocks::Block;
use crate::{geometry::Local, lloyd::surface::Surface};

/// The points that a seed stands for are those nearer to it.
const OWN_IN_SPACINGS: f64 = 1.0;
/// The points that a seed alone stands for are those nearer to it: other seeds are hardly ever as near to them.
const NEAR_IN_SPACINGS: f64 = 0.5;
/// The share of the points that a seed on a surface stands for which are so near to it.
const NEAR_SHARE: f64 = (NEAR_IN_SPACINGS / OWN_IN_SPACINGS) * (NEAR_IN_SPACINGS / OWN_IN_SPACINGS);
/// Number of voxels that the cell of a seed on a surface meets.
pub(super) const VOXELS_OF_A_SEED: f64 = 5.4;
/// Radius of the surroundings by which it is judged how many points are few: no more than the margin of an election.
const SURROUNDINGS_IN_SPACINGS: f64 = 8.0;

/// The numbers of points of the scan that one seed stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Represented {
    /// Those nearer to it than a spacing.
    pub(super) own: f64,
    /// Those nearer to it than half a spacing.
    pub(super) near: f64,
}

impl Represented {
    /// The points of the scan that the `seed` stands for.
    pub(super) fn by(surface: Surface<'_>, seed: Local) -> Self {
        let mut points = Self {
            own: 0.0,
            near: 0.0,
        };
        let near = NEAR_IN_SPACINGS * surface.spacing();
        visit_within(surface, seed, OWN_IN_SPACINGS, |place, count| {
            points.own += count;
            if (place - seed).norm() < near {
                points.near += count;
            }
        });
        points
    }

    /// The number of its points, by those that are near alone if that is less: the others can be those of a surface that it
    /// stands before.
    pub(super) fn fewest(self) -> f64 {
        self.own.min(self.near / NEAR_SHARE)
    }
}

/// Visits the samples of the scan nearer to `centre` than `radius` (spacings), each with its place and the number of its points.
fn visit_within(
    surface: Surface<'_>,
    centre: Local,
    radius: f64,
    mut visit: impl FnMut(Local, f64),
) {
    let radius = radius * surface.spacing();
    let samples = surface.scan.samples();
    samples.visit_around(centre, radius, |sample, place| {
        if (place - centre).norm() < radius {
            visit(place, surface.scan.points_of_sample(sample));
        }
    });
}

/// Whether `place` is one that one of the `seeds` stands for.
fn is_own(surface: Surface<'_>, seeds: &[Local], place: Local) -> bool {
    let own = OWN_IN_SPACINGS * surface.spacing();
    seeds.iter().any(|seed| (place - seed).norm() < own)
}

/// The number of points of the scan that the `seeds` stand for.
pub(super) fn own_points(surface: Surface<'_>, seeds: &[Local]) -> f64 {
    let mut points = 0.0;
    for (k, &seed) in seeds.iter().enumerate() {
        visit_within(surface, seed, OWN_IN_SPACINGS, |place, count| {
            if !is_own(surface, &seeds[..k], place) {
                points += count;
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
    // Sums of whole numbers do not depend on their order.
    let (mut sum, mut squares) = (0.0, 0.0);
    visit_within(
        surface,
        seeds[0],
        SURROUNDINGS_IN_SPACINGS,
        |place, count| {
            if !is_own(surface, seeds, place) {
                sum += count;
                squares += count * count;
            }
        },
    );
    match sum > 0.0 {
        true => squares / sum,
        false => average_points(surface) / VOXELS_OF_A_SEED,
    }
}

/// No less than [`usual_points`] of any one seed of the `block`: a mean is no more than the largest number.
pub(super) fn most_usual_points(surface: Surface<'_>, block: &Block) -> f64 {
    let [low, high] = block.corners_around(SURROUNDINGS_IN_SPACINGS * block.options.spacing);
    // As many are usual where there are none.
    let mut most = average_points(surface) / VOXELS_OF_A_SEED;
    surface.scan.samples().visit_box(low, high, |sample, _| {
        most = most.max(surface.scan.points_of_sample(sample));
    });
    most
}
