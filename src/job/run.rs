//! A job from its inputs to its output.

use std::sync::atomic::AtomicBool;

use super::{
    cluster::Worker,
    complete::{CompletedJob, complete_job},
    context::RunContext,
    description::JobDescription,
    directory::Stamp,
    error::JobError,
    mesh_levels::add_coarser_levels,
    outcome::{Outcome, RunCosts},
    progress::Progress,
    stages::{
        mesh_tiles::MeshTiles, plan::JobPlan, planned_job::PlannedJob, preparation::prepare,
        scatter::SpillReaders,
    },
};
use crate::las::{CompleteCloud, CompleteMesh};

impl JobDescription {
    /// Does the job, and continues from what an earlier run of the same job completed.
    ///
    /// If several processes stitch the job, `shared` is this one. When everything is done except that the output has its
    /// name, `report` is called; if it fails, the job fails, and the next run continues there. Returns `None` if an earlier run had
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
        shared: Option<&Worker>,
        report: impl FnOnce(&Outcome) -> Result<(), JobError>,
    ) -> Result<Option<Outcome>, JobError> {
        let format = self.check_output()?;
        let threads = self.settings.resources.threads;
        RunContext::with(self, threads, progress, cancel, |run| {
            let mut tiles = match (&self.mesh, self.mesh_tile_edge()) {
                (Some(path), Some(edge)) => Some(MeshTiles::create(path, edge)?),
                _ => None,
            };
            let Some(mut completed) = complete_job(run, format, tiles.as_mut(), shared)? else {
                return Ok(None);
            };
            if let Some(tiles) = &mut tiles {
                completed.outcome.mesh_levels = add_coarser_levels(run, &completed, tiles)?;
            }
            let CompletedJob {
                planned,
                mut outcome,
                output,
            } = completed;
            let mesh = match tiles {
                Some(tiles) => Some(tiles.complete()?),
                None => output.mesh,
            };

            // Report, and give the output its name.
            let (stages, samples) = run.clock.stop(&self.dir);
            outcome.costs = RunCosts { stages, samples };
            report(&outcome)?;
            self.deliver(planned, output.cloud, mesh, cancel)?;
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

    /// Gives the output its name, uploads it if it is an object, and removes the job directory. A run that is killed between the
    /// two is recognized by the stamp of the output in the job directory.
    fn deliver(
        &self,
        mut planned: PlannedJob,
        cloud: CompleteCloud,
        mesh: Option<CompleteMesh>,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        if let Some(mesh) = mesh {
            // A run that continues here writes the same mesh once more.
            mesh.deliver()?;
        }
        let stamp = Stamp::of(cloud.part());
        let stamp = stamp.map_err(|e| JobError::io("read", cloud.part(), e))?;
        planned.directory.deliver(stamp)?;
        cloud.deliver()?;
        self.upload(cancel)?;
        if !self.keep {
            planned.directory.clear();
        }
        Ok(())
    }
}
