//! Coordinates, neighbours, patches and cells: pure functions, deterministic to the bit.

mod bisector;
mod bounding;
mod brick_table;
mod cell;
mod cell_index;
mod cell_order;
mod closing;
mod coordinates;
mod distinct_cells;
mod facet_samples;
mod facet_search;
mod facets;
mod grid_walk;
mod hash;
mod height_equations;
mod heights;
mod lanes;
mod layered_cells;
mod moments;
mod narrow_frame;
mod nearest;
mod neighbors;
mod occupied;
mod packing;
mod patch;
mod patch_correction;
mod patch_fit;
mod response;
mod stored_tree;
#[cfg(test)]
mod test_cells;
mod viewpoints;
mod word_sorting;

pub use bisector::Neighbor;

pub use bounding::BOUNDING_SIDES;
pub(crate) use bounding::{Reach, bounding_corners, keeps_corner};
pub use cell::Cell;
pub(crate) use cell::MOST_EDGES;
pub(crate) use cell_index::{CellIndex, cell_of};
pub(crate) use cell_order::CellOrder;
pub use coordinates::{Local, Quantization, Rect, Stored};
pub(crate) use coordinates::{MIN_STEPS_PER_SPACING, by_position, longest_side};
pub(crate) use distinct_cells::DistinctCells;
pub(crate) use facet_samples::FacetSample;
pub(crate) use facets::{Facets, SharpEdge};
pub(crate) use grid_walk::GridWalk;
pub(crate) use hash::{Dice, spread};
pub(crate) use layered_cells::LayeredCells;
pub use moments::Moments;
pub(crate) use narrow_frame::{mean_and_covariance, narrow_frame};
pub(crate) use nearest::NearestPoints;
pub use neighbors::NeighborGrid;
pub(crate) use occupied::OccupiedCells;
pub(crate) use patch::upwards;
pub use patch::{Patch, PatchKind};
pub(crate) use patch_correction::WIDE_RADIUS_IN_FIT_RADII;
pub(crate) use response::Response;
pub(crate) use stored_tree::{StoredTree, stored_distance_squared};
pub(crate) use viewpoints::{ScannerWay, Viewpoints};
pub(crate) use word_sorting::sort_words;

/// Items (points, sites) that a thread takes at a time. Their costs differ widely: with few
/// large tasks the last one leaves the other threads idle.
pub(crate) const ITEMS_PER_TASK: usize = 1024;
