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

use super::{bricks::Bricks, election::Election, nearest_seeds::REACH_IN_SPACINGS};
use crate::geometry::{ITEMS_PER_TASK, Local, NeighborGrid, Stored, sort_words};

/// Number of times that all seeds move. On a forest (0.8 M points to 8 K) one seed in eight still moves the second
/// time, one in fifty the fifth time.
const PASSES: usize = 3;

/// No move brings two seeds nearer to each other than this, or nearer than they are. The less it is, the better the
/// points are covered, and the less even are the distances between seeds.
const CLEARANCE_IN_SPACINGS: f64 = 0.8;

/// Other seeds may be in the way of a step if they are within this radius.
const NEAR_IN_SPACINGS: f64 = 2.0;

/// Seeds farther than near are not in the way of a longer step.
const LONGEST_STEP_IN_SPACINGS: f64 = 0.5 * (NEAR_IN_SPACINGS - CLEARANCE_IN_SPACINGS);

impl Election<'_> {
    /// Moves the seeds from number `first` on, which were elected among the points of the `bricks`, to the middle of the points
    /// around them. Gives the number of the seed that is nearest to each point then; `None` if none is near.
    pub(super) fn center(&mut self, first: usize, bricks: &Bricks<'_>) -> Vec<Option<u32>> {
        let mut seeds = self.grid();
        let mut nearest = self.nearest_seeds(bricks, &seeds);
        for _ in 0..PASSES {
            let moves = self.moves(&owned(&nearest, first), bricks.points, &seeds);
            let moved: Vec<usize> = moves.iter().map(|&(number, _)| number).collect();
            for (number, to) in moves {
                self.seeds[number] = to;
            }
            seeds = self.grid();
            self.renew_nearest(&mut nearest, bricks, &seeds, &moved);
        }
        nearest
    }

    /// The numbers of the seeds that move to the middle of the points that they have `owned`, words for [`owner`], and the points
    /// that they move to. The grid is of all `seeds`.
    fn moves(
        &self,
        owned: &[u64],
        points: &[Stored],
        seeds: &NeighborGrid,
    ) -> Vec<(usize, Stored)> {
        let field = self.surface.field();
        let by_seed: Vec<&[u64]> = owned.chunk_by(|a, b| owner(*a).0 == owner(*b).0).collect();
        by_seed
            .into_par_iter()
            .with_max_len(ITEMS_PER_TASK)
            .map_init(Vec::new, |others, owned| {
                let (number, _) = owner(owned[0]);
                let position = self.local(self.seeds[number]);
                let spacing = field.at(position);
                let reach = REACH_IN_SPACINGS * spacing;
                let own = owned.iter().map(|&word| {
                    let point = points[owner(word).1];
                    (point, self.local(point))
                });
                let near = own.filter(|(_, point)| (point - position).norm() <= reach);
                Some((number, moved(position, spacing, near, seeds, others)?))
            })
            .flatten_iter()
            .collect()
    }
}

/// The points that the seeds from number `first` on stand for, by the seed that is `nearest` to each: by seed, and for each seed
/// in the order of the points. Words for [`owner`].
fn owned(nearest: &[Option<u32>], first: usize) -> Vec<u64> {
    let owned = nearest.iter().zip(0_u32..).filter_map(|(seed, index)| {
        let seed = seed.filter(|&seed| seed as usize >= first)?;
        Some(u64::from(seed) << u32::BITS | u64::from(index))
    });
    let mut owned: Vec<u64> = owned.collect();
    sort_words(&mut owned);
    owned
}

/// The number of the seed and the index of the point of a word.
fn owner(word: u64) -> (usize, usize) {
    ((word >> u32::BITS) as usize, word as u32 as usize)
}

/// Where the seed at `position` goes, which stands for the points `own`: to the one nearest to their middle, among those to
/// which it may move; `None` if no such point is nearer than the seed is. `others` is memory.
///
/// All points are its own that keep it clear of the other `seeds`, so two seeds never meet.
fn moved(
    position: Local,
    spacing: f64,
    own: impl Iterator<Item = (Stored, Local)> + Clone,
    seeds: &NeighborGrid,
    others: &mut Vec<Local>,
) -> Option<Stored> {
    // The mean of the points, each with the squared distance from the seed as its weight. With a higher power the step would be
    // too long for a wire to come to rest.
    let (mut sum, mut total) = (Local::zeros(), 0.0);
    for (_, point) in own.clone() {
        let weight = (point - position).norm_squared();
        sum += (point - position) * weight;
        total += weight;
    }
    if total == 0.0 {
        return None;
    }
    let middle = position + sum / total;
    let longest = LONGEST_STEP_IN_SPACINGS * spacing;
    let mut best = ((middle - position).norm_squared(), None);
    others.clear();
    for (point, place) in own {
        let from_middle = (place - middle).norm_squared();
        if from_middle >= best.0 || (place - position).norm_squared() > longest * longest {
            continue;
        }
        // Most seeds stay after the first round, and need no look at others.
        if others.is_empty() {
            seeds.gather(position, NEAR_IN_SPACINGS * spacing, others);
        }
        if keeps_clear(position, place - position, others, spacing) {
            best = (from_middle, Some(point));
        }
    }
    best.1
}

