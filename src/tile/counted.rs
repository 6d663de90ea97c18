//! A spill as a cloud that is counted by squares and gathered by rectangles.

use super::{cell_points::Spilled, error::TileError, spill::Spill};
use crate::{
    geometry::{Quantization, Rect, Stored},
    lloyd::{SolverOptions, ThinnedPoints, Thinning},
    tiling::{Bounds, CountedCloud},
};

/// Points that a thread gathers before it thins them.
const THINNED_BY_THREAD: usize = 50_000;

/// Points of a part of a rectangle, which one thread gathers.
struct PartOfRect {
    points: ThinnedPoints,
    /// They are thinned when they are more.
    limit: usize,
}

impl Default for PartOfRect {
    fn default() -> Self {
        Self {
            points: ThinnedPoints::default(),
            limit: THINNED_BY_THREAD,
        }
    }
}

impl PartOfRect {
    fn thin(&mut self, thinning: &Thinning) {
        self.points = thinning.thinned(std::mem::take(&mut self.points));
        self.limit = THINNED_BY_THREAD.max(2 * self.points.len());
    }
}

impl CountedCloud for Spill {
    type Error = TileError;

    fn points(&self) -> u64 {
        Self::points(self)
    }

    fn bounds(&self) -> Bounds {
        Self::bounds(self)
    }

    fn square_edge(&self) -> i64 {
        self.grid().square()
    }

    fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_ {
        Self::squares(self)
    }

    fn gather(
        &self,
        rect: &Rect,
        quantization: &Quantization,
        options: &SolverOptions,
        thinning_limit: u64,
    ) -> Result<ThinnedPoints, TileError> {
        let thinning = Thinning::new(quantization, options);
        let mut points = ThinnedPoints::default();
        let mut limit = thinning_limit as usize;
        self.gather_each(
            rect,
            |found: &mut PartOfRect, spilled| {
                match spilled {
                    Spilled::Record(record) => {
                        found.points.kept.push(Stored::of_record(record));
                        let tag = self.rules().map(|rules| rules.tag(record));
                        found.points.tags.extend(tag);
                    }
                    Spilled::Sum(sum) => found.points.sums.push(*sum),
                }
                if found.points.len() > found.limit {
                    found.thin(&thinning);
                }
            },
            |found| {
                points.append(found.points);
                if points.len() > limit {
                    points = thinning.thinned(std::mem::take(&mut points));
                    limit = limit.max(2 * points.len());
                }
            },
        )?;
        Ok(points)
    }

    fn complete(
        &self,
        points: &mut ThinnedPoints,
        quantization: &Quantization,
        options: &SolverOptions,
    ) {
        let Some(rules) = self.rules() else {
            return;
        };
        *points = Thinning::new(quantization, options).thinned(std::mem::take(points));
        let shares = rules.shares(&points.kept, &points.tags, options.spacing);
        for (tag, share) in points.tags.iter_mut().zip(shares) {
            tag.share = share;
        }
    }
}
