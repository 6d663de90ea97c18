//! The road: crowned across, with two potholes in each block.

use crate::geometry::Local;

/// The length of a block of the street.
pub(super) const BLOCK_LENGTH: f64 = 20.0;
/// The distance of the kerbs from the middle of the road.
pub(super) const KERB_Y: f64 = 4.0;
/// The distance of the facades from the middle of the road.
pub(super) const FACADE_Y: f64 = 7.5;
/// The height of the kerbs.
pub(super) const KERB_HEIGHT: f64 = 0.12;

/// A dent in the road.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pothole {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) radius: f64,
    pub(super) depth: f64,
}

/// The surface of the road.
#[derive(Debug)]
pub(super) struct Road {
    /// The potholes, block by block.
    potholes: Vec<[Pothole; 2]>,
}

impl Road {
    /// A road with these potholes, block by block.
    pub(super) fn new(potholes: Vec<[Pothole; 2]>) -> Self {
        Self { potholes }
    }

    /// Returns the length of the road.
    fn length(&self) -> f64 {
        self.potholes.len() as f64 * BLOCK_LENGTH
    }

    /// Returns whether there is road below or above `point`.
    fn contains(&self, point: Local) -> bool {
        point.y.abs() <= KERB_Y && (0.0..=self.length()).contains(&point.x)
    }

    /// Returns the height at `(x, y)`.
    fn height(&self, x: f64, y: f64) -> f64 {
        let block = (x / BLOCK_LENGTH).floor().clamp(0.0, 1e9) as usize;
        let near = self.potholes.get(block).into_iter().flatten();
        let crown = 0.06 * (1.0 - (y / KERB_Y).powi(2));
        near.fold(crown, |z, hole| {
            let r = ((x - hole.x).powi(2) + (y - hole.y).powi(2)) / (hole.radius * hole.radius);
            z - if r < 1.0 {
                hole.depth * (1.0 - r).powi(2)
            } else {
                0.0
            }
        })
    }

    /// Returns the distance from `point` to the road below, above or beside it, as if the road
    /// were level there, which it nearly is.
    pub(super) fn distance(&self, point: Local) -> f64 {
        let x = point.x.clamp(0.0, self.length());
        let y = point.y.clamp(-KERB_Y, KERB_Y);
        (point - Local::new(x, y, self.height(x, y))).norm()
    }

    /// Returns the distance along the ray at which it meets the road.
    pub(super) fn hit(&self, origin: Local, direction: Local) -> Option<f64> {
        if direction.z >= -0.03 {
            // The ray meets the road beyond the range of the scanner, or never.
            return None;
        }
        // The road is nearly level: from its plane a few corrections reach it.
        let mut t = -origin.z / direction.z;
        for _ in 0..60 {
            let at = origin + direction * t;
            let next = (self.height(at.x, at.y) - origin.z) / direction.z;
            let step = next - t;
            t += 0.7 * step;
            if step.abs() < 1e-9 {
                let at = origin + direction * t;
                return (self.contains(at) && t > 0.0).then_some(t);
            }
        }
        None
    }
}
