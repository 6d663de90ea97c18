//! The solver: from a scan to evenly spaced sites on its surfaces.
//!
//! Accelerated Lloyd's Method for Resampling 3D Point Clouds, Algorithm 1:
//!
//! ```text
//!   scan ──► seeds ──► ┌ patch at each site           geometry::Patch  III-B
//!                      │ restricted Voronoi cell      geometry::Cell   III-C
//!                      │ centroid                     step             IV-B
//!                      │ acceleration, checked        acceleration     IV-C
//!                      │ projection to the patch      step             IV-D
//!                      └ boundary restriction ◄─┐     restriction      IV-E
//!                           K times ────────────┘
//! ```
//!
//! Nothing here knows tiles but for one thing: which sites can still matter to
//! the core that is asked for. Every rule looks at a neighbourhood only, in an
//! order given by the data, so two tiles compute the same bits wherever both
//! see enough.

mod acceleration;
mod anderson;
mod around;
mod domain;
mod filling;
mod fit;
mod neighborhoods;
mod nodes;
mod relaxation;
mod restriction;
mod rings;
mod scan;
mod seeds;
mod settings;
mod smoothing;
mod solver;
mod step;
mod tally;

pub use acceleration::Acceleration;
pub use domain::TileRegion;
pub use restriction::Restriction;
pub(crate) use rings::Rings;
pub use scan::Scan;
pub(crate) use seeds::elected_in;
pub use seeds::{AREA_PER_SEED, SeedRule, elect};
pub(crate) use settings::SolverSettings;
pub use solver::DistanceSums;
pub(crate) use solver::solve_with_rings;
pub use solver::{Site, Solution, SolverOptions, describe_places, solve};
pub(crate) use solver::{describe_points, solve_watched};
pub(crate) use tally::uniformity;
