//! The node of an octree that each point belongs to, whatever the order of the points.
//!
//! A node at level *l* is a cube, cut into equal voxels along its edges; both are half
//! as wide at the next level. At every level each voxel takes one of the points that no
//! level before has taken: the one with the highest tie-break hash. So every level is twice
//! as dense along an edge as the one before, the choice of a voxel needs no more than the
//! points in it, and a node with points below it has points itself (some readers turn back at
//! a node without).

use super::morton::{collect, interleave};
use crate::{
    geometry::{Rect, Stored},
    tiling::Bounds,
};

/// The most bits of a voxel's number along an axis: three of them are a key of 63 bits.
const MOST_VOXEL_BITS: u32 = 21;

/// The key of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct NodeKey {
    /// The level of the node, the root's being 0.
    pub(super) level: u32,
    /// The position of the node among the cubes of its level.
    pub(super) position: [u32; 3],
}

impl NodeKey {
    /// The parent of the node; `None` of the root.
    #[cfg(test)]
    fn parent(self) -> Option<Self> {
        Some(Self {
            level: self.level.checked_sub(1)?,
            position: self.position.map(|c| c >> 1),
        })
    }
}

/// A cube of stored units, with its levels, nodes and voxels. It is no larger than
/// necessary: some readers take the header's bounds for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Octree {
    /// The least coordinates in the cube.
    corner: [i64; 3],
    /// The edge of the cube; nodes and voxels are its halves, quarters and so on.
    edge: i64,
    /// The deepest level.
    deepest: u32,
    /// The binary logarithm of the number of voxels along the edge of a node.
    voxel_bits: u32,
}

impl Octree {
    /// An octree around `bounds`, whose deepest level has voxels no wider than the
    /// `spacing` of the points (stored units), unless there are too many of them.
    pub(super) fn around(bounds: &Bounds, spacing: i64, voxel_bits: u32) -> Self {
        let edge = bounds.extent().max(1);
        let most = MOST_VOXEL_BITS - voxel_bits;
        Self {
            corner: bounds.min.map(i64::from),
            edge,
            deepest: (0..most)
                .find(|level| edge >> (voxel_bits + level) < spacing)
                .unwrap_or(most),
            voxel_bits,
        }
    }

    /// The edge of the cube in stored units.
    pub(super) fn edge(&self) -> i64 {
        self.edge
    }

    /// The least coordinates of the cube, in stored units.
    pub(super) fn corner(&self) -> [i64; 3] {
        self.corner
    }

    /// The width of the voxels of the root, in stored units.
    pub(super) fn root_spacing(&self) -> f64 {
        self.edge as f64 / f64::from(1 << self.voxel_bits)
    }

    /// The deepest level whose columns contain each of the root's voxels whole or not at
    /// all, so that points can be chosen column by column.
    pub(super) fn deepest_column(&self) -> u32 {
        self.voxel_bits.min(self.deepest)
    }

    /// The index of the part in which `c` lies, of 2^`bits` equal parts of the cube; the far
    /// side of the cube belongs to the last one.
    fn part(&self, c: i64, axis: usize, bits: u32) -> u32 {
        let most = (1 << bits) - 1;
        (((c - self.corner[axis]) << bits).div_euclid(self.edge)).clamp(0, most) as u32
    }

    /// The column of nodes at `level` that contains the position (`x`, `y`).
    pub(super) fn column_of(&self, x: i64, y: i64, level: u32) -> [u32; 2] {
        [self.part(x, 0, level), self.part(y, 1, level)]
    }

    /// The rectangle of a column of nodes at `level`, in stored units.
    pub(super) fn rect_of_column(&self, column: [u32; 2], level: u32) -> Rect {
        let begin = |axis: usize, part: u32| {
            // The first unit of the part; the end of the last part is behind the cube's far
            // side.
            let rounded_up = (i64::from(part) * self.edge + (1 << level) - 1) >> level;
            self.corner[axis] + rounded_up + i64::from(part == 1 << level)
        };
        Rect {
            min: [begin(0, column[0]), begin(1, column[1])],
            max: [begin(0, column[0] + 1), begin(1, column[1] + 1)],
        }
    }

    /// The key of the voxel of `point` at the deepest level: its numbers in Morton order.
    pub(super) fn voxel_key(&self, point: Stored) -> u64 {
        let bits = self.voxel_bits + self.deepest;
        let number = |c: i32, axis: usize| u64::from(self.part(c.into(), axis, bits));
        interleave(number(point.x, 0))
            | interleave(number(point.y, 1)) << 1
            | interleave(number(point.z, 2)) << 2
    }

    /// The node at `level` that contains the voxel of `key`.
    pub(super) fn node(&self, key: u64, level: u32) -> NodeKey {
        let key = key >> (3 * (self.deepest - level + self.voxel_bits));
        NodeKey {
            level,
            position: [0, 1, 2].map(|axis| collect(key >> axis)),
        }
    }

