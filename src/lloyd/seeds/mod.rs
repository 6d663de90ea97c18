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

use super::{Scan, SolverOptions, surface::Surface};
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

/// Number of elected seeds whose points lie in `part`.
pub(crate) fn elected_in(scan: &Scan, options: &SolverOptions, part: &Rect) -> usize {
    elected::elected(Surface::new(scan, options))
        .into_iter()
        .filter(|&point| part.contains(point))
        .count()
}
