//! An election: candidates become seeds one after the other, unless they are too near to a seed.

use rayon::prelude::*;

use super::lattice::AREA_PER_SEED;
use crate::{
    geometry::{ITEMS_PER_TASK, Local, NeighborGrid, Stored},
    lloyd::surface::Surface,
};

/// Radius of the Poisson-disk election.
///
/// Random sequential addition of discs of diameter `r` jams at a covered share
/// of 0.547 (Feder, *Random sequential adsorption*, 1980), which is 0.697 / r²
/// seeds to the unit of area; the hexagonal lattice of spacing h has
/// 2 / (√3 h²). They would agree at r = 0.777 h; a scan of some thirty points
/// to the seed has no point in the last gaps, and agrees at 0.745 h (measured
/// on a sheet, see the test `the_election_meets_the_density`).
pub(super) const ELECTION_RADIUS_IN_SPACINGS: f64 = 0.745;

/// Radius of the election of nodes on sharp edges, and the distance that nodes on surfaces keep from them. With 0.7 there are too few
/// sites beside an edge: on a simulated street 1.48 % of the triangles had an angle below 38° with it, 1.40 % with this.
pub(super) const EDGE_RADIUS_IN_SPACINGS: f64 = 0.65;

/// Radius of the election of nodes on surfaces that are trusted fully. Between two lattices a gap of up to a row is left beyond it:
/// with a wider radius gaps are too wide on the mean, and points of the scan fill them with defects. With a narrower one some
/// sites stay nearer to each other than those of a surface are.
pub(super) const NODE_RADIUS_IN_SPACINGS: f64 = 0.7;

/// Radius of the election of points between nodes: the iterations close a gap that is narrower. On a simulated street of
/// 5 M points (100 K sites) 92.8 % of the sites have six neighbours with the election radius, 93.2 % with this one.
pub(super) const GAP_RADIUS_IN_SPACINGS: f64 = 0.8;

/// Radius of the election of positions of the filling. They are half a spacing apart, and so few in a small part that with the
/// radius of other gaps too few seeds stand there. On the scan of a simulated tripod, 95 K points without isolated returns, 367 sites
/// are farther than 1.3 mean distances from the next with this radius, and 392 with that of other gaps.
pub(super) const FILLING_RADIUS_IN_SPACINGS: f64 = 0.65;

/// The share of its radius with which an election among points of a scan, of which there are `count` to a seed, is as dense as it has
/// to be.
///
/// The fewer points there are, the larger are the gaps that none of them can fill. Of random points on a plane 3 to 7 % more seeds
/// are elected than wanted; of scans some gaps are larger: on a simulated street, by curvature, cells where the spacing grows
/// have the wanted edge within 1.5 % in the median.
pub(super) fn radius_share(count: f64) -> f64 {
    (1.043 * (1.0 - 0.48 * count.powf(-0.55))).min(1.0)
}

/// No share of a radius is less where points are few: leaves, too, have few points to the area of a seed, and seeds there would stand
/// much nearer to each other than with one spacing. On an airborne scan with 4 points to a seed, of which a rule wants 0.5 m everywhere,
/// points are at least 0.34 m apart and 7 % more than with that spacing; without a bound 6.9 % of them were nearer than 0.35 m, down to 0.14 m,
/// and there were 21 % more.
const LEAST_SHARE: f64 = 0.9;

/// Radius of the disc in which candidates are counted (spacings): it has the area of 3.6 seeds.
const COUNTED_IN_SPACINGS: f64 = 1.0;

/// The seeds elected so far.
pub(super) struct Election<'a> {
    pub(super) surface: Surface<'a>,
    pub(super) seeds: Vec<Stored>,
}

impl<'a> Election<'a> {
    /// An election on `surface` without seeds.
    pub(super) fn new(surface: Surface<'a>) -> Self {
        Self {
            surface,
            seeds: Vec::new(),
        }
    }

    /// The position of `point` (local coordinates).
    pub(super) fn local(&self, point: Stored) -> Local {
        self.surface.quantization().local(point)
    }

    /// The priority of `point`; the lowest comes first.
    pub(super) fn priority(&self, point: Stored) -> u64 {
        point.priority(self.surface.options.seed)
    }

    /// The seeds so far, by cell.
    pub(super) fn grid(&self) -> NeighborGrid {
        self.grid_of_first(self.seeds.len())
    }

    /// The first `count` seeds, by cell.
    pub(super) fn grid_of_first(&self, count: usize) -> NeighborGrid {
        let seeds = self.seeds[..count].iter();
        let positions: Vec<Local> = seeds.map(|&seed| self.local(seed)).collect();
        self.surface.field().grid(&positions, 1.0)
    }

