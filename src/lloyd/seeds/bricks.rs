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

/// Number of bricks that are looked at together: what a look finds is then held once, and little of it twice while it is put in order.
const BRICKS_AT_A_TIME: usize = 1 << 15;

/// Allowance for rounding in comparisons of distances, as a share of them.
pub(super) const ROUNDING: f64 = 1e-9;

/// Points of a scan, which several looks find in the same bricks.
pub(super) struct Bricks<'a> {
    pub(super) points: &'a [Stored],
    /// For each brick the number of the points up to its last.
    ends: Vec<u32>,
}

impl Bricks<'_> {
    /// The range of the points of the brick with this `index`.
    fn range(&self, index: usize) -> Range<usize> {
        let start = index.checked_sub(1).map_or(0, |before| self.ends[before]);
        start as usize..self.ends[index] as usize
    }
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
        let mut ends: Vec<u32> = by_brick.map(|points| points.len() as u32).collect();
        let mut end = 0;
        for count in &mut ends {
            end += *count;
            *count = end;
        }
        Bricks { points, ends }
    }

    /// Calls `work` for each of the `bricks`, with those `among` the seeds that are within `reach` (spacings) of it; gives all
    /// results, of which a brick has no more than points, in the order of the points.
    pub(super) fn by_brick<T: Send>(
        &self,
        bricks: &Bricks<'_>,
        among: &NeighborGrid,
        reach: f64,
        work: impl Fn(Brick<'_>) -> Vec<T> + Sync,
    ) -> Vec<T> {
        let field = self.surface.field();
        let reach = reach * field.widening(reach) * (1.0 + ROUNDING);
        let look = |seeds: &mut Vec<NearSeed>, index: usize| {
            let range = bricks.range(index);
            let points = &bricks.points[range.clone()];
            let [low, high] = bounding_box(points.iter().map(|&point| self.local(point)));
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
                points,
                range,
                middle,
                seeds,
            })
        };
        // A vector that grows is in memory twice while it does.
        let mut found = Vec::with_capacity(bricks.points.len());
        let count = bricks.ends.len();
        for first in (0..count).step_by(BRICKS_AT_A_TIME) {
            let bricks = first..count.min(first + BRICKS_AT_A_TIME);
            let looks = bricks.into_par_iter().with_max_len(ITEMS_PER_TASK);
            found.par_extend(looks.map_init(Vec::new, &look).flatten_iter());
        }
        found
    }
}
