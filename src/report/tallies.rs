//! The figures of all tiles in one sum.

use crate::{
    job::Outcome,
    quality::{DistanceTally, SumsBySurroundings, UniformityTally},
};

/// The figures of all tiles, added in the order of the plan.
pub(super) struct TileTallies {
    /// Nearest distances among sampled points of the input.
    pub(super) input: UniformityTally,
    /// Uniformity of the seeds.
    pub(super) seeds: UniformityTally,
    /// Uniformity of the sites where the scan describes a surface.
    pub(super) on_surfaces: UniformityTally,
    /// Uniformity of the other sites.
    pub(super) elsewhere: UniformityTally,
    /// Distances from sites to the input.
    pub(super) accuracy: DistanceTally,
    /// Distances from points of the input to the sites.
    pub(super) coverage: DistanceTally,
    /// Sums of nearest distances, iteration by iteration.
    pub(super) convergence: Vec<SumsBySurroundings>,
    /// The number of sites.
    pub(super) count: u64,
    /// The number of sites that stayed at the position of their seed.
    pub(super) fixed: u64,
    /// The number of sites whose tile contained every point that they depend on.
    pub(super) exact: u64,
}

impl TileTallies {
    /// Adds the figures of the tiles of `outcome`.
    pub(super) fn of(outcome: &Outcome) -> Self {
        let spacing = outcome.plan.spacing;
        let uniformity = || UniformityTally::new(spacing);
        let distances = || DistanceTally::new(spacing);
        let mut sum = Self {
            input: uniformity(),
            seeds: uniformity(),
            on_surfaces: uniformity(),
            elsewhere: uniformity(),
            accuracy: distances(),
            coverage: distances(),
            convergence: Vec::new(),
            count: 0,
            fixed: 0,
            exact: 0,
        };
        for tile in &outcome.tiles {
            sum.input.add(&tile.input);
            sum.seeds.add(&tile.seeds);
            sum.on_surfaces.add(&tile.on_surfaces);
            sum.elsewhere.add(&tile.elsewhere);
            sum.accuracy.add(&tile.accuracy);
            sum.coverage.add(&tile.coverage);
            let iterations = tile.convergence.len().max(sum.convergence.len());
            sum.convergence
                .resize(iterations, SumsBySurroundings::default());
            for (sum, part) in sum.convergence.iter_mut().zip(&tile.convergence) {
                sum.add(part);
            }
            sum.count += tile.sites;
            sum.fixed += tile.fixed;
            sum.exact += tile.exact;
        }
        sum
    }
}
