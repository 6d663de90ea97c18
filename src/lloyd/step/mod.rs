//! One Lloyd step: patch, restricted Voronoi cell, centroid, projection and boundary
//! restriction of every site (paper, sections III-B, III-C, IV-B, IV-D and IV-E).

mod crowding;
mod fit;
mod following;
mod links;
mod lloyd_step;
mod neighbor_lists;
mod neighborhoods;
mod restriction;
mod samples;
mod scan_border;
mod scratch;
mod site_spacings;
mod vicinity;

pub(super) use fit::{Fit, SHEET_THICKNESS_IN_SPACINGS};
pub(super) use links::Links;
pub(super) use lloyd_step::{Iteration, Step};
pub(super) use neighborhoods::{BLOCK_EDGE_IN_SPACINGS, BLOCKS_PER_TASK, Neighborhoods};
pub use restriction::Restriction;
pub(super) use samples::Samples;
pub(super) use scan_border::lie_all_around;
pub(super) use scratch::Scratch;
pub(super) use site_spacings::SiteSpacings;
pub(super) use vicinity::{Vicinity, clearance};
