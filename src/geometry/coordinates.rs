//! The three kinds of coordinates, and the way from one to the next.
//!
//! | kind | type | meaning |
//! | --- | --- | --- |
//! | *stored* | [`Stored`] | integers on the run's one scale and offset |
//! | *world* | `[f64; 3]` | CRS units, as a surveyor reads them |
//! | *local* | [`Local`] | CRS units from the quantization's offset |
//!
//! Ownership (which cell, which tile) is decided on stored coordinates, in
//! integers, so that it is exact. Kernels see local coordinates only: at a
//! northing of 5 000 000 a rounding step of world coordinates would be noticeable. Because
//! the quantization belongs to the run and not to the tile, a point has the same
//! local coordinates, bit for bit, in every tile that sees it.

use std::cmp::Ordering;

use serde::{Deserialize, Serialize};

/// CRS units from the quantization's offset.
pub type Local = nalgebra::Vector3<f64>;

/// The order of finite positions by x, then y, then z, as that of [`Stored`].
pub(crate) fn by_position(a: &Local, b: &Local) -> Ordering {
    a.iter().partial_cmp(b.iter()).unwrap_or(Ordering::Equal)
}

/// The longest side of the box between `min` and `max` (world coordinates).
pub(crate) fn longest_side(min: [f64; 3], max: [f64; 3]) -> f64 {
    (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f64::max)
}

/// A point as stored: integers on the run's scale and offset.
///
/// Ordered by `x`, then `y`, then `z`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Stored {
    /// The coordinate eastwards (stored units).
    pub x: i32,
    /// The coordinate northwards (stored units).
    pub y: i32,
    /// The coordinate upwards (stored units).
    pub z: i32,
}

/// Least number of steps of the quantization to a spacing.
pub(crate) const MIN_STEPS_PER_SPACING: f64 = 50.0;

/// The run's one scale and offset: world = offset + scale × stored.
///
/// One scale serves the three axes, so that distances between stored points
/// are integers too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantization {
    /// CRS units per stored unit; positive.
    pub scale: f64,
    /// World coordinates of the stored origin, multiples of `scale`.
    pub offset: [f64; 3],
}

impl Quantization {
    /// World coordinates of `point`.
    #[inline]
    pub(crate) fn world(&self, point: Stored) -> [f64; 3] {
        let [x, y, z] = [point.x, point.y, point.z].map(|c| f64::from(c) * self.scale);
        [self.offset[0] + x, self.offset[1] + y, self.offset[2] + z]
    }

    /// A quantization for coordinates between `min` and `max`, at `scale` or, where
    /// that is too fine for the extent, ten times coarser until it is not. The
    /// offset is near the middle, on the grid of the scale.
    pub fn around(min: [f64; 3], max: [f64; 3], mut scale: f64) -> Self {
        let extent = longest_side(min, max);
        while extent / scale > Self::WIDEST {
            scale *= 10.0;
        }
        let step = scale * 10_000.0;
        let offset = [0, 1, 2].map(|axis| {
            let middle = 0.5 * (min[axis] + max[axis]);
            (middle / step).round() * step
        });
        // Rounding to a decimal number: a decimal scale is then written as such.
        let scale = format!("{scale:.12e}").parse().unwrap_or(scale);
        Self { scale, offset }
    }

    /// A quantization for coordinates between `min` and `max`, at `scale` or, where that leaves a `spacing`
    /// fewer than 50 steps, ten times finer until it does not: rounding must not be noticeable.
    pub(crate) fn for_spacing(
        min: [f64; 3],
        max: [f64; 3],
        mut scale: f64,
        spacing: Option<f64>,
    ) -> Self {
        let extent = longest_side(min, max);
        if let Some(spacing) = spacing.filter(|s| *s > 0.0) {
            while scale > spacing / MIN_STEPS_PER_SPACING && extent / scale < Self::WIDEST / 10.0 {
                scale /= 10.0;
            }
        }
        Self::around(min, max, scale)
    }

    /// Local coordinates of a place in world coordinates.
    #[inline]
    pub(crate) fn local_of_world(&self, world: [f64; 3]) -> Local {
        Local::from(world) - Local::from(self.offset)
    }

    /// World coordinates of `local`.
    #[inline]
    pub(crate) fn world_of_local(&self, local: Local) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.offset[axis] + local[axis])
    }

    /// The widest extent, in stored units, that is given a quantization: nearly the
    /// range of an `i32`, on both sides of the middle.
    pub(crate) const WIDEST: f64 = 0.45 * 4_294_967_296.0;

    /// Local coordinates of `point`.
    #[inline]
    pub fn local(&self, point: Stored) -> Local {
        Local::new(
            f64::from(point.x) * self.scale,
            f64::from(point.y) * self.scale,
            f64::from(point.z) * self.scale,
        )
    }

    /// The stored point nearest to `local`, halves away from zero; `None` if
    /// it is not finite or beyond the range of `i32`.
    #[inline]
    pub fn stored(&self, local: Local) -> Option<Stored> {
        Some(Stored {
            x: round(local.x / self.scale)?,
            y: round(local.y / self.scale)?,
            z: round(local.z / self.scale)?,
        })
    }

    /// The stored point nearest to `world`; `None` as for
    /// [`stored`](Self::stored).
    pub fn quantise(&self, world: [f64; 3]) -> Option<Stored> {
        self.stored(Local::new(
            world[0] - self.offset[0],
            world[1] - self.offset[1],
            world[2] - self.offset[2],
        ))
    }

    /// Stored units in `length` (CRS units), rounded up, at least one.
    ///
    /// # Panics
    ///
    /// Unless `length` is finite and the result fits an `i64`.
    pub fn units(&self, length: f64) -> i64 {
        let units = (length / self.scale).ceil();
        assert!(
            units.abs() < 9.0e18,
            "{length} is not a length on a scale of {}",
            self.scale
        );
        (units as i64).max(1)
    }
}

