//! A spill as a cloud that is counted by squares and gathered by rectangles.

use super::{cell_points::Spilled, error::TileError, spill::Spill};
use crate::{
    geometry::{CellIndex, DistinctCells, Quantization, Rect, Stored},
    lloyd::{SolverOptions, ThinnedPoints, Thinning},
    tiling::{Bounds, CountedCloud},
};

/// Points that a thread gathers before it thins them.
const THINNED_BY_THREAD: usize = 50_000;

/// Points that are thinned whenever they are more than the limit.
struct GatheredPoints {
    points: ThinnedPoints,
    limit: usize,
}

impl GatheredPoints {
    fn new(limit: usize) -> Self {
        Self {
            points: ThinnedPoints::default(),
            limit,
        }
    }

    /// Thins the points if they are more than the limit, which from then on is at least twice the number of those that stay.
    fn keep_to_limit(&mut self, thinning: &Thinning) {
        if self.points.len() > self.limit {
            self.points = thinning.thinned(std::mem::take(&mut self.points));
            self.limit = self.limit.max(2 * self.points.len());
        }
    }
}

impl Default for GatheredPoints {
    /// The points of one thread.
    fn default() -> Self {
        Self::new(THINNED_BY_THREAD)
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
        let mut all = GatheredPoints::new(thinning_limit as usize);
        // Of cells that are thinned, only voxels on their borders could lose points.
        let is_thinned = self.is_thinned_by(&thinning);
        self.gather_each(
            rect,
            |found: &mut GatheredPoints, spilled| {
                match spilled {
                    Spilled::Record(record) => {
                        found.points.kept.push(Stored::of_record(record));
                        let tag = self.rules().map(|rules| rules.tag(record));
                        found.points.tags.extend(tag);
                    }
                    Spilled::Sum(sum) => found.points.sums.push(*sum),
                }
                if !is_thinned {
                    found.keep_to_limit(&thinning);
                }
            },
            |found| {
                all.points.append(found.points);
                all.keep_to_limit(&thinning);
            },
        )?;
        Ok(all.points)
    }

    fn cells(
        &self,
        rect: &Rect,
        cell_of: impl Fn(Stored) -> CellIndex + Sync,
    ) -> Result<Vec<CellIndex>, TileError> {
        let mut all = DistinctCells::default();
        self.gather_each(
            rect,
            |found: &mut DistinctCells, spilled| {
                // The points of a sum lie in a voxel that keeps others.
                if let Spilled::Record(record) = spilled {
                    found.add(cell_of(Stored::of_record(record)));
                }
            },
            |found| all.join(found),
        )?;
        Ok(all.into_sorted())
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
