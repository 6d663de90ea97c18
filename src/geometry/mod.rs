//! Coordinates, neighbours, patches and cells: pure and deterministic.

mod bisector;
mod cell;
mod coordinates;
mod hash;
mod nearest;
mod neighbors;
mod occupied;
mod patch;
mod response;

pub use bisector::Neighbor;

pub use cell::{BOUNDING_SIDES, Cell, Moments};
pub(crate) use cell::{MOST_EDGES, Reach, bounding_corners};
pub use coordinates::{Local, Quantization, Rect, Stored};
pub(crate) use hash::{Dice, spread};
pub(crate) use nearest::NearestPoints;
pub use neighbors::NeighborGrid;
pub(crate) use occupied::{CellIndex, OccupiedCells, cell_of};
pub use patch::{Patch, PatchKind};
pub(crate) use response::Response;

/// Items (points, sites) that a thread takes at a time. Their costs differ widely: with few
/// large tasks the last one leaves the other threads idle.
pub(crate) const ITEMS_PER_TASK: usize = 1024;
