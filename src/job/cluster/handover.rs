//! What the process that scattered a job hands over to the processes that solve its tiles: the
//! job, the format of the records, and the plan, in one file.

use std::{
    io,
    path::{Path, PathBuf, absolute},
    sync::atomic::AtomicBool,
};

use serde::{Deserialize, Serialize};

use super::worker::Worker;
use crate::{
    job::{
        context::RunContext,
        description::JobDescription,
        error::JobError,
        progress::Progress,
        stages::{
            cloud_header::cloud_header,
            density::spacing_rules,
            plan::JobPlan,
            preparation::{join_scatter, prepare},
            scan_groups::open_spill,
            scatter::SpillReaders,
            tile_solver::TileSolver,
        },
    },
    las::{CloudHeader, RecordFormat},
    store::{has_secret, is_remote, without_secrets},
    tile::{read_checksummed, write_checksummed},
};

/// A job whose tiles are known. It is stored as JSON with a checksum.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Handover {
    /// The job, with absolute paths.
    pub(super) job: JobDescription,
    /// The format of the scattered records.
    pub(super) record: RecordFormat,
    /// What the header of the output says.
    pub(super) header: CloudHeader,
    /// The plan of the tiles.
    pub(super) plan: JobPlan,
}

/// The name of the file in the job directory.
const HANDOVER_FILE: &str = "handover.json";

impl Handover {
    /// Whether the job in the directory `dir` has been handed over.
    pub(super) fn exists_in(dir: &Path) -> bool {
        dir.join(HANDOVER_FILE).exists()
    }

    /// Reads what was handed over in the job directory `dir`.
    ///
    /// # Errors
    ///
    /// [`JobError::Refused`] if `dir` is no job directory, or its points are not scattered.
    pub(super) fn read(dir: &Path) -> Result<Self, JobError> {
        let path = dir.join(HANDOVER_FILE);
        let found = match read_checksummed(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => None,
            other => other.map_err(|e| JobError::io("read", &path, e))?,
        };
        let found = found.and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        let mut found = found.ok_or_else(|| {
            JobError::Refused(format!(
                "{}: contains no scattered job; `lloydar scatter` makes one",
                dir.display()
            ))
        })?;
        // Two machines may know the directory by different paths.
        found.job.dir = dir.to_owned();
        Ok(found)
    }

    /// Opens the scattered points, to solve their tiles.
    ///
    /// # Errors
    ///
    /// [`JobError`] if they cannot be read, or a file that the rules for the spacing name cannot.
    pub(super) fn solver(&self) -> Result<TileSolver, JobError> {
        let (settings, plan) = (&self.job.settings, self.plan.clone());
        let mut spill = open_spill(&self.job.dir)?;
        spill.set_rules(spacing_rules(settings, &self.record, &plan.quantization)?);
        Ok(TileSolver::new(spill, plan, &self.record, settings))
    }

    fn write(&self) -> Result<(), JobError> {
        let path = self.job.dir.join(HANDOVER_FILE);
        let text = serde_json::to_vec(self).expect("plain numbers and text");
        write_checksummed(&path, &text).map_err(|e| JobError::io("write", &path, e))
    }
}

impl JobDescription {
    /// Scatters the groups of scans that no other process scatters, as `worker` among several.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(crate) fn scatter(
        &self,
        worker: &Worker,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        let job = self.with_absolute_paths()?;
        let threads = job.settings.resources.threads;
        RunContext::with(&job, threads, progress, cancel, |run| {
            run.pool.install(|| join_scatter(run, worker))
        })
    }

    /// Completes everything that precedes the solving of tiles, as `worker` together with the
    /// processes that have begun it, and hands the tiles over to the processes that solve them;
    /// `None` if the output is complete already.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(crate) fn hand_over(
        &self,
        worker: &Worker,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<Option<JobPlan>, JobError> {
        let mut job = self.with_absolute_paths()?;
        job.check_output()?;
        let threads = job.settings.resources.threads;
        let planned = RunContext::with(&job, threads, progress, cancel, |run| {
            run.pool
                .install(|| prepare(run, worker, SpillReaders::Others))
        })?;
        planned
            .map(|planned| {
                let header = cloud_header(&planned, &job.settings);
                let (record, plan) = (planned.survey.record, planned.solver.plan);
                // The budget is fixed, whatever machine stitches the tiles: another budget would give
                // another plan, and other tiles.
                job.settings.resources.memory = Some(plan.budget);
                let handover = Handover {
                    job,
                    record,
                    header,
                    plan,
                };
                handover.write().map(|()| handover.plan)
            })
            .transpose()
    }

    /// Reads the job whose tiles were handed over in the job directory `dir`.
    ///
    /// # Errors
    ///
    /// [`JobError::Refused`] if `dir` is no job directory, or its points are not scattered.
    pub(crate) fn handed_over(dir: &Path) -> Result<Self, JobError> {
        Handover::read(dir).map(|handover| handover.job)
    }

    /// Returns this job with absolute paths, which mean the same in every working directory.
    fn with_absolute_paths(&self) -> Result<Self, JobError> {
        // The job directory, which others read, has no signatures.
        let addresses = self.inputs.iter().chain(&self.destination);
        if let Some(signed) = addresses.into_iter().find(|path| has_secret(path)) {
            return Err(JobError::Refused(format!(
                "{}: the address has a signature or a password, which is not handed over to other processes; give \
                 credentials in the environment, or use `lloydar run`",
                without_secrets(signed).display()
            )));
        }
        let absolute = |path: &PathBuf| {
            if is_remote(path) {
                return Ok(path.clone());
            }
            absolute(path).map_err(|e| JobError::io("find the directory of", path, e))
        };
        Ok(Self {
            inputs: self.inputs.iter().map(absolute).collect::<Result<_, _>>()?,
            output: absolute(&self.output)?,
            mesh: self.mesh.as_ref().map(absolute).transpose()?,
            dir: absolute(&self.dir)?,
            ..self.clone()
        })
    }
}