    /// The `candidates` without a seed within the mean of `radius` (spacings) and the share of it that `share_at` gives for their
    /// positions and spacings (CRS units).
    pub(super) fn clear_of_seeds(
        &self,
        candidates: Vec<(u32, Stored)>,
        radius: f64,
        share_at: impl Fn(Local, f64) -> f64 + Sync,
    ) -> Vec<(u32, Stored)> {
        let (field, seeds) = (self.surface.field(), self.grid());
        candidates
            .into_par_iter()
            .with_max_len(ITEMS_PER_TASK)
            .filter(|&(_, point)| {
                let position = self.local(point);
                let spacing = field.at(position);
                let mean = 0.5 * (radius + radius * share_at(position, spacing));
                !seeds.any_within(position, mean * spacing)
            })
            .collect()
    }

    /// Elects candidates in the order of their ranks, equal ranks in the order of their
    /// priorities. A candidate within `radius` (spacings) of a seed is passed over.
    pub(super) fn elect_in_order(&mut self, candidates: Vec<(u32, Stored)>, radius: f64) {
        self.elect_apart(candidates, radius, |_, _| 1.0);
    }

    /// Elects candidates of equal rank, each at least `radius` (spacings) from all seeds.
    pub(super) fn elect(&mut self, candidates: impl Iterator<Item = Stored>, radius: f64) {
        self.elect_in_order(candidates.map(|point| (0, point)).collect(), radius);
    }

    /// Elects `points` of the scan, all of equal rank, with the share of the radius that `share_at` gives.
    pub(super) fn elect_points(
        &mut self,
        points: &[Stored],
        share_at: impl Fn(Local, f64) -> f64 + Sync,
    ) {
        let candidates = points.iter().map(|&point| (0, point)).collect();
        self.elect_apart(candidates, ELECTION_RADIUS_IN_SPACINGS, share_at);
    }

    /// The share of its radius with which an election among the points of the scan is as dense as it has to be, at a position
    /// with a spacing (CRS units). Where the spacing is the same everywhere lattices cover the surfaces, and it is 1.
    pub(super) fn radius_shares(&self) -> impl Fn(Local, f64) -> f64 + Sync + use<> {
        let field = self.surface.field();
        let grid = (!field.is_constant()).then(|| {
            let points = self.surface.scan.points().par_iter();
            let positions: Vec<Local> = points.map(|&point| self.local(point)).collect();
            field.grid(&positions, COUNTED_IN_SPACINGS)
        });
        move |position, spacing| match &grid {
            None => 1.0,
            Some(grid) => radius_share(points_to_a_seed(grid, position, spacing)).max(LEAST_SHARE),
        }
    }

    /// Elects candidates in the order of their ranks, equal ranks in the order of their priorities. Two of them stand apart by
    /// the mean of the shares of `radius` (spacings) that `share_at` gives for their positions and spacings (CRS units), at most 1:
    /// it does not matter which of the two is elected first.
    fn elect_apart(
        &mut self,
        candidates: Vec<(u32, Stored)>,
        radius: f64,
        share_at: impl Fn(Local, f64) -> f64 + Sync,
    ) {
        // Earlier seeds cover most candidates.
        let field = self.surface.field();
        let mut candidates = self.clear_of_seeds(candidates, radius, &share_at);
        candidates.par_sort_unstable_by_key(|&(rank, point)| (rank, self.priority(point), point));
        let positions: Vec<Local> = candidates.iter().map(|&(_, p)| self.local(p)).collect();
        let spacings = field.at_all(&positions);
        let places = positions
            .par_iter()
            .zip(&spacings)
            .with_max_len(ITEMS_PER_TASK);
        let own_radius = |(&position, &spacing)| radius * share_at(position, spacing) * spacing;
        let radii: Vec<f64> = places.map(own_radius).collect();
        let grid = field.grid_by(&positions, &spacings, radius);
        let widening = field.widening(radius);
        let mut is_covered = vec![false; candidates.len()];
        for (number, &(_, candidate)) in candidates.iter().enumerate() {
            if is_covered[number] {
                continue;
            }
            self.seeds.push(candidate);
            let center = positions[number];
            let reach = radius * spacings[number] * widening;
            grid.visit_around(center, reach, |other, position| {
                let radius = 0.5 * (radii[number] + radii[other as usize]);
                let squared = (position - center).norm_squared();
                is_covered[other as usize] |= squared <= radius * radius;
            });
        }
    }
}

/// The number of the points of `grid` to the area of a seed around `position`, where the spacing is `spacing` (CRS units).
fn points_to_a_seed(grid: &NeighborGrid, position: Local, spacing: f64) -> f64 {
    let radius = COUNTED_IN_SPACINGS * spacing;
    let mut count = 0.0;
    grid.visit_around(position, radius, |_, point| {
        if (point - position).norm_squared() <= radius * radius {
            count += 1.0;
        }
    });
    let seeds = std::f64::consts::PI * COUNTED_IN_SPACINGS * COUNTED_IN_SPACINGS / AREA_PER_SEED;
    count / seeds
}
