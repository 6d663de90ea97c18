//! The parts of a cloud whose triangles are found together: squares of cells, as large as the memory allows.
//!
//! Which parts there are decides how much is seen twice, and nothing else.

use super::{mesh_source::MeshSource, ordered_points::OrderedCell};
use crate::{geometry::Rect, tiling::CellKey};

/// Bytes of a point of a part while its triangles are found, with the records that are read.
const BYTES_PER_POINT: f64 = 900.0;
/// The most points of a part, however large the memory.
const MOST_POINTS_OF_A_PART: u64 = 4_000_000;

impl MeshSource<'_> {
    /// The parts of the cloud: squares of cells as large as the memory allows.
    pub(super) fn parts(&self) -> Vec<Part> {
        let limit = (self.run.budget.usable() as f64 / BYTES_PER_POINT) as u64;
        let limit = limit.min(MOST_POINTS_OF_A_PART);
        let mut parts = Vec::new();
        for shift in (0..32).rev() {
            parts = self.squares(shift);
            if parts.iter().all(|part| part.points_seen <= limit) {
                break;
            }
        }
        parts
    }

    /// The cells in squares of 2^`shift` cells along an edge.
    fn squares(&self, shift: u32) -> Vec<Part> {
        let cells = self.points.cells();
        let least = |index: fn(&OrderedCell) -> i32| {
            cells
                .iter()
                .map(|cell| i64::from(index(cell)))
                .min()
                .unwrap_or(0)
        };
        let [row, column] = [least(|cell| cell.key.row), least(|cell| cell.key.column)];
        let square = |cell: &OrderedCell| {
            let CellKey { row: r, column: c } = cell.key;
            [
                (i64::from(r) - row) >> shift,
                (i64::from(c) - column) >> shift,
            ]
        };
        let mut order: Vec<usize> = (0..cells.len()).collect();
        order.sort_by_key(|&cell| square(&cells[cell]));
        let of_square = |same: &[usize]| {
            let edge = self.grids.cells.edge();
            let [r, c] = square(&cells[same[0]]);
            let sides = |first: i64, square: i64| {
                [square, square + 1].map(|square| (first + (square << shift)) * edge)
            };
            let ([south, north], [west, east]) = (sides(row, r), sides(column, c));
            let core = Rect {
                min: [west, south],
                max: [east, north],
            };
            let around = self.cells_around(&core, same);
            let seen = same.iter().chain(&around);
            Part {
                core,
                points_seen: seen.map(|&cell| cells[cell].count).sum(),
                cells: same.to_vec(),
                around,
            }
        };
        order
            .chunk_by(|&a, &b| square(&cells[a]) == square(&cells[b]))
            .map(of_square)
            .collect()
    }

    /// The cells other than `own`, which are those of `core`, that are within reach of it.
    fn cells_around(&self, core: &Rect, own: &[usize]) -> Vec<usize> {
        let (reach, edge) = (self.reach(), self.grids.cells.edge());
        let wide = core.grown(reach);
        // Decisions can reach farther than a cell is wide.
        let rings = ((reach + edge - 1) / edge) as i32;
        let mut around: Vec<usize> = own
            .iter()
            .flat_map(|&cell| {
                let CellKey { row, column } = self.points.cells()[cell].key;
                let rows = row - rings..=row + rings;
                let keys = rows.flat_map(move |row| {
                    let columns = column - rings..=column + rings;
                    columns.map(move |column| CellKey { row, column })
                });
                keys.filter_map(|key| self.points.index_of(key))
            })
            .filter(|&cell| {
                let rect = self.grids.cells.rect(self.points.cells()[cell].key);
                !core.covers(&rect) && wide.intersects(&rect)
            })
            .collect();
        around.sort_unstable();
        around.dedup();
        around
    }
}

/// A part of the cloud, whose triangles are found together.
pub(super) struct Part {
    /// The square of the plane.
    pub(super) core: Rect,
    /// The indices of its cells.
    pub(super) cells: Vec<usize>,
    /// The indices of the cells within reach.
    pub(super) around: Vec<usize>,
    /// The number of points in all of these cells.
    points_seen: u64,
}
