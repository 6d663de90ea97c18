//! Cells of the plane, to spill points by; counting squares, to plan by.
//!
//! Cells and squares are anchored at the origin of the stored coordinates and decided by integer
//! arithmetic, so that every point has exactly one of each, on an edge as elsewhere.

use crate::geometry::{Quantization, Rect, Stored};

/// Counting squares along the edge of a cell.
pub(crate) const SQUARES_PER_CELL_EDGE: i64 = 8;

/// The most cells that may be occupied. With more the grid is made coarser; because the number of occupied
/// cells depends on the points alone, and not on their order, so does the grid.
pub(crate) const MAX_OCCUPIED_CELLS: usize = 8192;

/// The edge of the cells of a mesh in spacings.
const MESH_CELL_IN_SPACINGS: f64 = 64.0;

/// Cells along the longer side of the claimed extent at the least: where cells of the usual width are fewer,
/// the grid begins finer.
const MIN_CELLS_ALONG_EXTENT: i64 = 16;

/// The row and the column of a cell in the grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct CellKey {
    /// The row, counted northwards from the origin.
    pub(crate) row: i32,
    /// The column, counted eastwards from the origin.
    pub(crate) column: i32,
}

impl CellKey {
    /// The cell that contains this one in the grid that is twice as coarse.
    #[inline]
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
    /// A grid of cells of `edge` (stored units), rounded up to whole counting squares.
    pub fn new(edge: i64) -> Self {
        // At most 2²⁹, so that doubling an edge is far from overflow. What is rounded is the bounded edge, so that
        // the grid of an edge of a grid is that grid.
        let edge = edge.clamp(SQUARES_PER_CELL_EDGE, 1 << 29);
        let squares = (edge + SQUARES_PER_CELL_EDGE - 1) / SQUARES_PER_CELL_EDGE;
        Self {
            edge: squares * SQUARES_PER_CELL_EDGE,
        }
    }

    /// The grid whose counting squares are the cells of a mesh between points at `spacing` (CRS units).
    pub(crate) fn of_mesh_cells(spacing: f64, quantization: &Quantization) -> Self {
        let edge = quantization.units(MESH_CELL_IN_SPACINGS * spacing);
        Self::new(SQUARES_PER_CELL_EDGE * edge)
    }

    /// A grid to begin with, for a scan whose header claims to be `extent` wide, with cells of `usual` width or
    /// less (stored units). The claim is a hint only, because a single stray point makes any extent: a grid
    /// with too many cells is made coarser later, and one that is too coarse cannot be made finer.
    pub(crate) fn for_extent(extent: i64, usual: i64) -> Self {
        Self::new((extent / MIN_CELLS_ALONG_EXTENT).min(usual))
    }

    /// The grid that a run begins with, whose points are claimed to lie within `extent` (CRS units) along the
    /// longer horizontal side, at `scale` CRS units to a stored unit: cells are one CRS unit wide, or
    /// narrower.
    pub(crate) fn for_run(extent: f64, scale: f64) -> Self {
        // `as` saturates, and takes what is not a number for zero.
        Self::for_extent((extent / scale) as i64, (1.0 / scale).ceil() as i64)
    }

    /// The grid of cells that are twice as wide, each made of four cells of this grid.
    pub(crate) fn coarser(&self) -> Self {
        Self::new(2 * self.edge)
    }

    /// The index, within the parent of `cell`, of the square with index `square` of `cell`; squares of a cell
    /// are counted row by row.
    pub(crate) fn square_in_parent(cell: CellKey, square: usize) -> usize {
        let along = |cell: i32, square: usize| {
            let square = i64::from(cell) * SQUARES_PER_CELL_EDGE + square as i64;
            square.div_euclid(2).rem_euclid(SQUARES_PER_CELL_EDGE) as usize
        };
        let side = SQUARES_PER_CELL_EDGE as usize;
        along(cell.row, square / side) * side + along(cell.column, square % side)
    }

    /// Edge of a cell in stored units.
    #[inline]
    pub(crate) fn edge(&self) -> i64 {
        self.edge
    }

    /// Edge of a counting square in stored units.
    #[inline]
    pub(crate) fn square(&self) -> i64 {
        self.edge / SQUARES_PER_CELL_EDGE
    }

