//! Seeds where nothing is a surface move to the middle of the points that they stand for.
//!
//! An election puts every seed next to others, and leaves gaps between them. No patch leads to
//! the centroid of a cell there, but the points of the scan do:
//!
//! ```text
//!    ·  · o ·│·  ·       o   seed                 the points that are nearer to the seed than to any other
//!      ·  x  │ · o       x   mean of its points   are its own; it moves to the point nearest to their mean
//!     ·  ·  ·│·                                   that keeps clear of other seeds
//! ```
//!
//! Points far from the seed weigh more: they are the ones that are covered badly. This is Lloyd's method
//! on the points themselves. In leaves and on wires the iterations leave the seeds where they are then.

use rayon::prelude::*;

use super::election::Election;
use crate::geometry::{ITEMS_PER_TASK, Local, Neighbor, NeighborGrid, Stored};

/// Number of times that all seeds move. On a forest (0.8 M points to 8 K) one seed in eight still moves the second
/// time, one in fifty the fifth time.
const ROUNDS: usize = 3;

/// No move brings two seeds nearer to each other than this, or nearer than they are. The less it is, the better the
/// points are covered, and the less even are the distances between seeds.
const CLEARANCE_IN_SPACINGS: f64 = 0.8;

/// Radius of the points that a seed may stand for.
const REACH_IN_SPACINGS: f64 = 1.0;

/// Other seeds that may be nearer to one of these points are within this radius.
const NEAR_IN_SPACINGS: f64 = 2.0 * REACH_IN_SPACINGS;

/// Seeds farther than near are not in the way of a longer step.
const LONGEST_STEP_IN_SPACINGS: f64 = 0.5 * (NEAR_IN_SPACINGS - CLEARANCE_IN_SPACINGS);

/// Allowance for rounding in comparisons of squared distances, as a share of them.
const ROUNDING: f64 = 1e-9;

/// Edge of the cells in which points are looked up.
const POINT_CELL_IN_SPACINGS: f64 = 0.5;

impl Election<'_> {
    /// Moves the seeds from number `first` on, which were elected among `points`, to the middle of
    /// the points around them.
    pub(super) fn center(&mut self, first: usize, points: &[Stored]) {
        let field = self.surface.field();
        let positions: Vec<Local> = points.par_iter().map(|&point| self.local(point)).collect();
        let by_cell = field.grid(&positions, POINT_CELL_IN_SPACINGS);
        for _ in 0..ROUNDS {
            let seeds = self.grid();
            let moves: Vec<Option<u32>> = self.seeds[first..]
                .par_iter()
                .with_max_len(ITEMS_PER_TASK)
                .map_init(Surroundings::default, |around, &seed| {
                    let seed = self.local(seed);
                    let spacing = field.at(seed);
                    around.gather(seed, &seeds, &by_cell, spacing);
                    let middle = around.middle()?;
                    around.nearest_to(middle, spacing)
                })
                .collect();
            for (seed, to) in self.seeds[first..].iter_mut().zip(moves) {
                *seed = to.map_or(*seed, |point| points[point as usize]);
            }
        }
    }
}

/// What is around a seed.
#[derive(Default)]
struct Surroundings {
    seed: Local,
    /// The other seeds that are near, nearest first.
    others: Vec<Neighbor>,
    /// The points within reach, with their indices and their squared distances from the seed (CRS units squared), in
    /// an order that is the same in all tiles.
    points: Vec<(u32, Local, f64)>,
}

impl Surroundings {
    /// Gathers what is around `seed`, one of the `seeds`.
    fn gather(&mut self, seed: Local, seeds: &NeighborGrid, points: &NeighborGrid, spacing: f64) {
        self.seed = seed;
        seeds.find_neighbors(seed, NEAR_IN_SPACINGS * spacing, &mut self.others);
        let reach = REACH_IN_SPACINGS * spacing;
        self.points.clear();
        points.visit_around(seed, reach, |index, point| {
            let squared = (point - seed).norm_squared();
            if squared <= reach * reach {
                self.points.push((index, point, squared));
            }
        });
    }

    /// Leaves the seed's own points, and returns their mean, each with its squared distance from the seed as its weight;
    /// `None` if all of them are where the seed is.
    fn middle(&mut self) -> Option<Local> {
        let (mut sum, mut total) = (Local::zeros(), 0.0);
        let others = &self.others;
        self.points.retain(|&(_, point, squared)| {
            // No seed is nearer to the point that is more than twice as far from this one as the point.
            let farthest = 4.0 * squared * (1.0 + ROUNDING);
            let mut near = others
                .iter()
                .take_while(|other| other.distance_squared <= farthest);
            let is_own = near.all(|other| (other.position - point).norm_squared() >= squared);
            if is_own {
                sum += (point - self.seed) * squared;
                total += squared;
            }
            is_own
        });
        (total > 0.0).then(|| self.seed + sum / total)
    }

