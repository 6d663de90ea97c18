//! The bounding box of a cloud in stored units.

use crate::geometry::Stored;

/// The true bounds of the points, in stored units; inverted if there are none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bounds {
    /// Smallest coordinates.
    pub(crate) min: [i32; 3],
    /// Largest coordinates.
    pub(crate) max: [i32; 3],
}

impl Bounds {
    pub(crate) fn empty() -> Self {
        Self {
            min: [i32::MAX; 3],
            max: [i32::MIN; 3],
        }
    }

    pub(crate) fn grow(&mut self, point: Stored) {
        let point = [point.x, point.y, point.z];
        self.join(&Self {
            min: point,
            max: point,
        });
    }

    pub(crate) fn join(&mut self, other: &Self) {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    /// The longest side in stored units; 0 if there are no points.
    pub(crate) fn extent(&self) -> i64 {
        (0..3)
            .map(|axis| i64::from(self.max[axis]) - i64::from(self.min[axis]))
            .fold(0, i64::max)
    }
}
