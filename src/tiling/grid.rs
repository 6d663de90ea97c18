//! Cells of the plane, to spill points by; counting squares, to plan by.
//!
//! Both are anchored at the origin of the stored coordinates, and decided by
//! integer arithmetic: a point has one cell, on an edge as elsewhere.

use crate::geometry::{Rect, Stored};

/// Counting squares along the edge of a cell.
pub(crate) const SQUARES_PER_CELL_EDGE: i64 = 8;

/// The most cells that may be occupied. With more the grid is made coarser; because the number of occupied
/// cells depends on the points alone, and not on their order, so does the grid.
pub(crate) const MAX_OCCUPIED_CELLS: usize = 8192;

/// Cells along the longer side of what the headers claim, if usual ones are too wide
/// for as many.
const CELLS_ALONG: i64 = 16;

/// A cell, by its place in the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct CellKey {
    /// Counted northwards.
    pub(crate) row: i32,
    /// Counted eastwards.
    pub(crate) column: i32,
}

impl CellKey {
    /// The cell of the grid twice as coarse that holds this one.
    pub(crate) fn parent(self) -> Self {
        Self {
            row: self.row.div_euclid(2),
            column: self.column.div_euclid(2),
        }
    }
}

/// Equal square cells over the plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellGrid {
    edge: i64,
}

impl CellGrid {
    /// Cells at least `edge` wide (stored units), rounded up to whole counting
    /// squares.
    pub fn new(edge: i64) -> Self {
        // At most 2²⁹, so that doubling an edge is far from overflow.
        let squares = edge
            .clamp(SQUARES_PER_CELL_EDGE, 1 << 29)
            .div_euclid(SQUARES_PER_CELL_EDGE)
            + i64::from(edge % SQUARES_PER_CELL_EDGE != 0);
        Self {
            edge: squares.max(1) * SQUARES_PER_CELL_EDGE,
        }
    }

    /// A grid to begin with, for a scan said to be `extent` wide, with cells of `usual`
    /// width or less (stored units). What is said is a hint: a grid that turns out to
    /// have too many cells is made coarser, one too coarse cannot be made finer, and
    /// a single stray point makes an extent of anything.
    pub(crate) fn for_extent(extent: i64, usual: i64) -> Self {
        Self::new((extent / CELLS_ALONG).min(usual))
    }

    /// The grid that a run begins with whose points are said to lie within `extent` (CRS units) along the
    /// longer horizontal side, at `scale` CRS units to a stored unit: cells are one CRS unit wide, or
    /// narrower.
    pub(crate) fn for_run(extent: f64, scale: f64) -> Self {
        // `as` saturates, and takes what is not a number for zero.
        Self::for_extent((extent / scale) as i64, (1.0 / scale).ceil() as i64)
    }

    /// The grid of cells twice as wide, each of four of these.
    pub(crate) fn coarser(&self) -> Self {
        Self::new(2 * self.edge)
    }

    /// The place, in the cell's parent, of the square at `place` of `cell`.
    pub(crate) fn square_in_parent(cell: CellKey, place: usize) -> usize {
        let along = |cell: i32, square: usize| {
            let square = i64::from(cell) * SQUARES_PER_CELL_EDGE + square as i64;
            square.div_euclid(2).rem_euclid(SQUARES_PER_CELL_EDGE) as usize
        };
        let side = SQUARES_PER_CELL_EDGE as usize;
        along(cell.row, place / side) * side + along(cell.column, place % side)
    }

    /// Edge of a cell in stored units.
    pub(crate) fn edge(&self) -> i64 {
        self.edge
    }

    /// Edge of a counting square in stored units.
    pub(crate) fn square(&self) -> i64 {
        self.edge / SQUARES_PER_CELL_EDGE
    }

    /// The one cell that holds `point`.
    pub(crate) fn cell(&self, point: Stored) -> CellKey {
        let place = |c: i32| i64::from(c).div_euclid(self.edge) as i32;
        CellKey {
            row: place(point.y),
            column: place(point.x),
        }
    }

    /// The counting square of `point` within its cell.
    pub(crate) fn square_in_cell(&self, point: Stored) -> usize {
        let place = |c: i32| i64::from(c).rem_euclid(self.edge) / self.square();
        (place(point.y) * SQUARES_PER_CELL_EDGE + place(point.x)) as usize
    }

    /// The counting square of `point`, by its place in units of squares.
    pub(crate) fn square_of(&self, point: Stored) -> [i64; 2] {
        [point.x, point.y].map(|c| i64::from(c).div_euclid(self.square()))
    }

    /// The part of the plane that the counting square at `place` covers.
    pub(crate) fn rect_of_square(&self, place: [i64; 2]) -> Rect {
        Rect {
            min: place.map(|c| c * self.square()),
            max: place.map(|c| (c + 1) * self.square()),
        }
    }

    /// The cell that the counting square at `place` is a part of.
    pub(crate) fn cell_of_square(&self, place: [i64; 2]) -> CellKey {
        let [column, row] = place.map(|c| c.div_euclid(SQUARES_PER_CELL_EDGE) as i32);
        CellKey { row, column }
    }

    /// The part of the plane that `cell` covers.
    pub(crate) fn rect(&self, cell: CellKey) -> Rect {
        let min = [cell.column, cell.row].map(|c| i64::from(c) * self.edge);
        Rect {
            min,
            max: min.map(|c| c + self.edge),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_lies_in_its_cell_and_in_its_square() {
        for edge in [8, 100, 12_345] {
            let grid = CellGrid::new(edge);
            for x in [i32::MIN, -100_000, -1, 0, 1, 99, 100, i32::MAX] {
                for y in [i32::MIN, -7, 0, 12_344, 12_345, i32::MAX] {
                    let point = Stored { x, y, z: 0 };
                    let rect = grid.rect(grid.cell(point));
                    assert!(rect.contains(point));
                    let square = grid.square_in_cell(point) as i64;
                    let west = rect.min[0] + square % SQUARES_PER_CELL_EDGE * grid.square();
                    let south = rect.min[1] + square / SQUARES_PER_CELL_EDGE * grid.square();
                    let (x, y) = (i64::from(x), i64::from(y));
                    assert!(west <= x && x < west + grid.square());
                    assert!(south <= y && y < south + grid.square());
                }
            }
        }
    }

    #[test]
    fn a_square_keeps_its_points_when_the_grid_is_made_coarser() {
        for edge in [8, 104, 12_344] {
            let (grid, coarser) = (CellGrid::new(edge), CellGrid::new(edge).coarser());
            for x in [i32::MIN, -100_000, -105, -1, 0, 1, 103, i32::MAX] {
                for y in [i32::MIN, -7, 0, 12_344, i32::MAX] {
                    let point = Stored { x, y, z: 0 };
                    let cell = grid.cell(point);
                    assert_eq!(coarser.cell(point), cell.parent());
                    let square = CellGrid::square_in_parent(cell, grid.square_in_cell(point));
                    assert_eq!(square, coarser.square_in_cell(point));
                    let place = grid.square_of(point);
                    assert_eq!(grid.cell_of_square(place), cell);
                    assert!(grid.rect_of_square(place).contains(point));
                }
            }
        }
    }

    #[test]
    fn an_absurd_extent_is_survived() {
        for extent in [i64::MIN, -1, 0, 1, i64::MAX] {
            assert!(CellGrid::for_extent(extent, 1).edge() >= SQUARES_PER_CELL_EDGE);
        }
    }
}
