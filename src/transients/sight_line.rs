//! The lines along which a scanner saw.

use super::voxel::{Voxel, VoxelGrid};
use crate::geometry::{GridWalk, Local};

/// The distance from the scanner up to which what a sight line passes does not count: the vehicle itself (edges of voxels).
const NEAREST: f64 = 4.0;
/// The distance before its point from which on what a sight line passes does not count: the thing that it met (edges of
/// voxels).
const BEFORE_THE_POINT: f64 = 1.0;

/// The largest range of a scanner (edges of voxels): what is said to have been seen from farther away was not.
const LARGEST_RANGE: f64 = 1200.0;

/// The part of a line from the scanner to a point that passed through what was not there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SightLine {
    pub(super) start: Local,
    /// Of length 1.
    pub(super) direction: Local,
    pub(super) length: f64,
}

impl SightLine {
    /// The largest range of a scanner (CRS units) whose sight lines count on a grid.
    pub(crate) fn largest_range(grid: VoxelGrid) -> f64 {
        LARGEST_RANGE * grid.edge
    }

    /// The line by which a scanner saw `point` (local coordinates both), as far as it counts on a grid; `None` if that is
    /// nowhere.
    pub(crate) fn new(scanner: Local, point: Local, grid: VoxelGrid) -> Option<Self> {
        let to_point = point - scanner;
        let range = to_point.norm();
        let length = range - (NEAREST + BEFORE_THE_POINT) * grid.edge;
        // Written so that NaN has no line.
        (length > 0.0 && range <= Self::largest_range(grid)).then(|| {
            let direction = to_point / range;
            Self {
                start: scanner + direction * (NEAREST * grid.edge),
                direction,
                length,
            }
        })
    }

    /// The voxels of `grid` that the line passes, in order.
    pub(super) fn voxels(self, grid: VoxelGrid) -> impl Iterator<Item = Voxel> {
        GridWalk::new(self.start.into(), self.direction.into(), grid.edge)
            .take_while(move |&(_, entered)| entered <= self.length)
            .map(|(voxel, _)| voxel)
    }

    /// The place where the line comes nearest to `place`, if it passes by within `distance` of it.
    pub(super) fn nearest_within(&self, place: Local, distance: f64) -> Option<Local> {
        let to_place = place - self.start;
        let along = to_place.dot(&self.direction);
        let passes = (0.0..=self.length).contains(&along)
            && to_place.norm_squared() - along * along <= distance * distance;
        passes.then(|| self.start + self.direction * along)
    }
}
