//! Coordinates, neighbours, patches and cells: pure and deterministic.

mod cell;
mod coordinates;
mod neighbors;
mod patch;

pub use cell::{Cell, Moments, Neighbor};
pub use coordinates::{Lattice, Local, Rect, Stored};
pub use neighbors::{CellIndex, NeighborGrid, cell_of};
pub use patch::{Patch, PatchKind};

pub(crate) use neighbors::{pack, spread};
