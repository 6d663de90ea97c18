//! An election: candidates become seeds one after the other, unless they are too near to a seed.

use rayon::prelude::*;

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
        let positions: Vec<Local> = self.seeds.iter().map(|&seed| self.local(seed)).collect();
        self.surface.field().grid(&positions, 1.0)
    }

    /// Elects candidates in the order of their ranks, equal ranks in the order of their
    /// priorities. A candidate within the election radius of a seed is passed over.
    pub(super) fn elect_in_order(&mut self, mut candidates: Vec<(u32, Stored)>) {
        let (field, earlier) = (self.surface.field(), self.grid());
        let radius_at = |point: Stored| ELECTION_RADIUS_IN_SPACINGS * field.at(self.local(point));
        // Earlier seeds cover most candidates.
        candidates = candidates
            .into_par_iter()
            .with_max_len(ITEMS_PER_TASK)
            .filter(|&(_, point)| !earlier.any_within(self.local(point), radius_at(point)))
            .collect();
        candidates.par_sort_unstable_by_key(|&(rank, point)| (rank, self.priority(point), point));
        let positions: Vec<Local> = candidates.iter().map(|&(_, p)| self.local(p)).collect();
        let spacings = field.at_all(&positions);
        let grid = field.grid_by(&positions, &spacings, ELECTION_RADIUS_IN_SPACINGS);
        // Of two different spacings the mean decides: it does not matter which of the two is elected first.
        let widening = field.widening(ELECTION_RADIUS_IN_SPACINGS);
        let mut is_covered = vec![false; candidates.len()];
        for (number, &(_, candidate)) in candidates.iter().enumerate() {
            if is_covered[number] {
                continue;
            }
            self.seeds.push(candidate);
            let center = positions[number];
            let reach = ELECTION_RADIUS_IN_SPACINGS * spacings[number] * widening;
            grid.visit_around(center, reach, |other, position| {
                let mean = 0.5 * (spacings[number] + spacings[other as usize]);
                let radius = ELECTION_RADIUS_IN_SPACINGS * mean;
                let squared = (position - center).norm_squared();
                is_covered[other as usize] |= squared <= radius * radius;
            });
        }
    }

    /// Elects candidates of equal rank.
    pub(super) fn elect(&mut self, candidates: impl Iterator<Item = Stored>) {
        self.elect_in_order(candidates.map(|point| (0, point)).collect());
    }
}
