//! What the process that scattered a job hands over to those that solve its tiles.

use std::{
    io,
    path::{Path, PathBuf, absolute},
    sync::atomic::AtomicBool,
};

use serde::{Deserialize, Serialize};

use super::claims::Worker;
use crate::{
    config::Settings,
    job::{
        Job, JobError, JobPlan, Progress,
        running::{Running, threads},
    },
    las::RecordFormat,
    tile::{read_whole, write_whole},
};

/// A job whose tiles are known, as text.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Handover {
    pub(super) job: Job,
    /// Of the scattered points.
    pub(super) record: RecordFormat,
    pub(super) plan: JobPlan,
}

const NAME: &str = "handover.json";

impl Handover {
    /// Whether the tiles of the job in the directory `dir` are known.
    pub(super) fn is_in(dir: &Path) -> bool {
        dir.join(NAME).exists()
    }

    /// What was handed over in the job directory `dir`.
    ///
    /// # Errors
    ///
    /// [`JobError::Refused`] if that is no job directory, or its points are not scattered.
    pub(super) fn read(dir: &Path) -> Result<Self, JobError> {
        let path = dir.join(NAME);
        let found = match read_whole(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => None,
            other => other.map_err(|e| JobError::io("read", &path, e))?,
        };
        let found = found.and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        let mut found = found.ok_or_else(|| {
            JobError::Refused(format!(
                "{}: holds no scattered job; `lloydar scatter` makes one",
                dir.display()
            ))
        })?;
        // Nodes may know it by different names.
        found.job.dir = dir.to_owned();
        Ok(found)
    }

    fn write(&self) -> Result<(), JobError> {
        let path = self.job.dir.join(NAME);
        let text = serde_json::to_vec(self).expect("plain numbers and text");
        write_whole(&path, &text).map_err(|e| JobError::io("write", &path, e))
    }
}

impl Job {
    /// Scatters points of the job's inputs that no other process does, as `worker` among
    /// several.
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
        let job = self.anywhere()?;
        let pool = threads(job.settings.threads)?;
        job.watched(progress, |progress, _| {
            pool.install(|| job.join_scatter(worker, progress, cancel))
        })
    }

    /// Does all that comes before the first tile is solved, as `worker` with those who have begun
    /// it, and hands the tiles over to whoever solves them; `None` if the job is done.
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
        let job = self.anywhere()?;
        job.check_output()?;
        let pool = threads(job.settings.threads)?;
        let prepared = job.watched(progress, |progress, mut clock| {
            pool.install(|| job.prepare(worker, progress, cancel, &mut clock))
        })?;
        prepared
            .map(|Running { survey, plan, .. }| {
                let record = survey.record;
                // Whatever machine stitches them: tiles of another plan would be other tiles.
                let settings = Settings {
                    memory: Some(plan.budget),
                    ..job.settings
                };
                let job = Self { settings, ..job };
                let handover = Handover { job, record, plan };
                handover.write().map(|()| handover.plan)
            })
            .transpose()
    }

    /// The job whose tiles were handed over in the job directory `dir`.
    ///
    /// # Errors
    ///
    /// [`JobError::Refused`] if that is no job directory, or its points are not scattered.
    pub(crate) fn handed_over(dir: &Path) -> Result<Self, JobError> {
        Handover::read(dir).map(|handover| handover.job)
    }

    /// This job by paths that mean the same wherever they are read.
    fn anywhere(&self) -> Result<Self, JobError> {
        let absolute = |path: &PathBuf| {
            absolute(path).map_err(|e| JobError::io("find the directory of", path, e))
        };
        Ok(Self {
            inputs: self.inputs.iter().map(absolute).collect::<Result<_, _>>()?,
            output: absolute(&self.output)?,
            dir: absolute(&self.dir)?,
            ..self.clone()
        })
    }
}
