//! Equal squares of the plane, and the points that each contains.
//!
//! Squares are multiples of their edge in world coordinates; a point on a side belongs to
//! the square east or north of it.

use std::collections::BTreeSet;

use super::store::SortedRecords;
use crate::{
    geometry::{Quantization, Rect},
    tiling::Bounds,
};

/// Equal squares of the plane, for points on a quantization.
pub(crate) struct Squares {
    /// The edge of a square (CRS units).
    edge: f64,
    scale: f64,
    offset: [f64; 3],
}

impl Squares {
    /// Squares with this `edge` (CRS units) for points on `quantization`.
    pub(crate) fn new(edge: f64, quantization: &Quantization) -> Self {
        Self {
            edge,
            scale: quantization.scale,
            offset: quantization.offset,
        }
    }

    /// The edge of a square (CRS units).
    pub(super) fn edge(&self) -> f64 {
        self.edge
    }

    /// The first stored coordinate that is not west or south of the side with this index.
    fn side(&self, index: i64, axis: usize) -> i64 {
        let side = (index as f64 * self.edge - self.offset[axis]) / self.scale;
        // A side that rounding has put a hair above a whole number is on that number.
        (side - 1e-6).ceil() as i64
    }

    /// The square with this index, in stored units.
    pub(crate) fn rect(&self, square: [i64; 2]) -> Rect {
        Rect {
            min: [self.side(square[0], 0), self.side(square[1], 1)],
            max: [self.side(square[0] + 1, 0), self.side(square[1] + 1, 1)],
        }
    }

    /// The index, along `axis`, of the square that contains the stored coordinate `c`.
    fn index(&self, c: i64, axis: usize) -> i64 {
        let world = self.offset[axis] + c as f64 * self.scale;
        let mut index = (world / self.edge).floor() as i64;
        // Rounding must not separate the coordinate from its sides.
        while c < self.side(index, axis) {
            index -= 1;
        }
        while c >= self.side(index + 1, axis) {
            index += 1;
        }
        index
    }

    /// The indices of the squares that may contain points, from south to north and, in a row,
    /// from west to east.
    pub(super) fn occupied(&self, points: &dyn SortedRecords) -> Vec<[i64; 2]> {
        let Bounds { min, max } = points.bounds();
        let mut found = BTreeSet::new();
        for (rect, _) in points.squares() {
            let with_points = Rect {
                min: [0, 1].map(|axis| rect.min[axis].max(min[axis].into())),
                max: [0, 1].map(|axis| rect.max[axis].min(i64::from(max[axis]) + 1)),
            };
            found.extend(self.touched_by(&with_points).map(|[x, y]| (y, x)));
        }
        found.into_iter().map(|(y, x)| [x, y]).collect()
    }

    /// The indices of the squares that `rect` touches.
    pub(crate) fn touched_by(&self, rect: &Rect) -> impl Iterator<Item = [i64; 2]> {
        let range =
            |axis: usize| self.index(rect.min[axis], axis)..=self.index(rect.max[axis] - 1, axis);
        let columns = range(0);
        range(1).flat_map(move |y| columns.clone().map(move |x| [x, y]))
    }

    /// The south-west corner of a square (CRS units).
    pub(super) fn corner(&self, square: [i64; 2]) -> [f64; 2] {
        square.map(|index| index as f64 * self.edge)
    }

    /// The corners of a square (CRS units), counterclockwise from the south-west and back.
    pub(super) fn outline(&self, [x, y]: [i64; 2]) -> [[f64; 2]; 5] {
        [[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1], [x, y]].map(|square| self.corner(square))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_coordinate_has_one_square() {
        for (edge, scale, offset) in [
            (50.0, 0.001, 431_060.0),
            (0.1, 0.001, -3.0),
            (7.3, 0.0005, 12.25),
        ] {
            let squares = Squares {
                edge,
                scale,
                offset: [offset; 3],
            };
            for c in (-200_000..200_000).step_by(37).chain(-120..120) {
                let index = squares.index(c, 0);
                assert!(squares.side(index, 0) <= c && c < squares.side(index + 1, 0));
                let world = offset + c as f64 * scale;
                assert!((index as f64 * edge - world) < 1e-6 * scale.max(1e-3));
            }
        }
    }
}
