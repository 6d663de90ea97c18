//! Scatter: every input is decoded once, and each point is appended to the spill of its cell.
//!
//! One process scatters alone, or several scatter a group of parts of the inputs each.

use std::path::Path;

use super::{
    checksums::begin_checksums,
    input_parts::{InputPart, bad_files},
    scan_groups::{POINTS, ScanGroups, open_spill, single_spill},
    survey::Survey,
    transfer::Transfer,
    transients::{WithoutTransients, find_transients, is_searched},
};
use crate::{
    job::{
        cluster::{AttemptState, Claim, Worker},
        context::RunContext,
        directory::{DiskNeed, JobDirectory, bytes_in, check_room},
        error::{JobError, LeftOut},
        progress::{Progress, Unit},
    },
    las::{PointCounts, PointStream},
    lloyd::Thinning,
    spacing::Target,
    tile::{Opener, ScatterOptions, Source, SourceError, Spill, Storage, TileError, scatter_into},
    tiling::CellGrid,
    transients::TransientVoxels,
};

/// Bytes that are spilled between checkpoints: a scatter that is killed loses as many.
const CHECKPOINT_BYTES: u64 = 1 << 30;

/// The largest number of points, as headers claim it, of a job whose points may stay in memory,
/// without a file: if it is killed it decodes them again, which takes two cores half a minute.
const MOST_POINTS_WITHOUT_FILE: u64 = 64_000_000;

/// Who will read the scattered points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SpillReaders {
    /// This process alone.
    ThisProcess,
    /// Other processes, which need files.
    Others,
}

/// Name of the file in the job directory that lists the inputs found to be damaged as they were
/// decoded.
const LEFT_OUT_FILE: &str = "left-out.json";

impl Source for PointStream {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        Ok(Self::next_batch(self, records)?)
    }
}

/// Scatters all inputs of `survey`, or all inputs that can be read if the job leaves others out.
/// Returns the survey of the inputs that were scattered, and their spill.
///
/// # Errors
///
/// [`JobError::BadFiles`] if inputs cannot be read to their end and are not left out.
pub(super) fn scatter_readable(
    run: &RunContext<'_>,
    directory: &JobDirectory,
    mut survey: Survey,
    worker: &Worker,
    readers: SpillReaders,
) -> Result<(Survey, Spill), JobError> {
    let leaves_out = run.job.skip_bad_files;

    // Leave out the inputs that an earlier run found to be damaged as it decoded them.
    if let Some(bad) = directory.read::<Vec<LeftOut>>(LEFT_OUT_FILE)
        && leaves_out
    {
        survey = survey.without(bad)?;
    }

    // Scatter until no further input turns out to be damaged.
    loop {
        let scatter = Scatter {
            run,
            survey: &survey,
            readers,
        };
        check_room(&[scatter.disk_need()])?;
        match scatter.complete(worker) {
            Err(JobError::BadFiles(bad)) if leaves_out => {
                // Some of their points are spilled already, so that the spill begins anew.
                for bad in &bad {
                    let note = format!("{} is left out ({})", bad.path, bad.reason);
                    run.progress.note(&note);
                }
                survey = survey.without(bad)?;
                directory
                    .forget(|name| name.starts_with("spill") || name.starts_with("transients"));
                directory.write(LEFT_OUT_FILE, &survey.left_out)?;
            }
            other => return Ok((survey, other?)),
        }
    }
}

/// The stage that brings the inputs of a survey to the spill.
pub(super) struct Scatter<'a> {
    /// The run.
    pub(super) run: &'a RunContext<'a>,
    /// The headers of the inputs.
    pub(super) survey: &'a Survey,
    /// Who will read the scattered points.
    pub(super) readers: SpillReaders,
}

