//! Which square of the plane the 3-D viewer shows: one where tiles meet, as large as a browser
//! can show fluently.

use super::{cloud_pair::CloudPair, error::ViewError, square_triangles::SquareTriangles};
use crate::geometry::Rect;

/// The number of input points in the square, at most.
const VIEWER_SQUARE_INPUT_LIMIT: u64 = 1_200_000;
/// The expected number of output points in the square, at most.
const VIEWER_SQUARE_OUTPUT_LIMIT: f64 = 150_000.0;
/// The least and the largest half side of the square, in spacings. The least half side is taken
/// even if the square exceeds the limits above.
const HALF_SIDE_IN_SPACINGS: [f64; 2] = [12.0, 300.0];

impl CloudPair<'_> {
    /// Chooses the square that the viewer shows: where tiles meet, if any do, near the corner of `tile`. There
    /// is no square if the tile has no site, and there are no triangles in it yet.
    ///
    /// # Errors
    ///
    /// [`ViewError::Tile`] if a temporary file cannot be read.
    pub(crate) fn viewer_square(&self, tile: u32) -> Result<SquareTriangles, ViewError> {
        let middle = self.site_where_tiles_meet(tile)?;
        Ok(SquareTriangles::new(middle.map(|middle| {
            let half = self.half_side(middle);
            Rect {
                min: middle.map(|c| c - half),
                max: middle.map(|c| c + half),
            }
        })))
    }

    /// Returns the site of `tile` that is nearest to the corner at which it meets most other
    /// tiles, or nearest to its middle if it meets none.
    fn site_where_tiles_meet(&self, tile: u32) -> Result<Option<[i64; 2]>, ViewError> {
        let tiles = &self.plan.tiles;
        let Some(own) = tiles.iter().find(|known| known.id == tile) else {
            return Ok(None);
        };
        let Rect { min, max } = own.core;
        let meeting = |corner: [i64; 2]| {
            let around = Rect {
                min: corner.map(|c| c - 1),
                max: corner.map(|c| c + 1),
            };
            let others = tiles.iter().filter(|other| other.id != tile);
            others
                .filter(|other| other.core.intersects(&around))
                .count()
        };
        let corners = [min, [max[0], min[1]], [min[0], max[1]], max];
        let busiest = corners.into_iter().max_by_key(|&corner| meeting(corner));
        let target = busiest.filter(|&corner| meeting(corner) > 0);
        self.site_near(tile, target)
    }

    /// Returns half the side (stored units) of the largest square around `middle` within the
    /// limits, by the counts of the spill.
    fn half_side(&self, middle: [i64; 2]) -> i64 {
        let [least, most] =
            HALF_SIDE_IN_SPACINGS.map(|half| self.quantization.units(half * self.spacing));
        let grid = self.spill.grid();
        // The counting squares, each with the least half side at which it is contained.
        let mut squares: Vec<(i64, u64)> = self
            .spill
            .squares()
            .map(|(corner, points)| {
                let Rect { min, max } = grid.rect_of_square(corner);
                let reach = |axis: usize| (max[axis] - middle[axis]).max(middle[axis] - min[axis]);
                (reach(0).max(reach(1)), points)
            })
            .filter(|&(half, _)| half <= most)
            .collect();
        squares.sort_unstable();
        let (mut input, mut largest) = (0, least);
        for (half, points) in squares {
            input += points;
            let output = input as f64 * self.sites_per_point;
            if input > VIEWER_SQUARE_INPUT_LIMIT || output > VIEWER_SQUARE_OUTPUT_LIMIT {
                break;
            }
            largest = largest.max(half);
        }
        largest
    }
}
