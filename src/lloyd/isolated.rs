//! Isolated returns: seeds with next to nothing of the scan around them.
//!
//! Rain, birds, echoes between walls and beams that graze an edge leave points in the air. Where the output is coarser
//! than the scan, each of them becomes a site that stands for next to nothing. They are found among the seeds:
//!
//! ```text
//!     ·    ·               thin seeds, and none but thin ones linked to them, on no common plane: rain
//!   ·        ·  ·
//!        **                then a few seeds, no other linked to them, that stand for no more points
//!                          of the scan than as many seeds around them: a bird, a leaf
//!   ─*──*──*──*──*──       seeds are linked if they are hardly farther apart than those of a surface
//! ```
//!
//! Thin seeds stand for no more points than a voxel around them usually has, and for fewer than seeds do on average. So a sparse surface stays, on which thin seeds lie
//! on a plane, and a lone thing stays that was scanned more densely than what is around it. The rule looks a
//! fixed number of spacings around, so that all tiles agree.

use nalgebra::Matrix3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    options::{MANY_SEEDS, SolverOptions},
    surface::Surface,
};
use crate::geometry::{ITEMS_PER_TASK, Local, NeighborGrid, by_position, narrow_frame};

/// What becomes of isolated returns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum IsolatedRule {
    /// They become points of the output like others.
    #[default]
    Keep,
    /// They are left out.
    Drop,
    /// Their points of the output get the class 7, noise.
    Mark,
}