impl Scatter<'_> {
    /// The room that the points of all inputs need on the disk, except for those that are spilled
    /// already.
    pub(super) fn disk_need(&self) -> DiskNeed<'_> {
        let is_spill = |name: &str| name.starts_with("spill") && name.ends_with(".bin");
        let spilled = bytes_in(self.dir(), is_spill);
        let inputs = self.survey.inputs.iter();
        let largest = inputs.max_by_key(|input| input.points_claimed);
        let largest = largest.map_or_else(String::new, |input| {
            let (claimed, path) = (input.points_claimed, input.path.display());
            format!(", {claimed} of them in {path},")
        });
        let record_length = self.survey.record.record_length() as u64;
        let points = self.survey.points_claimed();
        let bytes = points.saturating_mul(record_length);
        DiskNeed {
            what: format!("all points{largest}"),
            dir: self.dir(),
            bytes: match bytes <= self.memory_bytes(points) {
                true => 0,
                false => bytes.saturating_sub(spilled),
            },
        }
    }

    /// The bytes of a spill of `points` that may stay in memory.
    fn memory_bytes(&self, points: u64) -> u64 {
        let has_readers = self.run.job.keep || self.readers == SpillReaders::Others;
        match points <= MOST_POINTS_WITHOUT_FILE && !has_readers {
            true => self.run.budget.spill(),
            false => 0,
        }
    }

    /// Brings all inputs to the spill, and continues where earlier runs stopped: alone, or, if
    /// several processes have begun the scatter together, among these as `worker`.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] if inputs cannot be read to their end.
    fn complete(&self, worker: &Worker) -> Result<Spill, JobError> {
        let parts = InputPart::all(self.survey);

        // Scatter what is not in a spill.
        let is_shared = !Claim::all(&POINTS, self.dir())?.is_empty() || is_searched(self.dir())?;
        let spill = if is_shared || Spill::is_complete(&single_spill(self.dir())) {
            if is_shared {
                self.share(worker)?;
            }
            open_spill(self.dir())?
        } else {
            let points = InputPart::points_in(&parts);
            let transients = find_transients(self.run, self.survey, None)?;
            self.run.progress.begin("scatter", points, 0, Unit::Points);
            let memory_bytes = self.memory_bytes(points);
            let stem = single_spill(self.dir());
            let spill = self.spill(&parts, transients.as_ref(), &stem, memory_bytes)?;
            self.run.progress.end();
            spill
        };

        // Check conservation: every point that was read is spilled, or was left out.
        let kept: u64 = spill
            .sources()
            .map(|c| c.read - c.rejected - c.filtered)
            .sum();
        if kept != spill.points() || spill.sources().count() != parts.len() {
            return Err(JobError::Refused(format!(
                "{kept} points were read and {} spilled: the spill is not to be trusted; begin \
                 anew with --restart, and please report this",
                spill.points()
            )));
        }
        Ok(spill)
    }

    /// Brings the groups of parts that no other process scatters to spills of their own.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] if inputs cannot be read to their end. If such inputs are left out and
    /// `worker` does not wait for others, groups with such inputs are left to other processes.
    pub(super) fn share(&self, worker: &Worker) -> Result<(), JobError> {
        let (run, dir) = (self.run, self.dir());

        // Refuse to join a process that scatters alone.
        if single_spill(dir).with_extension("bin").exists() {
            return Err(JobError::Refused(format!(
                "{}: one process has begun to scatter this job alone; the same command without \
                 --shard continues from there",
                dir.display()
            )));
        }

        // Agree on the groups, and report what other processes have done.
        let parts = InputPart::all(self.survey);
        let groups = InputPart::groups(&parts);
        let count = groups.len();
        ScanGroups { count }.write(dir)?;
        let claims = Claim::all(&POINTS, dir)?;
        let complete = claims.iter().filter(|c| c.state == AttemptState::Complete);
        let points_of = |group| groups.get(group).map_or(0, |&g| InputPart::points_in(g));
        let done = complete.map(|claim| points_of(claim.group)).sum();
        let points = InputPart::points_in(&parts);
        let transients = find_transients(run, self.survey, Some(worker))?;
        run.progress.begin("scatter", points, done, Unit::Points);

        // Scatter one free group after the other.
        let leaves_to_others = run.job.skip_bad_files && !worker.waits_for_others;
        let given_up = worker.share(&POINTS, dir, count, run.cancel, |claim, _| {
            match self.spill(groups[claim.group], transients.as_ref(), &claim.stem, 0) {
                Err(error @ JobError::BadFiles(_)) if leaves_to_others => {
                    run.progress.note(&error.to_string());
                    Ok(false)
                }
                other => other.map(|_| true),
            }
        })?;
        run.progress.end();
        let given_up = given_up.iter().flat_map(|&group| groups[group]);
        match self.given_up(given_up, worker) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// The error that names the inputs of `parts`, over which too many processes have died; `None`
    /// if there are no such parts.
    fn given_up<'p>(
        &self,
        parts: impl Iterator<Item = &'p InputPart>,
        worker: &Worker,
    ) -> Option<JobError> {
        let mut paths: Vec<String> = parts
            .map(|part| self.survey.inputs[part.input].path.display().to_string())
            .collect();
        paths.dedup();
        (!paths.is_empty()).then(|| {
            JobError::Refused(format!(
                "{} processes died while they read one of {}, or their machines did; see to that, \
                 and give --attempts {} to try again",
                worker.retry_limit,
                paths.join(", "),
                worker.retry_limit + 1
            ))
        })
    }

    /// Brings `parts`, without `transients`, to the spill at `stem`, and continues where an earlier run stopped. At most
    /// `memory_bytes` of points stay in memory.
    fn spill(
        &self,
        parts: &[InputPart],
        transients: Option<&TransientVoxels>,
        stem: &Path,
        memory_bytes: u64,
    ) -> Result<Spill, JobError> {
        let Self { run, survey, .. } = *self;
        let decoders = run.budget.decoders(survey.is_remote());
        begin_checksums(survey, run.budget.waiting_for_checksums());
        let sources = parts
            .iter()
            .enumerate()
            .map(|(index, part)| {
                let open = move |skip| {
                    // The next parts are on their way while this one is decoded.
                    for next in parts[index + 1..].iter().take(decoders) {
                        survey.inputs[next.input].prefetch(&next.points);
                    }
                    let stream = part.open(survey, skip)?;
                    Ok(match transients {
                        None => Box::new(stream) as Box<dyn Source>,
                        Some(transients) => Box::new(WithoutTransients {
                            source: stream,
                            transients,
                            quantization: survey.quantization,
                            record_length: survey.record.record_length(),
                        }),
                    })
                };
                Box::new(open) as Opener<'_>
            })
            .collect();
        let options = ScatterOptions {
            record_length: survey.record.record_length(),
            threads: decoders,
            buffer_bytes: run.budget.buffers(),
            checkpoint_bytes: CHECKPOINT_BYTES,
            // Then the error names all files that fail, not only the first.
            keep_going: run.job.skip_bad_files,
        };
        // Cells are at most one CRS unit wide to begin with.
        let usual_edge = (1.0 / survey.quantization.scale).ceil() as i64;
        let grid = CellGrid::for_extent(survey.extent_claimed(), usual_edge);
        let progress = |points| run.progress.advance(points);
        let storage = Storage {
            thinning: self.thinning(),
            memory_bytes,
        };
        let spill = scatter_into(sources, grid, stem, options, storage, &progress, run.cancel);
        spill.map_err(|error| match error {
            TileError::Sources(failures) => bad_files(survey, parts, failures),
            other => JobError::Tile(other),
        })
    }

    /// The rule by which points are thinned as they come, if the spacing is known and attributes
    /// come from the nearest points alone.
    fn thinning(&self) -> Option<Thinning> {
        let Self { run, survey, .. } = *self;
        let settings = &run.job.settings;
        match settings.target {
            // Where the spacing varies, every point counts for what is wanted at its place.
            _ if settings.solver.grading.is_some() => None,
            Target::Spacing(spacing) if !Transfer::new(&survey.record, settings).needs_cells() => {
                let options = settings.solver.at(spacing, 0.0);
                Some(Thinning::new(&survey.quantization, &options))
            }
            _ => None,
        }
    }

    fn dir(&self) -> &Path {
        &self.run.job.dir
    }
}
