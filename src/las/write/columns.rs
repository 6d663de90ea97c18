//! The columns in which an octree is written: each of few enough points to be sorted in memory.

use std::{
    cmp::Ordering,
    collections::{BTreeMap, BTreeSet},
};

use super::{octree::Octree, store::SortedRecords};

/// The deepest level of columns. A column is open in memory with a node of each level above it.
const DEEPEST_COLUMN: u32 = 12;

/// The columns of nodes in which an octree is written.
pub(super) struct ColumnPlan {
    /// The level of the nodes of which the columns consist.
    pub(super) level: u32,
    /// The positions of the columns, in the order in which they are written.
    pub(super) columns: Vec<[u32; 2]>,
}

impl ColumnPlan {
    /// Plans columns of the `octree` of `points` with at most `most` points each, if that is possible.
    pub(super) fn new(octree: &Octree, points: &dyn SortedRecords, most: u64) -> Self {
        let squares = points.squares();
        let mut last = (0, BTreeSet::from([[0, 0]]));
        for level in 0..=octree.deepest().min(DEEPEST_COLUMN) {
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
            last = (level, counts.into_keys().collect());
            if fits {
                break;
            }
        }
        let (level, occupied) = last;
        let mut columns: Vec<[u32; 2]> = occupied.into_iter().collect();
        columns.sort_by(|a, b| quarter_by_quarter(*a, *b));
        Self { level, columns }
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
