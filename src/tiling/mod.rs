//! How the plane is cut into tiles, by integer arithmetic alone.
mod bounds;
mod grid;
mod plan;

pub(crate) use bounds::Bounds;
pub use grid::CellGrid;
pub(crate) use grid::{CellKey, MAX_OCCUPIED_CELLS, SQUARES_PER_CELL_EDGE};
pub(crate) use plan::{Plan, PlanOptions, Square, Tile};
