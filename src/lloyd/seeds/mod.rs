//! Where the sites start: seeds elected from the scan by a local rule.
//!
//! Every seed has an *identity* that does not depend on tiles: the stored coordinates, unique,
//! of the point or node that it was elected at. Two tiles that see the same part of the scan
//! elect the same seeds there, with the same identities; the stitcher joins tiles by them.

mod area;
mod bricks;
mod centering;
mod coarse_normals;
mod dominant_normals;
mod edge_rows;
mod elected;
mod election;
mod fronts;
mod lattice;
mod nearest_seeds;
mod nodes;
mod normals;
mod rounded_normal;
mod rule;
mod seed_list;

use super::{Scan, SolverOptions, isolated::are_isolated, surface::Surface};
use crate::geometry::Rect;

pub(crate) use coarse_normals::coarse_normals;
pub use dominant_normals::DominantNormals;
pub use lattice::AREA_PER_SEED;
pub use rule::SeedRule;
use seed_list::Seeds;

/// Chooses seeds for `scan` by the rule of `options`.
pub fn elect(scan: &Scan, options: &SolverOptions) -> Seeds {
    let surface = Surface::new(scan, options);
    match options.seeds {
        SeedRule::Hexagonal | SeedRule::Poisson => {
            Seeds::at_points(scan, elected::elected(surface))
        }
        SeedRule::Random => Seeds::at_points(scan, area::random(surface)),
        SeedRule::Area => area::area_weighted(surface),
    }
}

/// Numbers of seeds in a part of a cloud.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SeedCounts {
    /// Elected seeds.
    pub(crate) elected: usize,
    /// Elected seeds that sites start at: not the isolated ones, if the options leave these out.
    pub(crate) kept: usize,
}

/// Numbers of the seeds whose points lie in `part`.
pub(crate) fn count_seeds(scan: &Scan, options: &SolverOptions, part: &Rect) -> SeedCounts {
    let surface = Surface::new(scan, options);
    let seeds = Seeds::at_points(scan, elected::elected(surface));
    let is_in_part = |seed: usize| part.contains(seeds.identities[seed]);
    let elected = (0..seeds.identities.len())
        .filter(|&seed| is_in_part(seed))
        .count();
    let is_isolated = match options.drops_isolated {
        true => are_isolated(surface, &seeds.positions, is_in_part),
        false => Vec::new(),
    };
    let left_out = is_isolated.into_iter().filter(|&is_it| is_it).count();
    SeedCounts {
        elected,
        kept: elected - left_out,
    }
}
