//! The bounding box of a cloud in stored units.

use crate::geometry::Stored;

/// The bounding box of points in stored units; `min` exceeds `max` if there is no point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Bounds {
    /// The least x, y and z.
    pub(crate) min: [i32; 3],
    /// The largest x, y and z.
    pub(crate) max: [i32; 3],
}

impl Bounds {
    /// The box of no point.
    pub(crate) fn empty() -> Self {
        Self {
            min: [i32::MAX; 3],
            max: [i32::MIN; 3],
        }
    }

    /// Extends the box to `point`.
    #[inline]
    pub(crate) fn grow(&mut self, point: Stored) {
        let point = [point.x, point.y, point.z];
        self.join(&Self {
            min: point,
            max: point,
        });
    }

    /// Extends the box to that of other points.
    #[inline]
    pub(crate) fn join(&mut self, other: &Self) {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    /// The longest side in stored units; 0 if there is no point.
    pub(crate) fn extent(&self) -> i64 {
        (0..3)
            .map(|axis| i64::from(self.max[axis]) - i64::from(self.min[axis]))
            .fold(0, i64::max)
    }
}