/// Whether a seed at `position` keeps clear of the bisector with each of the `others` by half the clearance after this `step`, or
/// does not step towards it.
fn keeps_clear(position: Local, step: Local, others: &[Local], spacing: f64) -> bool {
    let clearance = CLEARANCE_IN_SPACINGS * spacing;
    others.iter().all(|other| {
        let way = other - position;
        let distance = way.norm();
        // The seed itself is one of them, and never in the way.
        distance == 0.0 || step.dot(&way) <= 0.5 * distance * (distance - clearance).max(0.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{Quantization, spread},
        lloyd::{Scan, SolverOptions, seeds::fronts::LEFT_RADIUS_IN_SPACINGS, surface::Surface},
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

    fn places(points: &[Stored]) -> Vec<Local> {
        let place = |&point: &Stored| QUANTIZATION.local(point);
        points.iter().map(place).collect()
    }

    /// The least distance between two of `seeds`.
    fn least_distance(seeds: &[Local]) -> f64 {
        let to_those_before = |(number, seed): (usize, &Local)| {
            let before = seeds[..number].iter();
            let squared = before.map(|other| (other - seed).norm_squared());
            squared.fold(f64::INFINITY, f64::min).sqrt()
        };
        let all = seeds.iter().enumerate().map(to_those_before);
        all.fold(f64::INFINITY, f64::min)
    }

    /// A scan of points at random in a cube, as leaves are.
    fn leaves(count: u64, options: &SolverOptions) -> Scan {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let cube = |k: u64| Local::new(unit(3 * k), unit(3 * k + 1), unit(3 * k + 2));
        let points: Vec<Stored> = (0..count)
            .filter_map(|k| QUANTIZATION.stored(cube(k)))
            .collect();
        Scan::as_scanned(points, QUANTIZATION, options)
    }

    /// The election among all points of `scan`.
    fn election<'a>(scan: &'a Scan, options: &'a SolverOptions) -> Election<'a> {
        let mut election = Election::new(Surface::new(scan, options));
        election.elect_loose(&election.bricks(scan.points()), |_, _| 1.0);
        election
    }

    #[test]
    fn in_leaves_seeds_cover_the_points_better_and_keep_clear() {
        let options = SolverOptions::new(0.1);
        let scan = leaves(60_000, &options);
        let points = scan.points();
        let mut election = election(&scan, &options);
        let before = places(&election.seeds);
        election.center(0, &election.bricks(points));
        let after = places(&election.seeds);

        assert_eq!(before.len(), after.len());
        assert!(election.seeds.iter().all(|seed| points.contains(seed)));
        let clearance = CLEARANCE_IN_SPACINGS * options.spacing - 1e-9;
        assert!(least_distance(&after) >= clearance);
        let all = places(points);
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
    fn what_seeds_leave_when_they_move_is_covered_by_further_seeds() {
        let options = SolverOptions::new(0.1);
        let scan = leaves(60_000, &options);
        let mut election = election(&scan, &options);
        let bricks = election.bricks(scan.points());
        let nearest = election.center(0, &bricks);
        let left = LEFT_RADIUS_IN_SPACINGS * options.spacing;
        let farthest = |seeds: &[Stored]| {
            let distances = distances(&places(scan.points()), &places(seeds));
            distances.into_iter().fold(0.0, f64::max)
        };
        let (count, before) = (election.seeds.len(), farthest(&election.seeds));
        election.elect_left(0, scan.points(), &nearest, |_, _| 1.0);
        assert!(before > left && farthest(&election.seeds) < left);
        assert!(election.seeds.len() > count);
        assert!(least_distance(&places(&election.seeds)) >= left);
    }

    #[test]
    fn on_a_wire_a_seed_moves_to_the_middle_between_its_neighbors() {
        let at = |x: i32| Stored { x, y: 0, z: 0 };
        let points: Vec<Stored> = (0..2600).map(at).collect();
        let options = SolverOptions::new(0.1);
        let scan = Scan::as_scanned(points.clone(), QUANTIZATION, &options);
        let mut election = Election::new(Surface::new(&scan, &options));
        election.seeds = vec![at(0), at(2600), at(1000)];
        election.center(2, &election.bricks(&points));
        let moved = election.seeds[2].x;
        assert!((moved - 1300).abs() < 60, "{moved}");
        assert_eq!(election.seeds[..2], [at(0), at(2600)]);
    }
}
