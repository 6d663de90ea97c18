//! Coordinates, neighbours, patches and cells: pure and deterministic.

mod bisector;
mod cell;
mod coordinates;
mod nearest;
mod neighbors;
mod occupied;
mod patch;
mod response;

pub use bisector::Neighbor;

pub use cell::{BOUNDING_SIDES, Cell, Moments};
pub(crate) use cell::{MOST_EDGES, Reach, bounding_corners};
pub use coordinates::{Local, Quantization, Rect, Stored};
pub(crate) use nearest::NearestPoints;
pub use neighbors::NeighborGrid;
pub(crate) use occupied::{CellIndex, OccupiedCells, cell_of};
pub use patch::{Patch, PatchKind};
pub(crate) use response::Response;

pub(crate) use occupied::spread;

/// Places that a thread takes at once. What they cost differs widely: of few large parts the
/// last leaves the other threads idle.
pub(crate) const AT_ONCE: usize = 1024;
