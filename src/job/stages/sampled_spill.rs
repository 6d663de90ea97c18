//! The spill as its parts are sampled to choose a spacing: where rules vary it, no more of it is in memory than the budget allows.
//!
//! How far points are thinned, and how many parts are in memory at a time, shows in no count of sites. So a small
//! budget takes more time and gives the same spacing.

use crate::{
    geometry::{CellIndex, Quantization, Rect, Stored},
    job::{
        error::JobError,
        resources::{Budget, mebibytes},
    },
    lloyd::{SolverOptions, SolverSettings, ThinnedPoints, Thinning},
    tile::Spill,
    tiling::{Bounds, CountedCloud},
};

/// Bytes per point of a part whose seeds are elected by rules: its points are thinned, rules look around each, and each
/// may have a voxel of its own. Parts of up to 706 000 points of a handheld scan took 95.
const BYTES_PER_POINT: f64 = 100.0;

/// A spill of which no more points are gathered than fit a budget, if rules vary the spacing.
pub(super) struct SampledSpill<'a> {
    spill: &'a Spill,
    /// The budget beside the points that stay in memory.
    budget: Budget,
    /// Number of points that may be gathered and be in memory at a time.
    most_gathered: u64,
}

impl<'a> SampledSpill<'a> {
    /// The points of `spill`, within `budget`, which is what there is beside those that stay in memory, for a job with these `settings`.
    pub(super) fn new(spill: &'a Spill, budget: Budget, settings: &SolverSettings) -> Self {
        // Parts of the usual size fit any budget where the spacing is the same everywhere.
        let most_gathered = match settings.grading {
            None => u64::MAX,
            Some(_) => budget.points(BYTES_PER_POINT),
        };
        Self {
            spill,
            budget,
            most_gathered,
        }
    }

    /// The error of a job whose memory is too little for a part that keeps `points`.
    fn too_little_memory(&self, points: u64) -> JobError {
        let scattered = self.spill.bytes() + self.spill.resident_bytes();
        let bytes = points as f64 * BYTES_PER_POINT;
        JobError::Resources(format!(
            "--memory {} is too little: a part of the scan by which points of the output are counted holds {points} points; give at \
             least {}",
            mebibytes(self.budget.total),
            mebibytes(self.budget.needed_beside(bytes, scattered))
        ))
    }
}

impl CountedCloud for SampledSpill<'_> {
    type Error = JobError;

    fn points(&self) -> u64 {
        self.spill.points()
    }

    fn bounds(&self) -> Bounds {
        self.spill.bounds()
    }

    fn square_edge(&self) -> i64 {
        self.spill.square_edge()
    }

    fn most_gathered(&self) -> u64 {
        self.most_gathered
    }

    fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_ {
        self.spill.squares()
    }

    fn gather(
        &self,
        rect: &Rect,
        quantization: &Quantization,
        options: &SolverOptions,
        thinning_limit: u64,
    ) -> Result<ThinnedPoints, JobError> {
        let most = self.most_gathered;
        let limit = thinning_limit.min(most);
        let mut points = CountedCloud::gather(self.spill, rect, quantization, options, limit)?;
        if points.len() as u64 > most {
            points = Thinning::new(quantization, options).thinned(points);
        }
        match points.len() as u64 {
            held if held > most => Err(self.too_little_memory(held)),
            _ => Ok(points),
        }
    }

    fn cells(
        &self,
        rect: &Rect,
        cell_of: impl Fn(Stored) -> CellIndex + Sync,
    ) -> Result<Vec<CellIndex>, JobError> {
        Ok(CountedCloud::cells(self.spill, rect, cell_of)?)
    }

    fn complete(
        &self,
        points: &mut ThinnedPoints,
        quantization: &Quantization,
        options: &SolverOptions,
    ) {
        self.spill.complete(points, quantization, options);
    }
}
