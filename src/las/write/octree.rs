//! The cubes of an octree, and which of them each point belongs to.
//!
//! A node at level *l* is a cube; it is half as wide at the next level, and so is the spacing of the points down to that
//! level. Points are elected for levels in `nested_sets`, over the borders of nodes. So a node may have no point of its own
//! level where a neighbour's is near enough; if there are points below it, the hierarchy has it with no points.

use crate::{
    geometry::{Rect, Stored},
    tiling::Bounds,
};

/// The deepest level that an octree may have: positions of nodes at it have 24 bits.
const DEEPEST: u32 = 24;

/// The binary logarithm of the most spacings of the root along the edge of the cube.
const SPACINGS_BITS: u32 = 7;

/// The radius of the finest election in spacings of the cloud. With 1.4 and 1.5 the figures of a street are the same within
/// a hundredth; at 1.2 and 1.6 a part of the neighbours at one and at √3 spacings is on the other side.
const FINEST_RADIUS_IN_SPACINGS: f64 = 1.45;

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
    pub(super) fn parent(self) -> Option<Self> {
        Some(Self {
            level: self.level.checked_sub(1)?,
            position: self.position.map(|c| c >> 1),
        })
    }
}

/// A cube of stored units, with its levels and nodes. It is no larger than necessary: some readers take the header's bounds
/// for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Octree {
    /// The least coordinates in the cube.
    corner: [i64; 3],
    /// The edge of the cube; nodes are its halves, quarters and so on.
    edge: i64,
    /// The deepest level.
    deepest: u32,
    /// The radius of the finest election, for the level above the deepest (stored units).
    finest_radius: f64,
}

impl Octree {
    /// An octree around `bounds` for points that are `spacing` apart (stored units). There are as many levels as make the
    /// edge of a node no more than 128 spacings of its level.
    pub(super) fn around(bounds: &Bounds, spacing: f64) -> Self {
        let edge = bounds.extent().max(1);
        let finest_radius = (FINEST_RADIUS_IN_SPACINGS * spacing).max(1.0);
        // The spacing of a level is that of its election; half of the finest radius is that of the deepest level.
        let root_spacing = |deepest: u32| 0.5 * finest_radius * f64::from(1 << deepest);
        let most = f64::from(1 << SPACINGS_BITS);
        Self {
            corner: bounds.min.map(i64::from),
            edge,
            deepest: (0..DEEPEST)
                .find(|&deepest| edge as f64 <= most * root_spacing(deepest))
                .unwrap_or(DEEPEST),
            finest_radius,
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

    /// The deepest level.
    pub(super) fn deepest(&self) -> u32 {
        self.deepest
    }

    /// The radii of the elections for the levels above the deepest, in ascending order (stored units).
    pub(super) fn radii(&self) -> impl Iterator<Item = f64> + use<> {
        let finest = self.finest_radius;
        (0..self.deepest).map(move |doublings| finest * f64::from(1 << doublings))
    }

    /// The least distance of the points of the root, in stored units. It is halved from level to level.
    pub(super) fn root_spacing(&self) -> f64 {
        0.5 * self.finest_radius * f64::from(1 << self.deepest)
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

    /// The node at `level` that contains `point`.
    pub(super) fn node(&self, point: Stored, level: u32) -> NodeKey {
        NodeKey {
            level,
            position: [
                self.part(point.x.into(), 0, level),
                self.part(point.y.into(), 1, level),
                self.part(point.z.into(), 2, level),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
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

    fn around(cloud: &[Stored], spacing: f64) -> Octree {
        let mut bounds = Bounds::empty();
        cloud.iter().for_each(|&point| bounds.grow(point));
        Octree::around(&bounds, spacing)
    }

    #[test]
    fn a_node_contains_its_points_and_lies_in_its_parent() {
        let cloud = cloud(2000);
        let octree = around(&cloud, 1.5);
        assert!(octree.deepest > 3);
        for point in cloud {
            for level in 0..=octree.deepest {
                let node = octree.node(point, level);
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
                let above = level.checked_sub(1).map(|above| octree.node(point, above));
                assert_eq!(node.parent(), above);
            }
        }
    }

    #[test]
    fn spacings_are_halved_down_to_half_of_the_finest_radius() {
        for spacing in [1.0, 40.0, 900.0, 5000.0] {
            let octree = around(&cloud(2000), spacing);
            let mut level_spacing = octree.root_spacing();
            let mut radii: Vec<f64> = octree.radii().collect();
            radii.reverse();
            for radius in radii {
                assert!((radius - level_spacing).abs() < 1e-9 * radius);
                level_spacing /= 2.0;
            }
            assert!((level_spacing - 0.725 * spacing).abs() < 1e-9 * spacing);
            assert!(octree.edge as f64 <= 128.0 * octree.root_spacing());
        }
    }

    #[test]
    fn the_widest_cloud_has_nodes() {
        let ends = [i32::MIN, i32::MAX].map(|c| Stored { x: c, y: c, z: c });
        let octree = around(&ends, 1.0);
        for level in [0, octree.deepest] {
            for end in ends {
                let node = octree.node(end, level);
                assert!(node.position.iter().all(|&c| c < 1 << level));
            }
        }
    }
}
