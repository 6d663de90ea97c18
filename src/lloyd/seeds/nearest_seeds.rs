//! Which seed is nearest to each point of the scan, and what of that changes when a few seeds move.

use super::{
    bricks::{Brick, Bricks, ROUNDING},
    election::Election,
};
use crate::geometry::{Local, NeighborGrid, Stored, by_position};

/// A seed is near a point within this radius.
pub(super) const REACH_IN_SPACINGS: f64 = 1.0;

impl Election<'_> {
    /// For each point of the `bricks` the number of the nearest of all `seeds`; `None` if none is near.
    pub(super) fn nearest_seeds(
        &self,
        bricks: &Bricks<'_>,
        seeds: &NeighborGrid,
    ) -> Vec<Option<u32>> {
        self.by_brick(bricks, seeds, REACH_IN_SPACINGS, |brick| {
            let places = brick.points.iter().map(|&point| self.local(point));
            places.map(|place| nearest_of(place, &brick)).collect()
        })
    }

    /// Renews the seeds that were `nearest` to the points of the `bricks` before those with the numbers `moved` came where all
    /// `seeds` are now.
    pub(super) fn renew_nearest(
        &self,
        nearest: &mut [Option<u32>],
        bricks: &Bricks<'_>,
        seeds: &NeighborGrid,
        moved: &[usize],
    ) {
        if moved.is_empty() {
            return;
        }
        let places: Vec<Local> = moved.iter().map(|&n| self.local(self.seeds[n])).collect();
        let moved_seeds = self.surface.field().grid(&places, REACH_IN_SPACINGS);
        let mut has_moved = vec![false; self.seeds.len()];
        moved.iter().for_each(|&number| has_moved[number] = true);

        // Another seed is nearest only if the former one has moved, or one that has moved is as near.
        let known = &*nearest;
        let outdated = self.by_brick(bricks, &moved_seeds, REACH_IN_SPACINGS, |brick| {
            let is_outdated = |&index: &usize| {
                let seed = known[index].filter(|&seed| !has_moved[seed as usize]);
                seed.is_none_or(|seed| {
                    let place = self.local(bricks.points[index]);
                    let squared = (self.local(self.seeds[seed as usize]) - place).norm_squared();
                    let mut moved = brick.seeds.iter();
                    moved.any(|seed| (seed.position - place).norm_squared() <= squared)
                })
            };
            brick.range.clone().filter(is_outdated).collect()
        });

        let their_points: Vec<Stored> = outdated.iter().map(|&k| bricks.points[k]).collect();
        let renewed = self.nearest_seeds(&self.bricks(&their_points), seeds);
        for (index, seed) in outdated.into_iter().zip(renewed) {
            nearest[index] = seed;
        }
    }
}

/// The number of the seed of `brick` that is nearest to `place`; of equally near ones that which comes first by its position.
fn nearest_of(place: Local, brick: &Brick<'_>) -> Option<u32> {
    let from_middle = (place - brick.middle).norm();
    let (mut best, mut nearest, mut farthest) = (f64::INFINITY, None, f64::INFINITY);
    for seed in brick.seeds {
        // This seed cannot be nearer than the best, nor can those that follow: they are farther from the middle.
        if seed.from_middle > farthest {
            break;
        }
        let squared = (seed.position - place).norm_squared();
        let is_first = |other: Local| by_position(&seed.position, &other).is_lt();
        if squared < best || squared == best && nearest.is_some_and(|(_, other)| is_first(other)) {
            (best, nearest) = (squared, Some((seed.number, seed.position)));
            farthest = (from_middle + squared.sqrt()) * (1.0 + ROUNDING);
        }
    }
    nearest.map(|(number, _)| number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Quantization, spread},
        lloyd::{Scan, SolverOptions, surface::Surface},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 1e-2,
        offset: [0.0; 3],
    };

    /// The slow twin compares every point with every seed. On a coarse lattice many seeds are equally near.
    #[test]
    fn points_know_their_nearest_seeds_before_and_after_some_move() {
        let options = SolverOptions::new(0.1);
        let at = |k: u64, axis: u64| (spread(3 * k + axis) % 60) as i32;
        let points: Vec<Stored> = (0..6000)
            .map(|k| Stored {
                x: at(k, 0),
                y: at(k, 1),
                z: at(k, 2),
            })
            .collect();
        let scan = Scan::as_scanned(points, QUANTIZATION, &options);
        let points = scan.points();
        let mut election = Election::new(Surface::new(&scan, &options));
        election.seeds = points.iter().copied().step_by(20).collect();

        let twin = |election: &Election<'_>| -> Vec<Option<u32>> {
            let squared =
                |a: Stored, b: Stored| (election.local(a) - election.local(b)).norm_squared();
            let reach = REACH_IN_SPACINGS * 0.1;
            let nearest = |&point: &Stored| {
                let seeds = (0..).zip(&election.seeds);
                let (number, seed) = seeds.min_by(|&(_, &a), &(_, &b)| {
                    let by_distance = squared(point, a).total_cmp(&squared(point, b));
                    by_distance.then_with(|| by_position(&election.local(a), &election.local(b)))
                })?;
                (squared(point, *seed) <= reach * reach).then_some(number)
            };
            points.iter().map(nearest).collect()
        };
        // Seeds that are not near may be found, or not.
        let agree = |election: &Election<'_>, nearest: &[Option<u32>]| {
            let twin = twin(election);
            let known = twin.iter().zip(nearest).filter(|(twin, _)| twin.is_some());
            assert!(known.clone().count() > 3000);
            known.for_each(|(twin, found)| assert_eq!(twin, found));
        };
        let bricks = election.bricks(points);
        let mut nearest = election.nearest_seeds(&bricks, &election.grid());
        agree(&election, &nearest);
        let moved: Vec<usize> = (0..election.seeds.len()).step_by(9).collect();
        for &number in &moved {
            election.seeds[number].x += 4;
        }
        election.renew_nearest(&mut nearest, &bricks, &election.grid(), &moved);
        agree(&election, &nearest);
    }
}