    /// The cell that contains `point`.
    #[inline]
    pub(crate) fn cell(&self, point: Stored) -> CellKey {
        CellKey {
            row: self.index(point.y.into()),
            column: self.index(point.x.into()),
        }
    }

    /// The cells that `rect` touches, row by row.
    pub(crate) fn touched_by(&self, rect: &Rect) -> impl Iterator<Item = CellKey> {
        let range = |axis: usize| self.index(rect.min[axis])..=self.index(rect.max[axis] - 1);
        let columns = range(0);
        range(1).flat_map(move |row| columns.clone().map(move |column| CellKey { row, column }))
    }

    /// The row or the column of the cells with this stored coordinate.
    #[inline]
    fn index(&self, c: i64) -> i32 {
        c.div_euclid(self.edge) as i32
    }

    /// The index of the counting square of `point`: its south-west corner in units of squares.
    #[inline]
    pub(crate) fn square_of(&self, point: Stored) -> [i64; 2] {
        [point.x, point.y].map(|c| i64::from(c).div_euclid(self.square()))
    }

    /// The part of the plane that the counting square `index` covers.
    pub(crate) fn rect_of_square(&self, index: [i64; 2]) -> Rect {
        Rect {
            min: index.map(|c| c * self.square()),
            max: index.map(|c| (c + 1) * self.square()),
        }
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

/// Finds the cells and counting squares of points that come one by one: most lie in the square of the one
/// before, which is found without a division.
#[derive(Debug)]
pub(crate) struct SquareFinder {
    grid: CellGrid,
    /// The square that was found last.
    rect: Rect,
    cell: CellKey,
    square: usize,
}

impl SquareFinder {
    /// A finder in `grid`.
    pub(crate) fn new(grid: CellGrid) -> Self {
        Self {
            grid,
            rect: Rect {
                min: [0; 2],
                max: [0; 2],
            },
            cell: CellKey { row: 0, column: 0 },
            square: 0,
        }
    }

    /// The cell of `point`, and the index of its counting square in the cell.
    #[inline]
    pub(crate) fn find(&mut self, point: Stored) -> (CellKey, usize) {
        if !self.rect.contains(point) {
            let square = self.grid.square_of(point);
            self.rect = self.grid.rect_of_square(square);
            let [column, row] = square.map(|c| c.div_euclid(SQUARES_PER_CELL_EDGE) as i32);
            self.cell = CellKey { row, column };
            let [x, y] = square.map(|c| c.rem_euclid(SQUARES_PER_CELL_EDGE) as usize);
            self.square = y * SQUARES_PER_CELL_EDGE as usize + x;
        }
        (self.cell, self.square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl CellGrid {
        /// The index of the counting square of `point` within its cell, row by row.
        fn square_in_cell(&self, point: Stored) -> usize {
            let index = |c: i32| i64::from(c).rem_euclid(self.edge) / self.square();
            (index(point.y) * SQUARES_PER_CELL_EDGE + index(point.x)) as usize
        }
    }

    #[test]
    fn the_grid_of_an_edge_of_a_grid_is_that_grid() {
        for edge in [-5, 0, 1, 8, 9, 1000, 1001, 1 << 29, (1 << 29) + 1, i64::MAX] {
            let grid = CellGrid::new(edge);
            assert_eq!(CellGrid::new(grid.edge()), grid, "{edge}");
            assert!(grid.edge() >= edge.min(1 << 29) && grid.edge() % SQUARES_PER_CELL_EDGE == 0);
        }
    }

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
                    let square = grid.square_of(point);
                    assert!(grid.rect_of_square(square).contains(point));
                }
            }
        }
    }

    #[test]
    fn a_finder_finds_what_the_grid_says() {
        for edge in [8, 104, 12_344] {
            let grid = CellGrid::new(edge);
            let mut finder = SquareFinder::new(grid);
            for x in [i32::MIN, -104, -105, -1, 0, 1, 103, 104, 1543, i32::MAX] {
                for y in [i32::MIN, -7, -7, 0, 12, 13, 12_344, i32::MAX] {
                    let point = Stored { x, y, z: 0 };
                    let found = finder.find(point);
                    assert_eq!(found, (grid.cell(point), grid.square_in_cell(point)));
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
