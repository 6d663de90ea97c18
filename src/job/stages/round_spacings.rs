//! What round spacings would give: one pass over the inputs that leaves nothing but counts.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicBool, Ordering},
};

use super::{input_parts::InputPart, survey::Survey};
use crate::{
    config::Settings,
    geometry::Stored,
    job::{
        context::RunContext,
        description::JobDescription,
        error::{JobError, LeftOut},
        progress::{Progress, Unit},
    },
    las::{LasError, PointStream},
    spacing::{RoundSpacings, Target, VoxelCounts},
    tile::TileError,
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
    let parts = InputPart::all(survey);
    let (min, max) = survey.claimed_bounds();
    let extent = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f64::max);
    let empty = VoxelCounts::new(&survey.quantization, extent);
    let points = InputPart::points_in(&parts);
    run.progress.begin("density", points, 0, Unit::Points);

    // Each thread takes one part after the other, and counts on its own.
    let waiting = Mutex::new(parts.iter());
    let next = || {
        let mut waiting = waiting.lock().unwrap_or_else(PoisonError::into_inner);
        waiting.next()
    };
    let work = || {
        let (mut counts, mut bad) = (empty.clone(), Vec::new());
        while let Some(part) = next() {
            if run.cancel.load(Ordering::Relaxed) {
                break;
            }
            if let Err(error) = count_part(run, survey, part, &mut counts) {
                bad.push(LeftOut {
                    path: error.path,
                    reason: error.problem,
                });
            }
        }
        (counts, bad)
    };
    let of_threads: Vec<(VoxelCounts, Vec<LeftOut>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..run.budget.decoders(survey.is_remote()))
            .map(|_| scope.spawn(work))
            .collect();
        let join = |thread: std::thread::ScopedJoinHandle<'_, _>| {
            thread
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        threads.into_iter().map(join).collect()
    });
    run.progress.end();
    if run.cancel.load(Ordering::Relaxed) {
        return Err(TileError::Cancelled.into());
    }

    // Add up what the threads counted, and name all inputs that cannot be read.
    let (mut all, mut bad) = (empty, Vec::new());
    for (counts, of_thread) in of_threads {
        all.join(&counts);
        bad.extend(of_thread);
    }
    if bad.is_empty() || run.job.skip_bad_files {
        return Ok(all);
    }
    bad.sort_by(|a, b| (&a.path, &a.reason).cmp(&(&b.path, &b.reason)));
    bad.dedup_by(|a, b| a.path == b.path);
    Err(JobError::BadFiles(bad))
}

/// Adds the points of `part` to `counts`.
fn count_part(
    run: &RunContext<'_>,
    survey: &Survey,
    part: &InputPart,
    counts: &mut VoxelCounts,
) -> Result<(), LasError> {
    let input = &survey.inputs[part.input];
    let (record, quantization) = (&survey.record, survey.quantization);
    let points = part.points.clone();
    let mut stream = PointStream::open(input, points, record, quantization, &survey.filter)?;
    let mut records = Vec::new();
    loop {
        let read = stream.next_batch(&mut records)?.read;
        if read == 0 || run.cancel.load(Ordering::Relaxed) {
            return Ok(());
        }
        for record in records.chunks_exact(record.record_length()) {
            counts.add(Stored::of_record(record));
        }
        run.progress.advance(read);
    }
}
