//! How even a set of points is: the distances of its points to the nearest other one.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{
    cloud::Workspace,
    election::local,
    point_set::{PointSet, points_together},
    store::StoreError,
};
use crate::{
    geometry::{Local, NeighborGrid, Rect, Stored},
    quality::DistanceSums,
};

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

/// Finds the distances of the points of `set` that `chosen` leaves of those in a rectangle, within the memory of the
/// `workspace`, as the work with this `name`. Lengths are stored units.
///
/// # Errors
///
/// If temporary files cannot be read.
pub(super) fn nearest_figures(
    set: &PointSet<'_>,
    radius: f64,
    chosen: &Choice<'_>,
    name: &str,
    workspace: &Workspace<'_>,
) -> Result<NearestFigures, StoreError> {
    let farthest = FARTHEST_IN_RADII * radius;
    let around = |part: &Rect| part.grown(farthest.ceil() as i64);
    let edge = (PART_IN_RADII * radius).ceil() as i64;
    let parts = set.parts(edge, &around, points_together(workspace));
    let mut sums = NearestSums::default();
    let mut measure = |piece: usize| {
        let part = &parts[piece];
        let found = chosen(set.read(&around(part))?, &around(part))?;
        let of_part = NearestSums::of(&found, part, radius, farthest);
        Ok::<_, StoreError>(vec![serde_json::to_vec(&of_part)?])
    };
    let mut add = |_, piece: Vec<Vec<u8>>| {
        sums.add(&serde_json::from_slice(&piece.concat())?);
        Ok(())
    };
    let workforce = workspace.workforce;
    workforce.pass(name, parts.len(), &mut measure, &mut add)?;
    Ok(sums.figures(radius))
}

/// The sums over nearest distances from which the figures follow.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct NearestSums {
    points: u64,
    distances: DistanceSums,
    /// The least distance, if there is one.
    least: Option<f64>,
}

impl NearestSums {
    /// The distances of those of the points `found` that lie in `part`, which are about `radius` apart, up to `farthest`.
    fn of(found: &[Stored], part: &Rect, radius: f64, farthest: f64) -> Self {
        let Some(&origin) = found.first() else {
            return Self::default();
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
        let points = nearest.len() as u64;
        let nearest = nearest.into_iter().flatten();
        Self {
            points,
            distances: DistanceSums::of(nearest.clone()),
            least: nearest.reduce(f64::min),
        }
    }

    fn add(&mut self, other: &Self) {
        self.points += other.points;
        self.distances.add(&other.distances);
        self.least = self.least.into_iter().chain(other.least).reduce(f64::min);
    }

    fn figures(&self, radius: f64) -> NearestFigures {
        let DistanceSums {
            count,
            sum,
            squares,
        } = self.distances;
        let mean = sum / count as f64;
        let variance = (squares / count as f64 - mean * mean).max(0.0);
        NearestFigures {
            points: self.points,
            spacing: radius,
            mean,
            cv: variance.sqrt() / mean,
            least: self.least.unwrap_or(f64::INFINITY),
        }
    }
}