    /// The level of each of `points`, which are sorted by the key of their voxel, and are all
    /// points of the root's voxels in which they lie.
    pub(super) fn levels(&self, points: &[(u64, Stored)]) -> Vec<u8> {
        let mut levels = vec![u8::MAX; points.len()];
        let mut start = 0;
        let root = |key: u64| key >> (3 * self.deepest);
        while let Some(&(key, _)) = points.get(start) {
            let length = points[start..].partition_point(|&(k, _)| root(k) == root(key));
            let voxel = start..start + length;
            self.choose(&points[voxel.clone()], 0, &mut levels[voxel]);
            start += length;
        }
        levels
    }

    /// Gives a level to those points of a voxel at `level` that have none yet.
    fn choose(&self, points: &[(u64, Stored)], level: u32, levels: &mut [u8]) {
        let best = (0..points.len())
            .filter(|&i| levels[i] == u8::MAX)
            .max_by_key(|&i| (points[i].1.tie_break_hash(), points[i].1));
        let Some(best) = best else {
            return;
        };
        levels[best] = level as u8;
        if level == self.deepest {
            for unchosen in levels.iter_mut().filter(|l| **l == u8::MAX) {
                *unchosen = level as u8;
            }
            return;
        }
        let child = |key: u64| key >> (3 * (self.deepest - level - 1));
        let mut start = 0;
        while start < points.len() {
            let key = child(points[start].0);
            let end = start + points[start..].partition_point(|&(k, _)| child(k) == key);
            self.choose(&points[start..end], level + 1, &mut levels[start..end]);
            start = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::{HashMap, HashSet};

    use super::*;
    use crate::geometry::spread;

    fn cloud(n: u64) -> Vec<Stored> {
        let c = |i: u64, k: u64| (spread(3 * i + k) % 4000) as i32 - 1700;
        (0..n)
            .map(|i| Stored {
                x: c(i, 0),
                y: c(i, 1),
                z: c(i, 2) / 50,
            })
            .collect()
    }

    fn sorted(octree: &Octree, cloud: &[Stored]) -> Vec<(u64, Stored)> {
        let mut points: Vec<_> = cloud.iter().map(|&p| (octree.voxel_key(p), p)).collect();
        points.sort_unstable();
        points
    }

    fn around(cloud: &[Stored], spacing: i64, voxel_bits: u32) -> Octree {
        let all = |of: fn(&Stored) -> i32| cloud.iter().map(of);
        let axes: [fn(&Stored) -> i32; 3] = [|p| p.x, |p| p.y, |p| p.z];
        let bounds = Bounds {
            min: axes.map(|axis| all(axis).min().unwrap()),
            max: axes.map(|axis| all(axis).max().unwrap()),
        };
        Octree::around(&bounds, spacing, voxel_bits)
    }

    /// The slow twin visits all points for each level.
    #[test]
    fn every_voxel_takes_one_of_the_points_that_are_left() {
        let cloud = cloud(3000);
        let octree = around(&cloud, 40, 2);
        let points = sorted(&octree, &cloud);
        let levels = octree.levels(&points);
        let mut truth = vec![octree.deepest; points.len()];
        let mut left: Vec<usize> = (0..points.len()).collect();
        for level in 0..octree.deepest {
            let mut best = HashMap::<u64, usize>::new();
            for &i in &left {
                let voxel = points[i].0 >> (3 * (octree.deepest - level));
                let rank = |i: usize| (points[i].1.tie_break_hash(), points[i].1);
                let taken = best.entry(voxel).or_insert(i);
                if rank(i) > rank(*taken) {
                    *taken = i;
                }
            }
            for taken in best.into_values() {
                truth[taken] = level;
                left.retain(|&i| i != taken);
            }
        }
        assert!(levels.iter().zip(&truth).all(|(&l, &t)| u32::from(l) == t));
        // A node with points below it has points.
        let node = |i: usize| octree.node(points[i].0, levels[i].into());
        let nodes: HashSet<NodeKey> = (0..points.len()).map(node).collect();
        let parents: HashSet<NodeKey> = nodes.iter().filter_map(|key| key.parent()).collect();
        assert!(
            parents.is_subset(&nodes) && nodes.len() > 50,
            "{}",
            nodes.len()
        );
    }

    #[test]
    fn a_node_contains_its_points() {
        let cloud = cloud(2000);
        let octree = around(&cloud, 30, 3);
        for (key, point) in sorted(&octree, &cloud) {
            for level in 0..=octree.deepest {
                let node = octree.node(key, level);
                let edge = octree.edge as f64 / f64::from(1 << level);
                let coordinates = [point.x, point.y, point.z];
                for axis in 0..3 {
                    let low = octree.corner[axis] as f64 + f64::from(node.position[axis]) * edge;
                    assert!((low..=low + edge).contains(&f64::from(coordinates[axis])));
                }
                let column = [node.position[0], node.position[1]];
                assert!(octree.rect_of_column(column, level).contains(point));
                let found = octree.column_of(point.x.into(), point.y.into(), level);
                assert_eq!(found, column);
            }
        }
    }

    #[test]
    fn the_widest_cloud_has_keys() {
        let ends = [i32::MIN, i32::MAX].map(|c| Stored { x: c, y: c, z: c });
        let octree = around(&ends, 1, 7);
        for level in [0, octree.deepest] {
            for end in ends {
                let node = octree.node(octree.voxel_key(end), level);
                assert!(node.position.iter().all(|&c| c < 1 << level));
            }
        }
    }
}