impl IsolatedRule {
    /// Whether this is the default, which records do not state.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// The points that a seed stands for are those nearer to it.
const OWN_IN_SPACINGS: f64 = 1.0;
/// Radius of the surroundings by which it is judged how many points are few: no more than the margin of an election.
const SURROUNDINGS_IN_SPACINGS: f64 = 8.0;
/// So few points are few however sparse the scan is around them.
const FEW_POINTS: f64 = 3.0;
/// Number of voxels that the cell of a seed on a surface meets.
const VOXELS_OF_A_SEED: f64 = 5.4;

/// A plane is that of no fewer seeds.
const FEWEST_ON_A_PLANE: usize = 5;
/// Largest standard deviation of the seeds across their plane.
const THICKEST_PLANE_IN_SPACINGS: f64 = 0.4;
/// Largest distance of a seed from the plane of those around it.
const FARTHEST_FROM_PLANE_IN_SPACINGS: f64 = 0.5;

/// Whether each of the seeds at `positions` is isolated. Those for which `matters` is false are not looked at.
pub(super) fn are_isolated(
    surface: Surface<'_>,
    positions: &[Local],
    matters: impl Fn(usize) -> bool + Sync,
) -> Vec<bool> {
    let link_at = |seed: usize| surface.options_at(positions[seed]).link();
    let of_all = |is: &(dyn Fn(usize) -> bool + Sync)| -> Vec<bool> {
        let numbers = (0..positions.len()).into_par_iter();
        numbers.with_max_len(ITEMS_PER_TASK).map(is).collect()
    };

    // Thin seeds among thin ones, however many. What is quick to find out comes first: hardly a seed of a surface is left
    // when surroundings are looked at.
    let (field, link) = (surface.field(), surface.options.link());
    let seeds = field.grid_of_edge(positions, link);
    let linked = |seed: usize| linked_to(&seeds, positions[seed], link_at(seed));
    let own: Vec<f64> = (positions.par_iter().with_max_len(ITEMS_PER_TASK))
        .map(|&seed| own_points(surface.with(&surface.options_at(seed)), &[seed]))
        .collect();
    let average = f64::max(FEW_POINTS, average_points(surface));
    let is_thin = |(seed, place): (usize, Local)| {
        let options = surface.options_at(place);
        own[seed] <= FEW_POINTS || own[seed] <= usual_points(surface.with(&options), &[place])
    };
    let adrift = of_all(&|seed| {
        linked(seed).all(|(other, _)| own[other] <= average)
            && !lies_on_a_plane(
                &seeds,
                positions[seed],
                &surface.options_at(positions[seed]),
            )
            && linked(seed).all(is_thin)
    });

    // Small groups among the others.
    let others = positions.iter().zip(&adrift);
    let others: Vec<Local> = others
        .filter_map(|(&p, &is_adrift)| (!is_adrift).then_some(p))
        .collect();
    let seeds = field.grid_of_edge(&others, link);
    of_all(&|seed| {
        let is_in_a_small_group = || {
            let options = surface.options_at(positions[seed]);
            linked_seeds(&seeds, positions[seed], options.link())
                .is_some_and(|group| !are_dense(surface.with(&options), &group))
        };
        matters(seed) && (adrift[seed] || is_in_a_small_group())
    })
}

/// Whether the seed at `position` lies on a plane through the seeds around it.
fn lies_on_a_plane(seeds: &NeighborGrid, position: Local, options: &SolverOptions) -> bool {
    let around = linked_to(seeds, position, options.plane_radius());
    let mut steps: Vec<Local> = around.map(|(_, seed)| seed - position).collect();
    // The order in which seeds are found depends on the tile, and rounding on the order.
    steps.sort_unstable_by(by_position);
    if steps.len() < FEWEST_ON_A_PLANE {
        return false;
    }
    let mean = steps.iter().sum::<Local>() / steps.len() as f64;
    let square = |step: &Local| (step - mean) * (step - mean).transpose();
    let covariance = steps.iter().map(square).sum::<Matrix3<f64>>() / steps.len() as f64;
    let Some((spread, axes)) = narrow_frame(covariance) else {
        // They lie on a line, or are spread alike in all directions.
        return covariance.norm() > 0.9 * covariance.trace();
    };
    let (thickness, distance) = (spread[2].sqrt(), axes[2].dot(&mean).abs());
    thickness < THICKEST_PLANE_IN_SPACINGS * options.spacing
        && distance < FARTHEST_FROM_PLANE_IN_SPACINGS * options.spacing
}

/// The seeds within `link` of `position`, one at the position among them.
fn linked_to(
    seeds: &NeighborGrid,
    position: Local,
    link: f64,
) -> impl Iterator<Item = (usize, Local)> {
    let mut found = Vec::new();
    seeds.visit_around(position, link, |seed, place| {
        if (place - position).norm_squared() <= link * link {
            found.push((seed as usize, place));
        }
    });
    found.into_iter()
}

/// The seeds that belong to the one at `position`, itself among them; `None` if they are many.
fn linked_seeds(seeds: &NeighborGrid, position: Local, link: f64) -> Option<Vec<Local>> {
    let mut linked = vec![position];
    let mut next = 0;
    while next < linked.len() {
        for (_, seed) in linked_to(seeds, linked[next], link) {
            if !linked.contains(&seed) {
                linked.push(seed);
            }
        }
        if linked.len() >= MANY_SEEDS {
            return None;
        }
        next += 1;
    }
    Some(linked)
}

/// Whether the `linked` seeds stand for more points than as many seeds around them.
fn are_dense(surface: Surface<'_>, linked: &[Local]) -> bool {
    let many = (MANY_SEEDS - 1) as f64 * VOXELS_OF_A_SEED;
    own_points(surface, linked) > f64::max(FEW_POINTS, many * usual_points(surface, linked))
}

/// Whether `place` is one that one of the `seeds` stands for.
fn is_own(surface: Surface<'_>, seeds: &[Local], place: Local) -> bool {
    let own = OWN_IN_SPACINGS * surface.spacing();
    seeds.iter().any(|seed| (place - seed).norm() < own)
}

/// The number of points of the scan that the `seeds` stand for.
fn own_points(surface: Surface<'_>, seeds: &[Local]) -> f64 {
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
fn average_points(surface: Surface<'_>) -> f64 {
    1.0 / surface.options.seeds_per_point
}

/// The number of points that voxels around the `seeds` usually have: the mean over the points, not over the voxels, which
/// is that of dense surfaces amid sparse clutter.
fn usual_points(surface: Surface<'_>, seeds: &[Local]) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Quantization, Stored, spread},
        lloyd::{Scan, elect},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 1e-4,
        offset: [0.0; 3],
    };

    /// Places even in a cube of the edge `edge` over the origin.
    fn even(count: u64, edge: f64) -> impl Iterator<Item = Local> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        (0..count).map(move |k| Local::new(unit(3 * k), unit(3 * k + 1), unit(3 * k + 2)) * edge)
    }

