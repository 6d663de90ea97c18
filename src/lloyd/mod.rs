//! The solver: from a scan to evenly spaced sites on its surfaces.
//!
//! Accelerated Lloyd's Method for Resampling 3D Point Clouds, Algorithm 1:
//!
//! ```text
//!   scan ──► seeds ──► ┌ patch at each site           geometry::Patch   III-B
//!                      │ restricted Voronoi cell      geometry::Cell    III-C
//!                      │ centroid                     step              IV-B
//!                      │ acceleration, checked        acceleration      IV-C
//!                      │ projection to the patch      step              IV-D
//!                      └ boundary restriction ◄─┐     step              IV-E
//!                           K times ────────────┘
//! ```
//!
//! Nothing here knows tiles except for one thing: which sites can still influence the core
//! that is wanted. Every rule uses a neighbourhood only, in an order given by the data, so two
//! tiles compute the same bits wherever both have enough of the scan.

mod acceleration;
mod blocks;
mod count;
mod course;
mod edge_rule;
mod field;
mod isolated;
mod options;
mod region;
mod resumed_sites;
mod rings;
mod round;
mod scan;
mod seeds;
mod settings;
mod site;
mod site_state;
mod sites;
mod solver;
mod step;
mod surface;
mod tally;

pub use acceleration::Acceleration;
pub(crate) use count::{Candidates, CountCorrection, WantedCount, candidate_band};
pub(crate) use edge_rule::EdgeRule;
pub use field::Grading;
pub(crate) use field::SpacingField;
pub(crate) use isolated::IsolatedRule;
pub use options::SolverOptions;
pub use region::TileRegion;
pub(crate) use resumed_sites::ResumedSites;
pub(crate) use rings::Rings;
pub use scan::Scan;
pub(crate) use scan::{PointSum, PointTag, PointsByIndex, ThinnedPoints, Thinning, VoxelPoints};
pub use seeds::{AREA_PER_SEED, DominantNormals, SeedRule, elect};
pub(crate) use seeds::{SeedCounts, coarse_normals, count_seeds};
pub(crate) use settings::SolverSettings;
pub use site::Site;
pub(crate) use site_state::SiteState;
pub(crate) use solver::{
    FirstRound, describe_points, solve_first_round, solve_last_round, solve_watched,
    solve_with_rings,
};
pub use solver::{Solution, describe_positions, solve};
pub use step::Restriction;
pub use tally::uniformity;
pub(crate) use tally::uniformity_by_surface;
