//! Thinned points: those that are kept, and the sums of the others.

use crate::geometry::{Local, Quantization, Stored};

/// Points of one voxel as the sum of their coordinates. Sums of integers do not depend on the
/// order of the points, nor on how they are grouped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PointSum {
    /// Number of points.
    pub(crate) count: u64,
    /// Sums of their stored coordinates.
    pub(crate) sum: [i64; 3],
}

impl PointSum {
    /// The sum of `count` points that are equal to `point`.
    pub(super) fn of_equal(point: Stored, count: u64) -> Self {
        let times = |c: i32| i64::from(c) * count as i64;
        Self {
            count,
            sum: [point.x, point.y, point.z].map(times),
        }
    }

    /// Adds one point.
    #[inline]
    pub(crate) fn add(&mut self, point: Stored) {
        self.count += 1;
        let [x, y, z] = &mut self.sum;
        *x += i64::from(point.x);
        *y += i64::from(point.y);
        *z += i64::from(point.z);
    }

    /// Takes away one of the points.
    #[inline]
    pub(super) fn remove(&mut self, point: Stored) {
        self.count -= 1;
        let [x, y, z] = &mut self.sum;
        *x -= i64::from(point.x);
        *y -= i64::from(point.y);
        *z -= i64::from(point.z);
    }

    /// Adds the points of `other`.
    #[inline]
    pub(crate) fn merge(&mut self, other: &Self) {
        self.count += other.count;
        for (sum, more) in self.sum.iter_mut().zip(other.sum) {
            *sum += more;
        }
    }

    /// The mean of the points, rounded down: it lies in their voxel, since a voxel contains all
    /// stored coordinates between two of its own.
    #[inline]
    pub(crate) fn mean(&self) -> Stored {
        let count = self.count.max(1) as i64;
        let [x, y, z] = self.sum.map(|sum| sum.div_euclid(count) as i32);
        Stored { x, y, z }
    }

    /// The mean of the points, of which there is at least one, in local coordinates.
    pub(crate) fn local_mean(&self, quantization: &Quantization) -> Local {
        let weight = quantization.scale / self.count as f64;
        Local::from(self.sum.map(|sum| sum as f64 * weight))
    }
}

/// Points of which a voxel keeps a few, with the sums of those that are not kept.
#[derive(Clone, Debug, Default)]
pub(crate) struct ThinnedPoints {
    /// The points that are kept.
    pub(crate) kept: Vec<Stored>,
    /// The sums of points that are not kept, any number to a voxel.
    pub(crate) sums: Vec<PointSum>,
    /// What is known of each point that is kept; empty if the spacing is the same everywhere.
    pub(crate) tags: Vec<PointTag>,
}

/// What rules for the spacing know of a point. Points at one position of which they know different things are
/// different points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointTag {
    /// The spacing that is wanted at the point, as a share of the coarsest; positive, and infinite if nothing is wanted.
    pub(crate) share: f32,
    /// The rules that look at the points around, too, and apply to the point by itself: one bit each.
    pub(crate) open: u16,
    /// Whether the point is one of the ground.
    pub(crate) is_ground: bool,
}

impl PointTag {
    /// Tags in an order: the finest comes first.
    pub(super) fn rank(&self) -> (u32, u16, bool) {
        (self.share.to_bits(), self.open, self.is_ground)
    }
}

impl ThinnedPoints {
    /// Adds all of `other`.
    pub(crate) fn append(&mut self, mut other: Self) {
        self.kept.append(&mut other.kept);
        self.sums.append(&mut other.sums);
        self.tags.append(&mut other.tags);
    }

    /// Number of values: points and sums.
    pub(crate) fn len(&self) -> usize {
        self.kept.len() + self.sums.len()
    }
}

impl From<Vec<Stored>> for ThinnedPoints {
    /// Points that are all kept.
    fn from(kept: Vec<Stored>) -> Self {
        Self {
            kept,
            ..Self::default()
        }
    }
}
