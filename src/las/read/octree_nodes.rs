//! The nodes of an octree (COPC) among the chunks of a file: where they lie, and how dense they are.

use std::collections::BTreeMap;

use ::las::copc::{CopcHierarchyVlr, CopcInfoVlr};
use serde::{Deserialize, Serialize};

use super::input::InputFile;
use crate::las::format::chunk_table::Chunk;

/// The levels that an octree can have: beyond them bits of a node's number would be lost.
const LEVELS: std::ops::Range<i32> = 0..31;

/// The distances between points of the levels that are read, to one spacing of the output.
const DISTANCES_TO_A_SPACING: f64 = 6.0;

/// Which levels of octrees are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum OctreeLevels {
    /// All.
    #[default]
    All,
    /// From the uppermost down to one whose points are near to each other for the spacing of the output.
    Auto,
}

impl OctreeLevels {
    /// How near to each other points have to be for an output at `spacing`; `None` for all points there are.
    pub(crate) fn finest_spacing(self, spacing: Option<f64>) -> Option<f64> {
        let spacing = spacing.filter(|_| self == Self::Auto)?;
        Some(spacing / DISTANCES_TO_A_SPACING)
    }
}

/// The nodes of a level.
#[derive(Clone, Copy, Debug, Default)]
struct Level {
    nodes: u64,
    points: u64,
}

impl Level {
    /// The distance between points of the level, if they lie on surfaces through nodes with this `edge`.
    fn spacing(self, edge: f64) -> f64 {
        edge / (self.points as f64 / self.nodes as f64).sqrt()
    }
}

/// Tells each of `chunks` that is a node of the octree the rectangle of that node, and how dense the levels above it are.
pub(super) fn assign_nodes(chunks: &mut [Chunk], info: &CopcInfoVlr, hierarchy: &CopcHierarchyVlr) {
    let mut levels: BTreeMap<i32, Level> = BTreeMap::new();
    let mut nodes = Vec::new();
    for entry in hierarchy.iter_entries().flatten() {
        if !LEVELS.contains(&entry.key.l) {
            continue;
        }
        // Chunks are in the order of the file.
        if let Ok(index) = chunks.binary_search_by_key(&entry.offset, |chunk| chunk.offset) {
            let cube = entry.key.bounds(info);
            chunks[index].rectangle = Some([[cube.min.x, cube.min.y], [cube.max.x, cube.max.y]]);
            let level = levels.entry(entry.key.l).or_default();
            level.nodes += 1;
            level.points += chunks[index].points;
            nodes.push((index, entry.key.l));
        }
    }
    let above = spacings_above(&levels, info.spacing, 2.0 * info.halfsize);
    for (index, level) in nodes {
        chunks[index].spacing_above = above[&level];
    }
}

/// For each of `levels` the distance between the points of all levels above it, in an octree whose root has this `spacing`, as
/// its file states it, and this `edge`; `None` if there are none. It does not grow from level to level.
fn spacings_above(
    levels: &BTreeMap<i32, Level>,
    spacing: f64,
    edge: f64,
) -> BTreeMap<i32, Option<f64>> {
    let mut above: Option<f64> = None;
    let of_level = |(&number, level): (&i32, &Level)| {
        let before = above;
        let parts = f64::from(number).exp2();
        // What the file states is a wish of who wrote it: where nodes have fewer points these are rarer.
        let own = (spacing / parts).max(level.spacing(edge / parts));
        above = above.into_iter().chain(Some(own)).reduce(f64::min);
        (number, before.filter(|spacing| spacing.is_finite()))
    };
    levels.iter().map(of_level).collect()
}

impl InputFile {
    /// Whether `chunk` is read: it is a node of an octree only if the points above it are rarer than it takes.
    pub(super) fn reads(&self, chunk: &Chunk) -> bool {
        let needed = self.finest_spacing.zip(chunk.spacing_above);
        needed.is_none_or(|(finest, above)| above > finest)
    }

    /// What is to be said of levels that are not read, if any.
    pub(crate) fn note_on_levels(&self) -> Option<String> {
        self.finest_spacing?;
        let read = self.chunks()?.iter().filter(|chunk| self.reads(chunk));
        let points: u64 = read.map(|chunk| chunk.points).sum();
        (points < self.points_claimed).then(|| {
            format!(
                "only the upper levels of its octree are read (--levels auto), {points} of {} points",
                self.points_claimed
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(nodes: u64, points: u64) -> Level {
        Level { nodes, points }
    }

    #[test]
    fn a_level_is_as_dense_as_its_points_show_and_no_rarer_than_the_one_above() {
        let full = [
            (0, level(1, 10_000)),
            (1, level(4, 40_000)),
            (2, level(16, 100)),
        ];
        // A hundred points along an edge of 128 are 1.28 apart; a wish of 1 is not believed, one of 2 is.
        for (wish, expected) in [(1.0, [1.28, 0.64]), (2.0, [2.0, 1.0])] {
            let above = spacings_above(&full.into(), wish, 128.0);
            assert_eq!(above[&0], None);
            assert_eq!([above[&1], above[&2]], expected.map(Some));
        }
        // The few points of the second level do not make it rarer than the first: the third is read with it or not at all.
        let sparse = [(0, level(1, 10_000)), (1, level(4, 4)), (2, level(16, 100))];
        let above = spacings_above(&sparse.into(), 1.0, 128.0);
        assert_eq!(above[&2], Some(1.28));
        // Nothing is known of levels without points.
        assert_eq!(
            spacings_above(&[(0, level(1, 0)), (1, level(1, 9))].into(), 1.0, 128.0)[&1],
            None
        );
    }
}
