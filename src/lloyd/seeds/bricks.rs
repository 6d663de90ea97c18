//! The points of a scan by brick, with the seeds around each brick: points near each other look for their seeds together.

use rayon::prelude::*;

use super::election::Election;
use crate::{
    geometry::{Local, NeighborGrid, Stored, by_position, cell_of},
    lloyd::surface::bounding_box,
};

/// Edge of a brick.
const BRICK_IN_SPACINGS: f64 = 4.0 / 3.0;

/// Some points, and the seeds around them.
pub(super) struct Brick<'a, P> {
    pub(super) points: &'a [P],
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
    /// Calls `work` for every brick of `points`, which are sorted by voxel and of which `stored` gives the places, with those
    /// `among` the seeds that are within `reach` (spacings) of it; gives all results in the order of the points.
    pub(super) fn by_brick<P: Sync, T: Send>(
        &self,
        points: &[P],
        stored: impl Fn(&P) -> Stored + Sync,
        among: &NeighborGrid,
        reach: f64,
        work: impl Fn(Brick<'_, P>) -> Vec<T> + Sync,
    ) -> Vec<T> {
        let field = self.surface.field();
        // Bricks are small beside the places where the spacing is finest, too.
        let edge = BRICK_IN_SPACINGS * self.surface.options.finest_spacing();
        let reach = reach * field.widening(reach);
        let place_of = |point: &P| self.local(stored(point));
        let brick_of = |point: &P| cell_of(place_of(point), edge);
        points
            .par_chunk_by(|a, b| brick_of(a) == brick_of(b))
            .map_init(Vec::new, |seeds, points| {
                let [low, high] = bounding_box(points.iter().map(place_of));
                let middle = (low + high) * 0.5;
                let around = Local::repeat(reach * field.at(middle));
                seeds.clear();
                among.visit_box(low - around, high + around, |number, position| {
                    seeds.push(NearSeed {
                        position,
                        number,
                        from_middle: (position - middle).norm(),
                    });
                });
                // Of equally near seeds the same comes first in every tile.
                seeds.sort_unstable_by(|a, b| {
                    let by_distance = a.from_middle.total_cmp(&b.from_middle);
                    by_distance.then_with(|| by_position(&a.position, &b.position))
                });
                work(Brick {
                    points,
                    middle,
                    seeds,
                })
            })
            .flatten_iter()
            .collect()
    }
}
