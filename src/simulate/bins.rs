//! A grid over the street, to find what is near a point or along a ray.

use super::road::BLOCK_LENGTH;
use crate::geometry::Local;

/// The edge of a bin.
pub(super) const BIN_EDGE: f64 = 1.0;
/// The distance from the middle of the road up to which there are bins.
pub(super) const BINNED_HALF_WIDTH: f64 = 12.0;
/// The number of rings of bins that a search visits: it ends 40 m away.
const MOST_RINGS: i64 = 40;

/// The numbers of the things in each bin, row by row along the street.
#[derive(Debug)]
pub(super) struct Bins(Vec<Vec<u32>>);

/// Returns row and column of the bin below or above `point`.
pub(super) fn bin_of(point: Local) -> [i64; 2] {
    [point.x, point.y].map(|c| (c / BIN_EDGE).floor() as i64)
}

impl Bins {
    /// Sorts things with these bounding boxes into bins, over a street of this length. Bins
    /// begin a block before the street and end two blocks behind it.
    pub(super) fn new(length: f64, bounds: impl Iterator<Item = (Local, Local)>) -> Self {
        let columns = (2.0 * BINNED_HALF_WIDTH / BIN_EDGE) as usize;
        let rows = ((length + 3.0 * BLOCK_LENGTH) / BIN_EDGE).ceil() as usize;
        let mut bins = vec![Vec::new(); rows * columns];
        let range = |low: f64, high: f64, count: usize| {
            let index = |c: f64| (c / BIN_EDGE).floor().max(0.0) as usize;
            index(low)..=index(high).min(count - 1)
        };
        for (number, (low, high)) in (0_u32..).zip(bounds) {
            // Things on the border of two bins are in both.
            let (low, high) = (low.add_scalar(-1e-6), high.add_scalar(1e-6));
            for row in range(low.x + BLOCK_LENGTH, high.x + BLOCK_LENGTH, rows) {
                for column in range(
                    low.y + BINNED_HALF_WIDTH,
                    high.y + BINNED_HALF_WIDTH,
                    columns,
                ) {
                    bins[row * columns + column].push(number);
                }
            }
        }
        Self(bins)
    }

    /// Returns the things in a bin; none outside of the grid.
    pub(super) fn bin(&self, [x, y]: [i64; 2]) -> &[u32] {
        let columns = (2.0 * BINNED_HALF_WIDTH / BIN_EDGE) as i64;
        let row = x + (BLOCK_LENGTH / BIN_EDGE) as i64;
        let column = y + (BINNED_HALF_WIDTH / BIN_EDGE) as i64;
        if row < 0 || !(0..columns).contains(&column) {
            return &[];
        }
        self.0
            .get((row * columns + column) as usize)
            .map_or(&[], Vec::as_slice)
    }

    /// Returns the least `distance` from `point` to a thing, or `limit` if that is less.
    pub(super) fn nearest(&self, point: Local, limit: f64, distance: impl Fn(u32) -> f64) -> f64 {
        let [x, y] = bin_of(point);
        let mut best = limit;
        let mut ring: i64 = 0;
        // Visit rings of bins, until those farther out contain nothing nearer.
        while (ring - 1) as f64 * BIN_EDGE < best && ring < MOST_RINGS {
            for dx in -ring..=ring {
                for dy in -ring..=ring {
                    if dx.abs().max(dy.abs()) == ring {
                        for &number in self.bin([x + dx, y + dy]) {
                            best = best.min(distance(number));
                        }
                    }
                }
            }
            ring += 1;
        }
        best
    }
}
