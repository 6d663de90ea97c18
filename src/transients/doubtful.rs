//! Voxels whose points are of one visit, and the sight lines that passed by these points.

use std::sync::atomic::{AtomicU32, Ordering};

use super::{
    sight_line::SightLine,
    visits::{Moment, SingleVisit, Visits},
    voxel::{Voxel, VoxelGrid, VoxelMap},
};

/// The edge of a brick, in edges of voxels.
const BRICK: f64 = 4.0;
/// The distance from the middle of a voxel's points within which a sight line counts, in edges of voxels.
pub(super) const BESIDE: f64 = 0.5;

/// The numbers of sight lines that passed by the points of a voxel.
#[derive(Debug, Default)]
pub(super) struct Passed {
    /// In the visit that saw the points.
    pub(super) own: AtomicU32,
    /// In other visits.
    pub(super) others: AtomicU32,
}

/// Voxels whose points are of one visit.
#[derive(Debug)]
pub(crate) struct DoubtfulVoxels {
    grid: VoxelGrid,
    /// In the order of the voxels.
    pub(super) visits: Vec<SingleVisit>,
    pub(super) passed: Vec<Passed>,
    bricks: VoxelGrid,
    /// For each brick the first of its places in `near` and the one after the last.
    places: VoxelMap<[u32; 2]>,
    /// The numbers of the voxels by whose points a sight line through the brick may pass, brick by brick.
    near: Vec<u32>,
}

impl DoubtfulVoxels {
    /// The doubtful voxels among all `visits`.
    pub(crate) fn among(all: Visits) -> Self {
        let grid = all.grid();
        let visits = all.single();
        drop(all);
        let bricks = VoxelGrid {
            edge: BRICK * grid.edge,
        };
        let mut pairs: Vec<(Voxel, u32)> = Vec::new();
        for (visit, number) in visits.iter().zip(0..) {
            let corner =
                |by: f64| bricks.voxel(visit.middle(grid).add_scalar(by * BESIDE * grid.edge));
            let (low, high) = (corner(-1.0), corner(1.0));
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    pairs.extend((low[2]..=high[2]).map(|z| ([x, y, z], number)));
                }
            }
        }
        pairs.sort_unstable();
        let mut places = VoxelMap::default();
        let mut start = 0;
        for pairs in pairs.chunk_by(|a, b| a.0 == b.0) {
            let end = start + pairs.len() as u32;
            places.insert(pairs[0].0, [start, end]);
            start = end;
        }
        Self {
            grid,
            passed: visits.iter().map(|_| Passed::default()).collect(),
            visits,
            bricks,
            places,
            near: pairs.into_iter().map(|(_, number)| number).collect(),
        }
    }

    /// Counts a sight line of this moment at all points that it passed by.
    pub(crate) fn look(&self, line: SightLine, moment: Moment) {
        for brick in line.voxels(self.bricks) {
            let Some(&[start, end]) = self.places.get(&brick) else {
                continue;
            };
            for &number in &self.near[start as usize..end as usize] {
                let visit = &self.visits[number as usize];
                // A line that passes several bricks of the voxel counts in the one where it is nearest.
                let nearest = line.nearest_within(visit.middle(self.grid), BESIDE * self.grid.edge);
                if nearest.is_some_and(|place| self.bricks.voxel(place) == brick) {
                    let passed = &self.passed[number as usize];
                    let lines = match visit.times.contain(moment) {
                        true => &passed.own,
                        false => &passed.others,
                    };
                    lines.fetch_add(1, Ordering::Relaxed);
                }
            }
        }
    }

    pub(super) fn grid(&self) -> VoxelGrid {
        self.grid
    }
}
