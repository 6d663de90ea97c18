//! Which voxels contain what has gone.

use std::sync::atomic::Ordering;

use serde::Serialize;

use super::{
    doubtful::DoubtfulVoxels,
    voxel::{Voxel, VoxelGrid, VoxelMap, around},
};
use crate::geometry::Local;

/// The evidence by which a voxel is certain to be empty in other visits: minus the logarithm of the probability, one in
/// ten thousand, that sight lines found nothing but gaps in a thing that is still there.
const CERTAINTY: f64 = 9.2;
/// The least evidence for a thing on average over its voxels, as a share of [`CERTAINTY`], where no voxel counts for more than
/// that: it must have been looked through as a whole, and not at its rim alone.
const LEAST_EVIDENCE: f64 = 0.5;
/// The number of voxels that a thing has at least: a person has some twenty, and a piece of a wire between two voxels that
/// other visits saw has less.
const FEWEST_VOXELS: usize = 8;
/// The number of sight lines through a thing that are taken to have been missed where it was seen, so that a single point
/// says little about gaps.
const PRIOR_GAPS: f64 = 2.0;

/// How much one visit saw and others looked through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct TransientCounts {
    /// The number of points.
    pub(crate) points: u64,
    /// The number of things that they are of, each of which hangs together.
    pub(crate) things: u64,
    /// Whether all points were seen in one visit, so that nothing can be known to have gone.
    pub(crate) one_visit: bool,
}

/// The voxels of what one visit saw and others looked through.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TransientVoxels {
    grid: VoxelGrid,
    pub(crate) counts: TransientCounts,
    voxels: VoxelMap<()>,
}

/// The doubtful voxels as a graph: those are neighbours that share a face, an edge or a corner.
struct Graph<'a> {
    doubtful: &'a DoubtfulVoxels,
    /// The number of each voxel.
    numbers: VoxelMap<u32>,
}

impl Graph<'_> {
    /// The evidence that the voxel of this number was empty in other visits, as a share of [`CERTAINTY`], at most 1.
    fn evidence(&self, number: usize) -> f64 {
        let passed = &self.doubtful.passed[number];
        let [own, others] =
            [&passed.own, &passed.others].map(|lines| f64::from(lines.load(Ordering::Relaxed)));
        let gaps = own + PRIOR_GAPS;
        let share_of_gaps = gaps / (gaps + f64::from(self.doubtful.visits[number].points));
        (-others * share_of_gaps.ln() / CERTAINTY).min(1.0)
    }

    /// Adds to `thing` all voxels that hang together with it, if they are `wanted`; each is asked about once.
    fn grow(&self, thing: &mut Vec<usize>, mut wanted: impl FnMut(usize) -> bool) {
        let mut next = 0;
        while let Some(&number) = thing.get(next) {
            let near = around(self.doubtful.visits[number].voxel);
            let near = near.filter_map(|voxel| self.numbers.get(&voxel));
            thing.extend(near.map(|&near| near as usize).filter(|&near| wanted(near)));
            next += 1;
        }
    }
}

impl DoubtfulVoxels {
    /// Decides by the sight lines that were counted which things have gone.
    pub(crate) fn decide(&self) -> TransientVoxels {
        let visits = &self.visits;
        let numbers = visits.iter().map(|visit| visit.voxel).zip(0..).collect();
        let graph = Graph {
            doubtful: self,
            numbers,
        };
        let mut is_transient = vec![false; visits.len()];
        let mut is_known = vec![false; visits.len()];
        let mut things = 0;
        for first in 0..visits.len() {
            if is_known[first] || !visits[first].is_alone {
                continue;
            }
            is_known[first] = true;
            let mut thing = vec![first];
            graph.grow(&mut thing, |number| {
                visits[number].is_alone && !std::mem::replace(&mut is_known[number], true)
            });
            let evidence: f64 = thing.iter().map(|&number| graph.evidence(number)).sum();
            if thing.len() < FEWEST_VOXELS || evidence < LEAST_EVIDENCE * thing.len() as f64 {
                continue;
            }
            things += 1;
            for &number in &thing {
                is_transient[number] = true;
            }
            // The lowest voxels of a thing are not alone, because of what it stands on.
            graph.grow(&mut thing, |number| {
                let is_more = !is_transient[number] && graph.evidence(number) >= LEAST_EVIDENCE;
                is_transient[number] |= is_more;
                is_more
            });
        }
        let transient = visits.iter().zip(&is_transient);
        let transient = transient.filter(|(_, is)| **is).map(|(visit, _)| visit);
        TransientVoxels {
            grid: self.grid(),
            counts: TransientCounts {
                points: (transient.clone())
                    .map(|visit| u64::from(visit.points))
                    .sum(),
                things,
                one_visit: false,
            },
            voxels: transient.map(|visit| (visit.voxel, ())).collect(),
        }
    }
}

impl TransientCounts {
    /// Reads the counts from what [`TransientVoxels::to_bytes`] returns, and no voxels; `None` for other bytes.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        TransientVoxels::parts(bytes).map(|(_, counts, _)| counts)
    }
}

impl TransientVoxels {
    /// Nothing, because all points were seen in one visit.
    pub(crate) fn of_one_visit(grid: VoxelGrid) -> Self {
        Self {
            grid,
            counts: TransientCounts {
                points: 0,
                things: 0,
                one_visit: true,
            },
            voxels: VoxelMap::default(),
        }
    }

    /// All this as bytes: edge, numbers of things and points, whether there was one visit, voxels.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = self.grid.edge.to_le_bytes().to_vec();
        let TransientCounts {
            points,
            things,
            one_visit,
        } = self.counts;
        let numbers = [things, points, u64::from(one_visit)];
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
        let mut voxels: Vec<&Voxel> = self.voxels.keys().collect();
        voxels.sort_unstable();
        bytes.extend(voxels.into_iter().flatten().flat_map(|c| c.to_le_bytes()));
        bytes
    }

    /// Reads what [`Self::to_bytes`] returns; `None` for other bytes.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (grid, counts, voxels) = Self::parts(bytes)?;
        let (coordinates, []) = voxels.as_chunks::<4>() else {
            return None;
        };
        let (voxels, []) = coordinates.as_chunks::<3>() else {
            return None;
        };
        Some(Self {
            grid,
            counts,
            voxels: (voxels.iter())
                .map(|voxel| (voxel.map(i32::from_le_bytes), ()))
                .collect(),
        })
    }

    /// Divides what [`Self::to_bytes`] returns; `None` for fewer bytes than that.
    fn parts(bytes: &[u8]) -> Option<(VoxelGrid, TransientCounts, &[u8])> {
        let (numbers, voxels) = bytes.split_at_checked(32)?;
        let (&[edge, things, points, one_visit], []) = numbers.as_chunks::<8>() else {
            return None;
        };
        let grid = VoxelGrid {
            edge: f64::from_le_bytes(edge),
        };
        let counts = TransientCounts {
            points: u64::from_le_bytes(points),
            things: u64::from_le_bytes(things),
            one_visit: u64::from_le_bytes(one_visit) != 0,
        };
        Some((grid, counts, voxels))
    }

    /// Whether the point at `place` (local coordinates) is of what has gone.
    pub(crate) fn contain(&self, place: Local) -> bool {
        self.voxels.contains_key(&self.grid.voxel(place))
    }
}
