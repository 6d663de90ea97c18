//! The points of a scan by brick, with the seeds around each brick: points near each other look for their seeds together.

use std::ops::Range;

use rayon::prelude::*;

use super::election::Election;
use crate::{
    geometry::{ITEMS_PER_TASK, Local, NeighborGrid, Stored, by_position, cell_of},
    lloyd::surface::bounding_box,
};

/// Edge of a brick.
const BRICK_IN_SPACINGS: f64 = 4.0 / 3.0;

/// Allowance for rounding in comparisons of distances, as a share of them.
pub(super) const ROUNDING: f64 = 1e-9;

/// Points of a scan, which several looks find in the same bricks.
pub(super) struct Bricks<'a> {
    pub(super) points: &'a [Stored],
    /// The range of the points of each brick, and the corners of the box around them.
    ranges: Vec<(Range<usize>, [Local; 2])>,
}

/// Some points, and the seeds around them.
pub(super) struct Brick<'a> {
    pub(super) points: &'a [Stored],
    /// The indices of the points among those of all bricks.
    pub(super) range: Range<usize>,
    /// The middle of the points.
    pub(super) middle: Local,
    /// The seeds within reach, those nearest to the middle first.
    pub(super) seeds: &'a [NearSeed],
}

/// A seed near a brick.
#[derive(Clone, Copy)]
pub(super) struct NearSeed {
    pub(super) position: Local,
    /// Its index in the grid.
    pub(super) number: u32,
    /// Its distance from the middle of the points (CRS units).
    pub(super) from_middle: f64,
}

impl Election<'_> {
    /// The bricks of `points`, which are sorted by voxel.
    pub(super) fn bricks<'a>(&self, points: &'a [Stored]) -> Bricks<'a> {
        // Bricks are small beside the places where the spacing is finest, too.
        let edge = BRICK_IN_SPACINGS * self.surface.options.finest_spacing();
        let brick_of = |&point: &Stored| cell_of(self.local(point), edge);
        let by_brick = points.par_chunk_by(|a, b| brick_of(a) == brick_of(b));
        let with_corners = by_brick.map(|points| {
            let places = points.iter().map(|&point| self.local(point));
            (points.len(), bounding_box(places))
        });
        let mut end = 0;
        let with_range = |(count, corners)| {
            let start = end;
            end += count;
            (start..end, corners)
        };
        let counted: Vec<(usize, [Local; 2])> = with_corners.collect();
        let ranges = counted.into_iter().map(with_range).collect();
        Bricks { points, ranges }
    }

    /// Calls `work` for each of the `bricks`, with those `among` the seeds that are within `reach` (spacings) of it; gives all
    /// results in the order of the points.
    pub(super) fn by_brick<T: Send>(
        &self,
        bricks: &Bricks<'_>,
        among: &NeighborGrid,
        reach: f64,
        work: impl Fn(Brick<'_>) -> Vec<T> + Sync,
    ) -> Vec<T> {
        let field = self.surface.field();
        let reach = reach * field.widening(reach) * (1.0 + ROUNDING);
        bricks
            .ranges
            .par_iter()
            .with_max_len(ITEMS_PER_TASK)
            .map_init(Vec::new, |seeds, (range, [low, high])| {
                let middle = (low + high) * 0.5;
                let around = Local::repeat(reach * field.at(middle));
                let (low, high) = (low - around, high + around);
                seeds.clear();
                among.visit_box(low, high, |number, position| {
                    if low <= position && position <= high {
                        seeds.push(NearSeed {
                            position,
                            number,
                            from_middle: (position - middle).norm(),
                        });
                    }
                });
                // Of equally near seeds the same comes first in every tile.
                seeds.sort_unstable_by(|a, b| {
                    let by_distance = a.from_middle.total_cmp(&b.from_middle);
                    by_distance.then_with(|| by_position(&a.position, &b.position))
                });
                work(Brick {
                    points: &bricks.points[range.clone()],
                    range: range.clone(),
                    middle,
                    seeds,
                })
            })
            .flatten_iter()
            .collect()
    }
}
