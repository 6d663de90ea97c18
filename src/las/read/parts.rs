//! The parts of an input that can be read apart from each other.

use std::ops::Range;

use super::{
    input::{EntryPoints, InputFile},
    point_filter::PointFilter,
};
use crate::las::format::chunk_table::Chunk;

/// The most parts of a file: a header's claim must not say how much is allocated.
const MOST_PARTS: u64 = 4096;

impl InputFile {
    /// Whether the `parts` that take part in a run are all points of the file.
    pub(crate) fn is_read_whole(&self, filter: &PointFilter) -> bool {
        let parts = self.parts(u64::MAX, filter);
        let points: u64 = parts.iter().map(|part| part.end - part.start).sum();
        points == self.points_claimed
    }

    /// The points of the file, by index, in parts that can be read apart from each other,
    /// each of approximately `points`. Nodes of an octree of which `filter` accepts no point, or that are finer than it takes,
    /// are left out.
    pub(crate) fn parts(&self, points: u64, filter: &PointFilter) -> Vec<Range<u64>> {
        let all = self.points_claimed;
        let points = points.max(all.div_ceil(MOST_PARTS));
        let length = match &self.entry_points {
            EntryPoints::MultiplesOf(stride) => points.div_ceil(*stride).saturating_mul(*stride),
            EntryPoints::Chunks { chunks, .. } | EntryPoints::AlikeChunks(chunks) => {
                let is_wanted = |chunk: &Chunk| {
                    let rectangle = chunk.rectangle;
                    self.reads(chunk)
                        && rectangle.is_none_or(|[min, max]| filter.may_accept(min, max))
                };
                return runs_of(chunks, points, all, is_wanted);
            }
            _ => all,
        };
        let starts = (0..all.max(1)).step_by(usize::try_from(length.max(1)).unwrap_or(usize::MAX));
        starts
            .map(|start| start..start.saturating_add(length).min(all))
            .collect()
    }
}

/// Runs of those `chunks` that are wanted, each of approximately `points`; only the first `all` points count.
fn runs_of(
    chunks: &[Chunk],
    points: u64,
    all: u64,
    is_wanted: impl Fn(&Chunk) -> bool,
) -> Vec<Range<u64>> {
    let mut runs: Vec<Range<u64>> = Vec::new();
    let mut start = 0;
    for chunk in chunks {
        let end = all.min(start + chunk.points);
        if is_wanted(chunk) && end > start {
            match runs.last_mut() {
                Some(last) if last.end == start && last.end - last.start < points => last.end = end,
                _ => runs.push(start..end),
            }
        }
        start = end;
    }
    runs
}
