//! The columns in which an octree is written: each contains all points of every voxel of the
//! root in it, and few enough to be sorted in memory.

use std::{
    cmp::Ordering,
    collections::{BTreeMap, BTreeSet},
};

use super::{octree::Octree, store::SortedRecords};

/// The binary logarithm of the number of voxels along the edge of a node: more than the first
/// only if columns would not fit into memory otherwise.
const VOXEL_BITS: std::ops::RangeInclusive<u32> = 7..=9;

/// An octree, and the columns of nodes in which it is written.
pub(super) struct ColumnPlan {
    pub(super) octree: Octree,
    /// The level of the nodes of which the columns consist.
    pub(super) level: u32,
    /// The positions of the columns, in the order in which they are written.
    pub(super) columns: Vec<[u32; 2]>,
}

impl ColumnPlan {
    /// Plans an octree for `points`, which are `spacing` apart (stored units), in columns of
    /// at most `most` points if that is possible.
    pub(super) fn new(points: &dyn SortedRecords, spacing: i64, most: u64) -> Self {
        let (bounds, squares) = (points.bounds(), points.squares());
        let candidates = VOXEL_BITS.flat_map(|bits| {
            let octree = Octree::around(&bounds, spacing, bits);
            (0..=octree.deepest_column()).map(move |level| (octree, level))
        });
        let mut last = None;
        for (octree, level) in candidates {
            let mut counts = BTreeMap::<[u32; 2], u64>::new();
            // A counting square counts for every column that it touches.
            for (rect, points) in &squares {
                let [west, south] = octree.column_of(rect.min[0], rect.min[1], level);
                let [east, north] = octree.column_of(rect.max[0] - 1, rect.max[1] - 1, level);
                for x in west..=east {
                    for y in south..=north {
                        *counts.entry([x, y]).or_default() += points;
                    }
                }
            }
            let fits = counts.values().all(|&points| points <= most);
            let occupied: BTreeSet<[u32; 2]> = counts.into_keys().collect();
            last = Some((octree, level, occupied));
            if fits {
                break;
            }
        }
        let (octree, level, occupied) = last.unwrap_or_else(|| {
            let octree = Octree::around(&bounds, spacing, *VOXEL_BITS.start());
            (octree, 0, BTreeSet::from([[0, 0]]))
        });
        let mut columns: Vec<[u32; 2]> = occupied.into_iter().collect();
        columns.sort_by(|a, b| quarter_by_quarter(*a, *b));
        Self {
            octree,
            level,
            columns,
        }
    }
}

/// The order in which a square is gone through quarter by quarter, each in the same way: it
/// is decided by the axis in which the positions differ at the highest bit.
fn quarter_by_quarter(a: [u32; 2], b: [u32; 2]) -> Ordering {
    let [x, y] = [a[0] ^ b[0], a[1] ^ b[1]];
    // Whether the highest bit of `x` is below that of `y`.
    let y_decides = x < y && x < (x ^ y);
    match y_decides {
        true => a[1].cmp(&b[1]),
        false => a[0].cmp(&b[0]),
    }
}
