//! Nearest neighbours beyond what a part of a measurement sees.
//!
//! A part sees a few spacings around its core. The points whose nearest neighbour is farther than that are few:
//! they wait, and are looked up in all parts, the nearest part first. A part is read only if one of the waiting
//! points can have a nearer neighbour in it, by the distance from the point to the core of the part.

use rayon::prelude::*;

use super::{bare_points::gather_bare, measurement::Measurement};
use crate::{
    geometry::{Local, NearestPoints, Rect, Stored},
    job::JobError,
    quality::DistanceTally,
    tiling::Tile,
};

/// Points that wait at most, with 28 bytes each while they are looked up.
const MAX_WAITING_POINTS: usize = 100_000;

/// Points of a cloud that wait for their nearest neighbour in it.
pub(super) struct FarNeighbors<'a> {
    measurement: &'a Measurement<'a>,
    waiting: Vec<Stored>,
    tally: DistanceTally,
}

impl<'a> FarNeighbors<'a> {
    /// No waiting points.
    pub(super) fn new(measurement: &'a Measurement<'a>) -> Self {
        Self {
            measurement,
            waiting: Vec::new(),
            tally: DistanceTally::new(measurement.spacing),
        }
    }

    /// Adds a point. Points at its own position are not its neighbours.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read.
    pub(super) fn push(&mut self, point: Stored) -> Result<(), JobError> {
        self.waiting.push(point);
        if self.waiting.len() == MAX_WAITING_POINTS {
            self.look_up()?;
        }
        Ok(())
    }

    /// The distances from all points to their nearest neighbours; nothing for a point without any.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read.
    pub(super) fn into_distances(mut self) -> Result<DistanceTally, JobError> {
        self.look_up()?;
        Ok(self.tally)
    }

    /// Finds the nearest neighbours of the waiting points, which then wait no longer.
    fn look_up(&mut self) -> Result<(), JobError> {
        let Some(bounds) = bounding_rectangle(&self.waiting) else {
            return Ok(());
        };
        let quantization = self.measurement.quantization;
        let mut parts: Vec<&Tile> = self.measurement.plan.tiles.iter().collect();
        parts.sort_by_key(|part| (gap(&part.core, &bounds), part.id));
        let mut nearest_squared = vec![f64::INFINITY; self.waiting.len()];
        for part in parts {
            // Only points that are nearer to the part than to their nearest neighbour so far.
            let may_gain = |&index: &usize| {
                let away = (-part.core.depth(self.waiting[index])).max(0) as f64;
                (away * quantization.scale).powi(2) <= nearest_squared[index]
            };
            let asking: Vec<usize> = (0..nearest_squared.len()).filter(may_gain).collect();
            if asking.is_empty() {
                continue;
            }
            let points = gather_bare(self.measurement.spill, &part.core)?;
            let points: Vec<Local> = points.into_iter().map(|p| quantization.local(p)).collect();
            let tree = NearestPoints::new(&points);
            let distance_squared = |&index: &usize| {
                let position = quantization.local(self.waiting[index]);
                let nearest = tree.nearest_elsewhere(position);
                nearest.map_or(f64::INFINITY, |(_, squared)| squared)
            };
            let found: Vec<f64> = asking.par_iter().map(distance_squared).collect();
            for (index, squared) in asking.into_iter().zip(found) {
                nearest_squared[index] = nearest_squared[index].min(squared);
            }
        }
        self.waiting.clear();
        for squared in nearest_squared.into_iter().filter(|d| d.is_finite()) {
            self.tally.push(squared.sqrt());
        }
        Ok(())
    }
}

/// The bounding rectangle of `points`; `None` if there is none.
fn bounding_rectangle(points: &[Stored]) -> Option<Rect> {
    let of_point = |p: &Stored| Rect {
        min: [p.x.into(), p.y.into()],
        max: [i64::from(p.x) + 1, i64::from(p.y) + 1],
    };
    Rect::around(points.iter().map(of_point))
}

/// The distance of two rectangles along the axis on which it is larger, in stored units; 0 if they meet.
fn gap(a: &Rect, b: &Rect) -> i64 {
    let along = |axis: usize| (a.min[axis] - b.max[axis]).max(b.min[axis] - a.max[axis]);
    along(0).max(along(1)).max(0)
}
