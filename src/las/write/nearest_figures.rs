//! How even a set of points is: the distances of its points to the nearest other one.

use rayon::prelude::*;
use serde::Serialize;

use super::{election::local, point_set::PointSet, store::StoreError};
use crate::geometry::{Local, NeighborGrid, Rect, Stored};

/// How far the nearest point is searched for, in radii of the election of the set.
const FARTHEST_IN_RADII: f64 = 4.0;
/// The edge of the parts in which distances are found, in radii.
const PART_IN_RADII: f64 = 64.0;

/// The distances between points of a set and the nearest other ones. Points that have none within four radii of its
/// election are counted, but have no distance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct NearestFigures {
    /// The number of points.
    pub(crate) points: u64,
    /// The radius of the election of the set; not a number for a part of a set.
    pub(crate) spacing: f64,
    /// The mean distance.
    pub(crate) mean: f64,
    /// The standard deviation of the distances over their mean.
    pub(crate) cv: f64,
    /// The least distance.
    pub(crate) least: f64,
}

impl NearestFigures {
    /// Converts all lengths by `scale`.
    pub(super) fn scaled(self, scale: f64) -> Self {
        Self {
            spacing: self.spacing * scale,
            mean: self.mean * scale,
            least: self.least * scale,
            ..self
        }
    }
}

/// Chooses points whose distances are found, of all those of a set in a rectangle.
type Choice<'a> = dyn Fn(Vec<Stored>, &Rect) -> Result<Vec<Stored>, StoreError> + 'a;

/// Finds the distances of the points of `set` that `chosen` leaves of those in a rectangle. No more than `most` points are in
/// memory at a time. Lengths are stored units.
///
/// # Errors
///
/// If temporary files cannot be read.
pub(super) fn nearest_figures(
    set: &PointSet<'_>,
    radius: f64,
    most: u64,
    chosen: &Choice<'_>,
) -> Result<NearestFigures, StoreError> {
    let farthest = FARTHEST_IN_RADII * radius;
    let reach = farthest.ceil() as i64;
    let (mut points, mut measured, mut sum, mut least) = (0_u64, 0_u64, 0.0, f64::INFINITY);
    let mut sum_of_squares = 0.0;
    for part in set.parts((PART_IN_RADII * radius).ceil() as i64, reach, most) {
        let around = part.grown(reach);
        let found = chosen(set.read(&around)?, &around)?;
        let Some(&origin) = found.first() else {
            continue;
        };
        let locals: Vec<Local> = found.par_iter().map(|&p| local(p, origin)).collect();
        let grid = NeighborGrid::new(&locals, radius);
        let nearest: Vec<Option<f64>> = (0..found.len())
            .into_par_iter()
            .filter(|&index| part.contains(found[index]))
            .map(|index| {
                let is_own = |other: u32| other as usize == index;
                let nearest = grid.nearest(locals[index], farthest, is_own);
                nearest.map(|(_, squared)| squared.sqrt())
            })
            .collect();
        points += nearest.len() as u64;
        for distance in nearest.into_iter().flatten() {
            measured += 1;
            sum += distance;
            sum_of_squares += distance * distance;
            least = f64::min(least, distance);
        }
    }
    let mean = sum / measured as f64;
    let variance = (sum_of_squares / measured as f64 - mean * mean).max(0.0);
    Ok(NearestFigures {
        points,
        spacing: radius,
        mean,
        cv: variance.sqrt() / mean,
        least,
    })
}