/// `value` rounded half away from zero, if it is an `i32`.
#[inline]
fn round(value: f64) -> Option<i32> {
    let is_within = value > f64::from(i32::MIN) - 0.5 && value < f64::from(i32::MAX) + 0.5;
    is_within.then(|| {
        // Without the function call that old processors need for it. The difference is exact.
        let towards_zero = value as i64;
        let rest = value - towards_zero as f64;
        (towards_zero + i64::from(rest >= 0.5) - i64::from(rest <= -0.5)) as i32
    })
}

/// A rectangle of the plane in stored units, half-open: `min <= c < max`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Rect {
    /// South-west corner, inside.
    pub min: [i64; 2],
    /// North-east corner, outside.
    pub max: [i64; 2],
}

impl Rect {
    /// The rectangle of all coordinates that can be stored.
    pub(crate) const EVERYWHERE: Self = Self {
        min: [i32::MIN as i64; 2],
        max: [i32::MAX as i64 + 1; 2],
    };

    /// The least rectangle that covers all of `rectangles`; `None` if there is none.
    pub(crate) fn around(rectangles: impl Iterator<Item = Self>) -> Option<Self> {
        rectangles.reduce(|a, b| Self {
            min: [0, 1].map(|axis| a.min[axis].min(b.min[axis])),
            max: [0, 1].map(|axis| a.max[axis].max(b.max[axis])),
        })
    }

    /// Whether `point` lies inside, seen from above.
    #[inline]
    pub fn contains(&self, point: Stored) -> bool {
        let (x, y) = (i64::from(point.x), i64::from(point.y));
        self.min[0] <= x && x < self.max[0] && self.min[1] <= y && y < self.max[1]
    }

    /// Whether the two share a point.
    #[inline]
    pub(crate) fn intersects(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.min[axis] < other.max[axis] && other.min[axis] < self.max[axis])
    }

    /// Whether all of `other` lies inside.
    #[inline]
    pub(crate) fn covers(&self, other: &Self) -> bool {
        (0..2).all(|axis| self.min[axis] <= other.min[axis] && other.max[axis] <= self.max[axis])
    }

    /// Grown by `margin` (stored units) on every side.
    pub(crate) fn grown(&self, margin: i64) -> Self {
        Self {
            min: self.min.map(|c| c - margin),
            max: self.max.map(|c| c + margin),
        }
    }

    /// Distance from `point` to the border, in stored units, seen from above:
    /// positive inside, negative outside (there measured along the worse
    /// axis).
    #[inline]
    pub(crate) fn depth(&self, point: Stored) -> i64 {
        let (x, y) = (i64::from(point.x), i64::from(point.y));
        (x - self.min[0])
            .min(self.max[0] - x)
            .min(y - self.min[1])
            .min(self.max[1] - y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_as_the_standard_library_does() {
        let limits = [i32::MIN, i32::MAX].map(f64::from);
        let near = |c: f64| [-1.0, -0.5, -0.3, 0.0, 0.3, 0.5, 1.0].map(|by| c + by);
        let steps = [
            0.0,
            0.5_f64.next_down(),
            -0.5_f64.next_down(),
            1.5,
            -1.5,
            7.0,
        ];
        let values = steps.into_iter().chain(limits).flat_map(near);
        for value in values.chain([f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300]) {
            let truth = value.round();
            let is_within = limits[0] <= truth && truth <= limits[1];
            assert_eq!(round(value), is_within.then_some(truth as i32), "{value}");
        }
    }

    #[test]
    fn a_point_on_a_shared_edge_has_one_home() {
        let west = Rect {
            min: [0, 0],
            max: [10, 10],
        };
        let east = Rect {
            min: [10, 0],
            max: [20, 10],
        };
        let point = Stored { x: 10, y: 3, z: 0 };
        assert!(!west.contains(point) && east.contains(point));
        assert!(!west.intersects(&east));
    }

    #[test]
    fn stored_points_survive_the_way_to_the_world_and_back() {
        let quantization = Quantization {
            scale: 0.001,
            offset: [431_000.0, 5_400_000.0, 100.0],
        };
        for c in [i32::MIN, -1, 0, 1, 77_777, i32::MAX] {
            let point = Stored {
                x: c,
                y: -(c / 2),
                z: c / 3,
            };
            assert_eq!(
                quantization.quantise(quantization.world(point)),
                Some(point)
            );
            assert_eq!(quantization.stored(quantization.local(point)), Some(point));
        }
    }

    #[test]
    fn what_is_not_a_number_or_out_of_range_is_not_stored() {
        let quantization = Quantization {
            scale: 0.001,
            offset: [0.0; 3],
        };
        for bad in [f64::NAN, f64::INFINITY, 1.0e9, -1.0e9] {
            assert_eq!(quantization.quantise([0.0, bad, 0.0]), None);
        }
    }
}
