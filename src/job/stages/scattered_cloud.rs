//! The scattered points of a job, from which spacing and tiles are decided.

use super::survey::Survey;
use crate::{
    geometry::Quantization,
    job::{context::RunContext, directory::JobDirectory, resources::Budget},
    tile::Spill,
};

/// The scattered points of a job, and the directory for what is decided from them.
pub(crate) struct ScatteredCloud<'a> {
    /// The run that scattered the points, or found them scattered.
    pub(crate) run: &'a RunContext<'a>,
    /// The job directory.
    pub(crate) directory: &'a JobDirectory,
    /// The headers of the inputs.
    pub(crate) survey: &'a Survey,
    /// The points.
    pub(crate) spill: &'a Spill,
}

impl ScatteredCloud<'_> {
    /// The budget beside the points that stay in memory.
    pub(crate) fn budget(&self) -> Budget {
        self.run.budget.holding(self.spill.resident_bytes())
    }

    /// Scale and offset of the points.
    pub(crate) fn quantization(&self) -> &Quantization {
        &self.survey.quantization
    }
}
