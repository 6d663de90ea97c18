//! A spill as a cloud that is counted by squares and gathered by rectangles.

use super::{cell_points::Spilled, error::TileError, spill::Spill};
use crate::{
    geometry::{Quantization, Rect, Stored},
    lloyd::{SolverOptions, ThinnedPoints, Thinning},
    tiling::{Bounds, CountedCloud},
};

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
            |found: &mut ThinnedPoints, spilled| match spilled {
                Spilled::Record(record) => {
                    found.kept.push(Stored::of_record(record));
                    found
                        .tags
                        .extend(self.rules().map(|rules| rules.tag(record)));
                }
                Spilled::Sum(sum) => found.sums.push(*sum),
            },
            |found| {
                points.append(found);
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
