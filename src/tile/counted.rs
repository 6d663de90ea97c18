//! A spill as a cloud that is counted by squares and gathered by rectangles.

use super::{error::TileError, spill::Spill};
use crate::{
    geometry::{Quantization, Rect, Stored},
    lloyd::{Scan, SolverOptions},
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
    ) -> Result<Vec<Stored>, TileError> {
        let mut points: Vec<Stored> = Vec::new();
        let mut limit = thinning_limit as usize;
        self.gather_each(
            rect,
            |found: &mut Vec<Stored>, record| found.push(Stored::of_record(record)),
            |found| {
                points.extend(found);
                if points.len() > limit {
                    points = Scan::thinned(std::mem::take(&mut points), quantization, options);
                    limit = limit.max(2 * points.len());
                }
            },
        )?;
        Ok(points)
    }
}