    /// The seeds of a scan with `places`, each with whether it is isolated.
    fn judged(places: Vec<Local>) -> Vec<(Local, bool)> {
        let options = SolverOptions {
            seeds_per_point: 0.02,
            ..SolverOptions::new(0.1)
        };
        let points: Vec<Stored> = (places.iter())
            .filter_map(|&p| QUANTIZATION.stored(p))
            .collect();
        let scan = Scan::new(points, QUANTIZATION, &options);
        let seeds = elect(&scan, &options).positions;
        let surface = Surface::new(&scan, &options);
        let isolated = are_isolated(surface, &seeds, |_| true);
        seeds.into_iter().zip(isolated).collect()
    }

    fn floor() -> impl Iterator<Item = Local> {
        even(40_000, 3.0).map(|p| Local::new(p.x, p.y, 0.001 * p.z))
    }

    #[test]
    fn a_floor_has_no_isolated_seeds() {
        let judged = judged(floor().collect());
        assert!(judged.len() > 800 && judged.iter().all(|&(_, is_isolated)| !is_isolated));
    }

    #[test]
    fn rain_is_isolated_and_what_it_falls_on_is_not() {
        let rain = even(600, 3.0).filter(|p| p.z > 0.05);
        let judged = judged(floor().chain(rain).collect());
        let share = |is_part: &dyn Fn(f64) -> bool| {
            let part = judged.iter().filter(|(place, _)| is_part(place.z));
            let (all, isolated) = part.fold((0, 0), |(all, isolated), (_, is_isolated)| {
                (all + 1, isolated + usize::from(*is_isolated))
            });
            f64::from(isolated as u32) / f64::from(all.max(1))
        };
        assert!(share(&|z| z > 0.15) > 0.97, "{}", share(&|z| z > 0.15));
        assert!(share(&|z| z < 0.05) == 0.0);
    }

    #[test]
    fn a_bird_is_isolated_and_a_lamp_that_was_scanned_more_densely_is_not() {
        let small = |count, at: Local| even(count, 0.08).map(move |p| p + at);
        let bird = small(40, Local::new(1.0, 1.0, 1.0));
        let lamp = small(2_000, Local::new(2.0, 2.0, 1.0));
        let judged = judged(floor().chain(bird).chain(lamp).collect());
        let high = judged.iter().filter(|(place, _)| place.z > 0.5);
        let (birds, lamps): (Vec<_>, Vec<_>) = high.partition(|(place, _)| place.x < 1.5);
        assert!(!birds.is_empty() && birds.iter().all(|(_, is_isolated)| *is_isolated));
        assert!(!lamps.is_empty() && lamps.iter().all(|(_, is_isolated)| !is_isolated));
    }

    #[test]
    fn a_sparse_wall_behind_a_dense_floor_stays() {
        // A point to the cell of a seed, as rain has.
        let wall = even(900, 3.0).map(|p| Local::new(p.x, 3.3, 0.3 + p.z));
        let judged = judged(floor().chain(wall).collect());
        let on_wall: Vec<_> = judged.iter().filter(|(place, _)| place.y > 3.2).collect();
        let isolated = on_wall
            .iter()
            .filter(|(_, is_isolated)| *is_isolated)
            .count();
        assert!(
            on_wall.len() > 300 && 20 * isolated < on_wall.len(),
            "{isolated} of {}",
            on_wall.len()
        );
    }
}