    /// The index of the own point nearest to `middle` to which the seed may move, since all points that keep it clear of the
    /// others are its own; `None` if no such point is nearer than the seed is.
    fn nearest_to(&self, middle: Local, spacing: f64) -> Option<u32> {
        let longest = LONGEST_STEP_IN_SPACINGS * spacing;
        let mut nearest = ((middle - self.seed).norm_squared(), None);
        for &(index, point, squared) in &self.points {
            let from_middle = (point - middle).norm_squared();
            let is_better = from_middle < nearest.0 && squared <= longest * longest;
            if is_better && self.keeps_clear(point - self.seed, spacing) {
                nearest = (from_middle, Some(index));
            }
        }
        nearest.1
    }

    /// Whether the seed keeps clear of the bisector with every other one by half the clearance after this `step`, or does
    /// not step towards it.
    fn keeps_clear(&self, step: Local, spacing: f64) -> bool {
        let clearance = CLEARANCE_IN_SPACINGS * spacing;
        self.others.iter().all(|other| {
            let distance = other.distance_squared.sqrt();
            let along = step.dot(&(other.position - self.seed)) / distance;
            along <= 0.5 * (distance - clearance).max(0.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Quantization, spread},
        lloyd::{Scan, SolverOptions, surface::Surface},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 1e-4,
        offset: [0.0; 3],
    };

    /// Distances from each of `positions` to the nearest of `seeds`.
    fn distances(positions: &[Local], seeds: &[Local]) -> Vec<f64> {
        let nearest = |position: &Local| {
            let squared = seeds.iter().map(|seed| (seed - position).norm_squared());
            squared.fold(f64::INFINITY, f64::min).sqrt()
        };
        positions.iter().map(nearest).collect()
    }

    #[test]
    fn in_leaves_seeds_cover_the_points_better_and_keep_clear() {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let cube = |k: u64| Local::new(unit(3 * k), unit(3 * k + 1), unit(3 * k + 2));
        let points: Vec<Stored> = (0..60_000)
            .filter_map(|k| QUANTIZATION.stored(cube(k)))
            .collect();
        let options = SolverOptions::new(0.1);
        let scan = Scan::as_scanned(points.clone(), QUANTIZATION, &options);
        let mut election = Election::new(Surface::new(&scan, &options));
        election.elect_loose(&points, |_, _| 1.0);
        let places = |seeds: &[Stored]| -> Vec<Local> {
            seeds.iter().map(|&seed| QUANTIZATION.local(seed)).collect()
        };
        let before = places(&election.seeds);
        election.center(0, &points);
        let after = places(&election.seeds);

        assert_eq!(before.len(), after.len());
        assert!(election.seeds.iter().all(|seed| points.contains(seed)));
        let clearance = CLEARANCE_IN_SPACINGS * options.spacing - 1e-9;
        for (number, seed) in after.iter().enumerate() {
            let others = &after[..number];
            assert!(
                others
                    .iter()
                    .all(|other| (other - seed).norm() >= clearance)
            );
        }
        let all = places(&points);
        let uncovered = |seeds: &[Local]| {
            let mut distances = distances(&all, seeds);
            distances.sort_by(f64::total_cmp);
            let squares = distances.iter().map(|d| d * d).sum::<f64>();
            (distances[distances.len() / 100 * 99], squares)
        };
        let [(far, squares), (far_after, squares_after)] = [&before, &after].map(|s| uncovered(s));
        assert!(far_after < 0.99 * far, "{far_after} {far}");
        assert!(squares_after < 0.985 * squares, "{squares_after} {squares}");
    }

    #[test]
    fn on_a_wire_a_seed_moves_to_the_middle_between_its_neighbors() {
        let at = |x: i32| Stored { x, y: 0, z: 0 };
        let points: Vec<Stored> = (0..2600).map(at).collect();
        let options = SolverOptions::new(0.1);
        let scan = Scan::as_scanned(points.clone(), QUANTIZATION, &options);
        let mut election = Election::new(Surface::new(&scan, &options));
        election.seeds = vec![at(0), at(2600), at(1000)];
        election.center(2, &points);
        let moved = election.seeds[2].x;
        assert!((moved - 1300).abs() < 60, "{moved}");
        assert_eq!(election.seeds[..2], [at(0), at(2600)]);
    }
}
