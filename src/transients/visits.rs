//! When the points of each voxel were seen.

use std::collections::hash_map::Entry;

use super::voxel::{Voxel, VoxelGrid, VoxelMap, around};
use crate::geometry::Local;

/// The time (s) that a visit of a place takes, at most, and that passes between two visits, at least.
pub(super) const LONGEST_VISIT: f64 = 60.0;
/// The places in a voxel along an axis that are told apart.
const PLACES: f64 = 256.0;
/// The moments of a second.
const MOMENTS_PER_SECOND: f64 = 8.0;
/// The bytes that a voxel takes at most, while the map grows or while doubtful voxels are listed.
const BYTES_PER_VOXEL: u64 = 128;

/// A time, in eighths of a second since the scanner's way began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Moment(u32);

impl Moment {
    /// The longest visit, in moments.
    const VISIT: u32 = (LONGEST_VISIT * MOMENTS_PER_SECOND) as u32;

    /// The moment that is `seconds` after the beginning of the way; the first for times before it, and for none.
    pub(crate) fn after(seconds: f64) -> Self {
        Self((seconds * MOMENTS_PER_SECOND) as u32)
    }
}

/// From when to when the points of a place were seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Times {
    first: Moment,
    last: Moment,
}

impl Times {
    /// Whether all points were seen in one visit.
    fn are_of_one_visit(self) -> bool {
        self.last.0 - self.first.0 <= Moment::VISIT
    }

    /// Whether `moment` is of the same visit as these times, which are of one.
    pub(super) fn contain(self, moment: Moment) -> bool {
        (self.first.0.saturating_sub(Moment::VISIT)..=self.last.0.saturating_add(Moment::VISIT))
            .contains(&moment.0)
    }

    /// The times of all points of both.
    fn with(self, other: Self) -> Self {
        Self {
            first: self.first.min(other.first),
            last: self.last.max(other.last),
        }
    }

    /// Whether all of `other` are of the same visit as these, which are of one.
    fn contain_all(self, other: Self) -> bool {
        self.contain(other.first) && self.contain(other.last)
    }
}

/// What is known of the points of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Seen {
    points: u32,
    /// The sums of the points' places in the voxel, in units of which an edge has [`PLACES`].
    sums: [u32; 3],
    times: Times,
}

impl Seen {
    /// Adds what is known of other points of the voxel.
    fn add(&mut self, other: Self) {
        self.points = self.points.saturating_add(other.points);
        for (sum, more) in self.sums.iter_mut().zip(other.sums) {
            *sum = sum.saturating_add(more);
        }
        self.times = self.times.with(other.times);
    }
}

/// The points of one visit in a voxel that has no others.
#[derive(Clone, Copy, Debug)]
pub(super) struct SingleVisit {
    pub(super) voxel: Voxel,
    pub(super) points: u32,
    pub(super) times: Times,
    /// Where in the voxel the middle of the points is, in units of which an edge has [`PLACES`].
    middle: [u8; 3],
    /// Whether all points in the voxels around were seen in the same visit, too.
    pub(super) is_alone: bool,
}

impl SingleVisit {
    /// The middle of the points (local coordinates).
    pub(super) fn middle(&self, grid: VoxelGrid) -> Local {
        let along = |axis: usize| {
            let within = f64::from(self.middle[axis]) + 0.5;
            (f64::from(self.voxel[axis]) + within / PLACES) * grid.edge
        };
        Local::new(along(0), along(1), along(2))
    }
}

/// When the points of each voxel were seen.
#[derive(Debug)]
pub(crate) struct Visits {
    grid: VoxelGrid,
    seen: VoxelMap<Seen>,
}

impl Visits {
    /// No points, on this grid.
    pub(crate) fn new(grid: VoxelGrid) -> Self {
        Self {
            grid,
            seen: VoxelMap::default(),
        }
    }

    /// Adds a point (local coordinates) that was seen at this moment.
    pub(crate) fn add(&mut self, place: Local, moment: Moment) {
        let (voxel, within) = self.grid.locate(place);
        self.add_to(
            voxel,
            Seen {
                points: 1,
                sums: [within.x, within.y, within.z].map(|c| (c * PLACES) as u32),
                times: Times {
                    first: moment,
                    last: moment,
                },
            },
        );
    }

    /// Moves all points of `other`, which has the same grid, to these.
    pub(crate) fn take(&mut self, other: &mut Self) {
        for (voxel, seen) in other.seen.drain() {
            self.add_to(voxel, seen);
        }
    }

    fn add_to(&mut self, voxel: Voxel, seen: Seen) {
        match self.seen.entry(voxel) {
            Entry::Occupied(mut known) => known.get_mut().add(seen),
            Entry::Vacant(room) => {
                room.insert(seen);
            }
        }
    }

    /// The number of voxels with points.
    pub(crate) fn voxels(&self) -> usize {
        self.seen.len()
    }

    /// The bytes that all this takes at most, with what is found from it.
    pub(crate) fn bytes(&self) -> u64 {
        self.seen.len() as u64 * BYTES_PER_VOXEL
    }

    /// Whether all points were seen in one visit: no other looked through what it saw.
    pub(crate) fn are_one(&self) -> bool {
        let times = self.seen.values().map(|seen| seen.times);
        times
            .reduce(Times::with)
            .is_none_or(Times::are_of_one_visit)
    }

    pub(super) fn grid(&self) -> VoxelGrid {
        self.grid
    }

    /// The voxels whose points are all of one visit, in the order of the voxels.
    pub(super) fn single(&self) -> Vec<SingleVisit> {
        let single = self
            .seen
            .iter()
            .filter(|(_, seen)| seen.times.are_of_one_visit());
        let mut single: Vec<SingleVisit> = single
            .map(|(&voxel, seen)| SingleVisit {
                voxel,
                points: seen.points,
                times: seen.times,
                middle: seen.sums.map(|sum| (sum / seen.points) as u8),
                is_alone: around(voxel)
                    .filter_map(|near| self.seen.get(&near))
                    .all(|near| seen.times.contain_all(near.times)),
            })
            .collect();
        single.sort_unstable_by_key(|visit| visit.voxel);
        single
    }
}
