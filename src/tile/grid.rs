//! Cells of the plane, to spill points by; counting squares, to plan by.
//!
//! Both are anchored at the origin of the stored coordinates, and decided by
//! integer arithmetic: a point has one cell, on an edge as elsewhere.

use crate::geometry::{Rect, Stored};

/// Counting squares along the edge of a cell.
pub(super) const SQUARES: i64 = 8;

/// Cells along the longer side of what the headers claim. The claim is a hint:
/// if it lies, cells are larger or smaller than they should be, and nothing
/// else.
const CELLS_ALONG: i64 = 128;

/// A cell, by its place in the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CellKey {
    /// Counted northwards.
    pub row: i32,
    /// Counted eastwards.
    pub column: i32,
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
        let squares =
            edge.clamp(SQUARES, 1 << 29).div_euclid(SQUARES) + i64::from(edge % SQUARES != 0);
        Self {
            edge: squares.max(1) * SQUARES,
        }
    }

    /// A grid for a scan said to be `extent` wide (stored units), with cells no
    /// finer than `least`.
    pub fn for_extent(extent: i64, least: i64) -> Self {
        Self::new((extent / CELLS_ALONG).max(least))
    }

    /// Edge of a cell in stored units.
    pub fn edge(&self) -> i64 {
        self.edge
    }

    /// Edge of a counting square in stored units.
    pub fn square(&self) -> i64 {
        self.edge / SQUARES
    }

    /// The one cell that holds `point`.
    pub fn cell(&self, point: Stored) -> CellKey {
        let place = |c: i32| i64::from(c).div_euclid(self.edge) as i32;
        CellKey {
            row: place(point.y),
            column: place(point.x),
        }
    }

    /// The counting square of `point` within its cell.
    pub(super) fn square_in_cell(&self, point: Stored) -> usize {
        let place = |c: i32| i64::from(c).rem_euclid(self.edge) / self.square();
        (place(point.y) * SQUARES + place(point.x)) as usize
    }

    /// The part of the plane that `cell` covers.
    pub fn rect(&self, cell: CellKey) -> Rect {
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
                    let west = rect.min[0] + square % SQUARES * grid.square();
                    let south = rect.min[1] + square / SQUARES * grid.square();
                    let (x, y) = (i64::from(x), i64::from(y));
                    assert!(west <= x && x < west + grid.square());
                    assert!(south <= y && y < south + grid.square());
                }
            }
        }
    }

    #[test]
    fn an_absurd_extent_is_survived() {
        for extent in [i64::MIN, -1, 0, 1, i64::MAX] {
            assert!(CellGrid::for_extent(extent, 1).edge() >= SQUARES);
        }
    }
}
