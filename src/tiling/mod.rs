//! How the plane is cut, by integer arithmetic alone: cells, counting squares, tiles.
//!
//! ```text
//!   grid    the plane in cells of 8 × 8 counting squares
//!   cloud   points that are counted by square and gathered by rectangle
//!   plan    tiles along the borders of counting squares, each within a limit of its cost
//! ```
//!
//! Nothing here knows files.

mod bounds;
mod cloud;
mod grid;
mod plan;
mod square_sums;

pub(crate) use bounds::Bounds;
pub(crate) use cloud::{CloudInMemory, CountedCloud};
pub use grid::CellGrid;
pub(crate) use grid::{CellKey, MAX_OCCUPIED_CELLS, SQUARES_PER_CELL_EDGE, SquareFinder};
pub(crate) use plan::{Plan, PlanOptions, Square, Tile};
