//! What round spacings would give: one pass over the inputs that leaves nothing but counts.

use std::sync::{Mutex, PoisonError, atomic::AtomicBool};

use super::{all_points::AllPoints, survey::Survey};
use crate::{
    config::Settings,
    geometry::{Stored, longest_side},
    job::{context::RunContext, description::JobDescription, error::JobError, progress::Progress},
    spacing::{RoundSpacings, Target, VoxelCounts},
};

impl JobDescription {
    /// Counts the points that round spacings would give, by all points that the job's filter accepts. The density that
    /// the job asks for does not matter.
    ///
    /// # Errors
    ///
    /// Fails where [`Survey::of`] does, and with [`JobError::BadFiles`] if inputs cannot be read to their end and are not
    /// left out.
    pub(crate) fn round_spacings(
        &self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<RoundSpacings, JobError> {
        // Without a spacing the scale of the inputs is that of the run.
        let settings = Settings {
            target: Target::Ratio(1.0),
            ..self.settings.clone()
        };
        let survey = Survey::of(&self.inputs, &settings, self.skip_bad_files)?;
        let threads = self.settings.resources.threads;
        RunContext::with(self, threads, progress, cancel, |run| {
            Ok(count_voxels(run, &survey)?.spacings())
        })
    }
}

/// Counts the voxels of all points of `survey`, in as many threads as there is memory for decoders.
fn count_voxels(run: &RunContext<'_>, survey: &Survey) -> Result<VoxelCounts, JobError> {
    let (min, max) = survey.claimed_bounds();
    let extent = longest_side(min, max);
    let empty = VoxelCounts::new(&survey.quantization, extent);
    // Each thread counts on its own.
    let all = Mutex::new(empty.clone());
    let take = |own: &mut VoxelCounts, points: &mut dyn Iterator<Item = (Stored, f64)>| {
        points.for_each(|(point, _)| own.add(point));
        true
    };
    let finish = |own| {
        let mut all = all.lock().unwrap_or_else(PoisonError::into_inner);
        all.join(&own);
    };
    let read = AllPoints::new(run, survey).visit("density", || empty.clone(), take, finish);
    match read {
        Err(JobError::BadFiles(_)) if run.job.skip_bad_files => {}
        read => read?,
    }
    Ok(all.into_inner().unwrap_or_else(PoisonError::into_inner))
}
