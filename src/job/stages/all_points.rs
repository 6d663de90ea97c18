//! All points of the inputs, for what has to be known before they are scattered.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use super::{
    input_parts::{InputPart, bad_files},
    survey::Survey,
};
use crate::{
    geometry::Stored,
    job::{
        context::RunContext,
        error::JobError,
        progress::{Progress, Unit},
    },
    las::RecordView,
    tile::SourceError,
};

/// All points of the inputs of a run.
pub(super) struct AllPoints<'a> {
    run: &'a RunContext<'a>,
    survey: &'a Survey,
    parts: Vec<InputPart>,
}

impl<'a> AllPoints<'a> {
    /// The points of the inputs of `survey` that take part in `run`.
    pub(super) fn new(run: &'a RunContext<'a>, survey: &'a Survey) -> Self {
        Self {
            run,
            survey,
            parts: InputPart::all(survey),
        }
    }

    /// The number of points, as the headers claim it.
    pub(super) fn count(&self) -> u64 {
        InputPart::points_in(&self.parts)
    }

    /// Decodes all inputs as the `stage` of this name. Each thread has a state of its own, and hands it to `take` with batch
    /// after batch of points with their GPS times, until that returns `false` in any thread; at the end each
    /// hands its state to `finish`.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] if inputs cannot be read to their end; all the others have been read then, if bad files are left out.
    pub(super) fn visit<State>(
        &self,
        stage: &str,
        begin: impl Fn() -> State + Sync,
        take: impl Fn(&mut State, &mut dyn Iterator<Item = (Stored, f64)>) -> bool + Sync,
        finish: impl Fn(State) + Sync,
    ) -> Result<(), JobError> {
        let Self { run, survey, .. } = *self;
        run.progress.begin(stage, self.count(), 0, Unit::Points);
        let next = AtomicUsize::new(0);
        let is_over = AtomicBool::new(false);
        let failures: Mutex<Vec<(usize, SourceError)>> = Mutex::default();
        let visit_parts = || {
            let mut state = begin();
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(part) = self.parts.get(index) else {
                    break;
                };
                if let Err(error) =
                    self.visit_part(part, &is_over, |points| take(&mut state, points))
                {
                    let mut failures = failures.lock().unwrap_or_else(PoisonError::into_inner);
                    failures.push((index, error));
                    // If bad files are left out, the others are still read, so that the error names all that fail.
                    is_over.fetch_or(!run.job.skip_bad_files, Ordering::Relaxed);
                }
            }
            finish(state);
        };
        std::thread::scope(|scope| {
            for _ in 0..run.budget.decoders(survey.is_remote()) {
                scope.spawn(visit_parts);
            }
        });
        run.progress.end();
        run.check_cancelled()?;
        let failures = failures
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        match failures.is_empty() {
            true => Ok(()),
            false => Err(bad_files(survey, &self.parts, failures)),
        }
    }

    /// Hands the points of a part over, batch by batch, until `take` returns `false`, the user stops the run, or it
    /// `is_over`.
    fn visit_part(
        &self,
        part: &InputPart,
        is_over: &AtomicBool,
        mut take: impl FnMut(&mut dyn Iterator<Item = (Stored, f64)>) -> bool,
    ) -> Result<(), SourceError> {
        let Self { run, survey, .. } = *self;
        let is_stopped = || is_over.load(Ordering::Relaxed) || run.cancel.load(Ordering::Relaxed);
        if is_stopped() {
            return Ok(());
        }
        let length = survey.record.record_length();
        let mut stream = part.open(survey, 0)?;
        let mut records = Vec::new();
        loop {
            let counts = stream.next_batch(&mut records)?;
            if counts.read == 0 || is_stopped() {
                return Ok(());
            }
            let point = |record| {
                (
                    Stored::of_record(record),
                    RecordView::new(record).gps_time(),
                )
            };
            let mut points = records.chunks_exact(length).map(point);
            if !take(&mut points) {
                is_over.store(true, Ordering::Relaxed);
            }
            run.progress.advance(counts.read);
        }
    }
}
