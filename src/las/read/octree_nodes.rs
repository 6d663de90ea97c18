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
    // What the file states of the spacing is a wish of who wrote it. Points are rarer where nodes have fewer.
    let (mut above, mut spacing_above) = (None, BTreeMap::new());
    for (&number, level) in &levels {
        spacing_above.insert(number, above);
        let halvings = f64::from(number);
        let stated = info.spacing / halvings.exp2();
        let found = level.spacing(2.0 * info.halfsize / halvings.exp2());
        above = Some(stated.max(found)).filter(|spacing| spacing.is_finite());
    }
    for (index, level) in nodes {
        chunks[index].spacing_above = spacing_above[&level];
    }
}

impl InputFile {
    /// Whether `chunk` is read: it is a node of an octree only if the points above it are rarer than it takes.
    pub(super) fn reads(&self, chunk: &Chunk) -> bool {
        let needed = self.finest_spacing.zip(chunk.spacing_above);
        needed.is_none_or(|(finest, above)| above > finest)
    }

    /// What is to be said of levels that are not read, if any.
    pub(crate) fn note_on_levels(&self) -> Option<String> {
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
