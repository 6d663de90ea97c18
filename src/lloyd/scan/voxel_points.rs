//! The few points that a voxel keeps, found as its points come one by one.

use std::{cmp::Ordering, mem};

use super::thinned::PointSum;
use crate::geometry::Stored;

/// Largest number of points that a voxel keeps.
pub(crate) const MOST_IN_VOXEL: usize = 4;

/// The points behind the indices that a voxel keeps.
pub(crate) trait PointsByIndex {
    /// What tells points of a voxel apart: those that have it in common count once.
    type Identity: Ord;

    /// The identity of the point of this index.
    fn identity(&self, index: u32) -> Self::Identity;

    /// The order of two points that have their identity in common: the first is kept.
    fn order(&self, a: u32, b: u32) -> Ordering;
}

/// The points of a voxel: the first by priority, and the sum of all.
///
/// As long as there are no more points than a voxel keeps, all are kept, equal ones, too. The outcome
/// does not depend on the order in which the points come.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct VoxelPoints {
    /// The sum of all points.
    all: PointSum,
    /// The priorities and the indices of the points that are kept, in their order if the voxel is
    /// crowded; the first `count` are used.
    priorities: [u64; MOST_IN_VOXEL],
    indices: [u32; MOST_IN_VOXEL],
    count: u8,
    /// Whether there have been more points than a voxel keeps: equal ones count once then.
    is_crowded: bool,
}

impl VoxelPoints {
    /// A voxel that has more points than it keeps.
    pub(super) fn crowded() -> Self {
        Self {
            is_crowded: true,
            ..Self::default()
        }
    }

    /// Adds a point with its `priority` and its index among `points`. Calls `leave` with the index of
    /// every point that is not kept any more, that of the point itself included.
    #[inline]
    pub(crate) fn add(
        &mut self,
        point: Stored,
        priority: u64,
        index: u32,
        points: &impl PointsByIndex,
        mut leave: impl FnMut(u32),
    ) {
        self.all.add(point);
        if self.is_crowded && self.is_full() && priority > self.priorities[MOST_IN_VOXEL - 1] {
            leave(index);
        } else {
            self.keep(priority, index, points, &mut leave);
        }
    }

    /// The indices of the points that are kept.
    pub(crate) fn kept(&self) -> &[u32] {
        &self.indices[..self.count.into()]
    }

    /// The sum of the points that are not kept; `point` gives the point of an index.
    pub(crate) fn others(&self, point: impl Fn(u32) -> Stored) -> PointSum {
        let mut others = self.all;
        for &index in self.kept() {
            others.remove(point(index));
        }
        others
    }

    fn is_full(&self) -> bool {
        usize::from(self.count) == MOST_IN_VOXEL
    }

    /// Keeps the point of this `priority` and `index` if it is among the first.
    fn keep(
        &mut self,
        priority: u64,
        index: u32,
        points: &impl PointsByIndex,
        leave: &mut impl FnMut(u32),
    ) {
        if !self.is_crowded {
            if !self.is_full() {
                self.priorities[usize::from(self.count)] = priority;
                self.indices[usize::from(self.count)] = index;
                self.count += 1;
                return;
            }
            self.set_crowded(points, leave);
        }
        self.insert(priority, index, points, leave);
    }

    /// Sorts the points that are kept, and leaves out equal ones, since the voxel has more.
    fn set_crowded(&mut self, points: &impl PointsByIndex, leave: &mut impl FnMut(u32)) {
        self.is_crowded = true;
        let (priorities, indices) = (self.priorities, self.indices);
        for k in 0..usize::from(mem::take(&mut self.count)) {
            self.insert(priorities[k], indices[k], points, leave);
        }
    }

    /// Keeps a point of a crowded voxel if it is among the first, at its place in their order.
    fn insert(
        &mut self,
        priority: u64,
        index: u32,
        points: &impl PointsByIndex,
        leave: &mut impl FnMut(u32),
    ) {
        let order = |k: usize| {
            let by_priority = self.priorities[k].cmp(&priority);
            by_priority
                .then_with(|| (points.identity(self.indices[k])).cmp(&points.identity(index)))
        };
        let count = usize::from(self.count);
        let at = (0..count).find(|&k| order(k).is_ge()).unwrap_or(count);
        if at < count && order(at).is_eq() {
            let known = &mut self.indices[at];
            leave(match points.order(index, *known) {
                Ordering::Less => mem::replace(known, index),
                _ => index,
            });
            return;
        }
        if at == MOST_IN_VOXEL {
            leave(index);
            return;
        }
        if self.is_full() {
            leave(self.indices[MOST_IN_VOXEL - 1]);
        } else {
            self.count += 1;
        }
        let end = usize::from(self.count);
        self.priorities[at..end].rotate_right(1);
        self.indices[at..end].rotate_right(1);
        self.priorities[at] = priority;
        self.indices[at] = index;
    }
}
