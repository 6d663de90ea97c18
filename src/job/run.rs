//! A job from its inputs to its output: the order of the stages.

use std::sync::atomic::AtomicBool;

use super::{
    cluster::{Worker, block_files},
    context::RunContext,
    description::JobDescription,
    directory::Stamp,
    error::JobError,
    outcome::Outcome,
    progress::Progress,
    stages::{
        output::{CompleteOutput, complete_output},
        plan::JobPlan,
        planned_job::PlannedJob,
        preparation::prepare,
        scatter::SpillReaders,
        solve::solve_missing,
    },
};

/// Approximate share of the first of two rounds in the time of solving.
const SHARE_OF_FIRST_ROUND: f64 = 0.55;
/// Expected seconds of the stages after the tiles are solved, per million points of the output.
const STITCH_SECONDS_PER_MILLION: f64 = 0.2;
const WRITE_SECONDS_PER_MILLION: f64 = 0.5;
const SORT_SECONDS_PER_MILLION: f64 = 0.7;
/// Expected seconds of the mesh, per million points of the output.
const MESH_SECONDS_PER_MILLION: f64 = 4.0;
/// Expected seconds of the views of the result.
const VIEW_SECONDS: f64 = 0.2;

impl JobDescription {
    /// Does the job, and continues from what an earlier run of the same job completed.
    ///
    /// When everything is done except that the output has its name, `report` is called; if it
    /// fails, the job fails, and the next run continues there. Returns `None` if an earlier run had
    /// delivered the output, and was stopped while it removed its temporary files.
    ///
    /// # Errors
    ///
    /// See [`JobError`]. Completed work stays in the job directory, from which the same job
    /// continues; there is no incomplete file under the name of the output.
    pub(crate) fn run_and_report(
        &self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
        report: impl FnOnce(&Outcome) -> Result<(), JobError>,
    ) -> Result<Option<Outcome>, JobError> {
        let format = self.check_output()?;
        let threads = self.settings.resources.threads;
        let worker = Worker::until_all_is_done(threads);
        RunContext::with(self, threads, progress, cancel, |run| {
            // Survey the headers, scatter the points, choose the spacing, plan the tiles.
            let readers = SpillReaders::ThisProcess;
            let Some(planned) = run.pool.install(|| prepare(run, &worker, readers))? else {
                return Ok(None);
            };
            run.progress
                .expect(&self.seconds_ahead(&planned.solver.plan));

            // Solve the tiles that no earlier run has solved.
            let others = block_files(planned.directory.path())?;
            let solved = solve_missing(run, &planned, others)?;
            run.clock.end_stage("solve");

            // Stitch the tiles and write the cloud, aside.
            let complete = || complete_output(run, &planned, &solved, format);
            let (outcome, output) = run.pool.install(complete)?;

            // Report, and give the output its name.
            report(&outcome)?;
            self.deliver(planned, output)?;
            Ok(Some(outcome))
        })
    }

    /// Does everything that precedes the solving of tiles, and returns the plan; `None` if an
    /// earlier run had delivered the output.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(crate) fn plan(
        &self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<Option<JobPlan>, JobError> {
        let threads = self.settings.resources.threads;
        let worker = Worker::until_all_is_done(threads);
        let planned = RunContext::with(self, threads, progress, cancel, |run| {
            let readers = SpillReaders::ThisProcess;
            run.pool.install(|| prepare(run, &worker, readers))
        })?;
        Ok(planned.map(|planned| {
            if !self.keep {
                planned.directory.abandon();
            }
            planned.solver.plan
        }))
    }

    /// Gives the output its name, and removes the job directory. A run that is killed between the
    /// two is recognized by the stamp of the output in the job directory.
    fn deliver(&self, mut planned: PlannedJob, output: CompleteOutput) -> Result<(), JobError> {
        let CompleteOutput { cloud, mesh } = output;
        if let Some(mesh) = mesh {
            // A run that continues here writes the same mesh once more.
            mesh.deliver()?;
        }
        let stamp = Stamp::of(cloud.part());
        let stamp = stamp.map_err(|e| JobError::io("read", cloud.part(), e))?;
        planned.directory.deliver(stamp)?;
        cloud.deliver()?;
        if !self.keep {
            planned.directory.clear();
        }
        Ok(())
    }

    /// The stages from the solving of tiles on, with the expected seconds of each.
    fn seconds_ahead(&self, plan: &JobPlan) -> [(&'static str, f64); 6] {
        let million = 1e-6 * plan.points_out as f64;
        let sort = match self.is_sorted() {
            true => SORT_SECONDS_PER_MILLION,
            false => 0.0,
        };
        let mesh = match self.mesh {
            Some(_) => MESH_SECONDS_PER_MILLION * million,
            None => 0.0,
        };
        let to_start = match plan.has_two_rounds {
            true => SHARE_OF_FIRST_ROUND * plan.seconds_to_solve,
            false => 0.0,
        };
        [
            ("start", to_start),
            ("solve", plan.seconds_to_solve - to_start),
            ("stitch", STITCH_SECONDS_PER_MILLION * million),
            ("write", WRITE_SECONDS_PER_MILLION * million),
            ("mesh", mesh),
            ("sort", VIEW_SECONDS + sort * million),
        ]
    }
}
