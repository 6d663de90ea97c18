//! Every input once, to the spill: by one process, or by several, a group of parts of inputs
//! each.

use std::{
    ops::Range,
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use serde::{Deserialize, Serialize};

use crate::job::{
    JobError, LeftOut, Progress, Survey, Unit, Worker,
    cluster::{AttemptState, Claim, GROUP_LIMIT, WorkKind},
    directory::write_among_others,
    resources::Budget,
};
use crate::{
    las::{LasError, PointStream},
    tile::{
        CellGrid, Opener, PointCounts, ScatterOptions, Source, SourceError, Spill, TileError,
        read_checksummed, scatter,
    },
};

/// Points of an input that are decoded by themselves.
const PART_POINTS: u64 = 1_000_000;
/// Bytes spilled between checkpoints: what a scatter that is killed loses.
const CHECKPOINT_BYTES: u64 = 1 << 30;

/// Points of one input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct InputCount {
    /// The file.
    pub(crate) path: String,
    /// Points that its header claims.
    pub(crate) claimed: u64,
    /// Points read.
    pub(crate) read: u64,
    /// Points out of the range of the run's scale, left out.
    pub(crate) rejected: u64,
    /// Points that were not asked for, left out.
    pub(crate) filtered: u64,
    /// Points outside of the bounds that the header claims.
    pub(crate) outside: u64,
    /// Why the whole file was left out, if it was.
    pub(crate) left_out: Option<String>,
}

impl Source for PointStream {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        Ok(Self::next_batch(self, records)?)
    }
}

/// Points of the inputs, each group of them spilled by itself.
pub(crate) const POINTS: WorkKind = WorkKind {
    prefix: "spill",
    claim_extension: "bin",
    complete_extension: "index",
};

/// Points that a group of parts has at the most, as long as there are not too many groups:
/// what is decoded again if a process is killed over it, and yet has a part for every core.
const GROUP_POINTS: u64 = 8 * PART_POINTS;

/// How many groups the points of a job are scattered in, for who only sees the job directory.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct ScanGroups {
    pub(crate) count: usize,
}

impl ScanGroups {
    const NAME: &str = "groups.json";

    /// As the processes say that scatter the job in `dir` together, if there are any.
    pub(crate) fn read(dir: &Path) -> Option<Self> {
        let content = read_checksummed(&dir.join(Self::NAME)).ok()??;
        serde_json::from_slice(&content).ok()
    }
}

/// Inputs on their way to the spill.
pub(crate) struct Scattering<'a> {
    pub(crate) survey: &'a Survey,
    pub(crate) dir: &'a Path,
    pub(crate) budget: Budget,
    /// Whether all files that fail are to be named, not only the first.
    pub(crate) keep_going: bool,
    pub(crate) progress: &'a dyn Progress,
    pub(crate) cancel: &'a AtomicBool,
}

/// Points of an input that are decoded by themselves: which input, and where in it.
type Part = (usize, Range<u64>);

impl Scattering<'_> {
    /// Brings all inputs to the spill, from where earlier runs left it: alone, or, if several
    /// processes have begun it together, as `worker` among those.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] if files cannot be read to their end.
    pub(crate) fn complete(&self, worker: &Worker) -> Result<Spill, JobError> {
        let parts = parts(self.survey);
        if !Claim::all(&POINTS, self.dir)?.is_empty() {
            self.share(worker)?;
        } else if !Spill::is_complete(&self.dir.join(ALONE)) {
            let points = points_of(&parts);
            self.progress.begin("scatter", points, 0, Unit::Points);
            self.spill(&parts, &self.dir.join(ALONE))?;
            self.progress.end();
        }
        let spill = scattered(self.dir)?;
        // Conservation: what was read is what was spilled, or rejected.
        let kept: u64 = spill
            .sources()
            .map(|c| c.read - c.rejected - c.filtered)
            .sum();
        if kept != spill.points() || spill.sources().count() != parts.len() {
            return Err(JobError::Refused(format!(
                "{kept} points were read and {} spilled: the spill is not to be trusted; begin anew with \
                 --restart, and please report this",
                spill.points()
            )));
        }
        Ok(spill)
    }

    /// Brings groups of inputs to spills of their own that no other process does.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] if files cannot be read to their end; groups with such files are
    /// left to others if those that fail are to be skipped and `worker` does not wait.
    pub(crate) fn share(&self, worker: &Worker) -> Result<(), JobError> {
        if self.dir.join(ALONE).with_extension("bin").exists() {
            return Err(JobError::Refused(format!(
                "{}: one process has begun to scatter this job alone; the same command without \
                 --shard goes on from there",
                self.dir.display()
            )));
        }
        let parts = parts(self.survey);
        let groups = groups(&parts);
        let count = groups.len();
        let text = serde_json::to_vec(&ScanGroups { count }).expect("a number");
        write_among_others(&self.dir.join(ScanGroups::NAME), &text)?;
        let claims = Claim::all(&POINTS, self.dir)?;
        let complete = claims.iter().filter(|c| c.state == AttemptState::Complete);
        let done = complete.map(|c| groups.get(c.group).map_or(0, |group| points_of(group)));
        let points = points_of(&parts);
        self.progress
            .begin("scatter", points, done.sum(), Unit::Points);
        let given_up =
            worker.share(&POINTS, self.dir, count, self.cancel, |claim, _| match self
                .spill(groups[claim.group], &claim.stem)
            {
                Err(error @ JobError::BadFiles(_))
                    if self.keep_going && !worker.waits_for_others =>
                {
                    self.progress.note(&error.to_string());
                    Ok(false)
                }
                other => other.map(|()| true),
            })?;
        self.progress.end();
        if given_up.is_empty() {
            return Ok(());
        }
        let inputs = given_up.iter().flat_map(|&group| groups[group]);
        let mut paths: Vec<String> = inputs
            .map(|(input, _)| self.survey.inputs[*input].path.display().to_string())
            .collect();
        paths.dedup();
        Err(JobError::Refused(format!(
            "{} processes died while they read one of {}, or their machines did; see to that, and give \
             --attempts {} to try again",
            worker.retry_limit,
            paths.join(", "),
            worker.retry_limit + 1
        )))
    }

    /// Brings `parts` to the spill at `stem`, from where an earlier run left it.
    fn spill(&self, parts: &[Part], stem: &Path) -> Result<(), JobError> {
        let survey = self.survey;
        let sources = parts
            .iter()
            .map(|(input, part)| {
                let open = move |skip| {
                    let rest = part.start + skip..part.end;
                    let input = &survey.inputs[*input];
                    let (record, quantization) = (&survey.record, survey.quantization);
                    let stream =
                        PointStream::open(input, rest, record, quantization, &survey.filter)?;
                    Ok(Box::new(stream) as Box<dyn Source>)
                };
                Box::new(open) as Opener<'_>
            })
            .collect();
        let options = ScatterOptions {
            record_length: survey.record.record_length(),
            threads: self.budget.decoders(),
            buffer_bytes: self.budget.buffers(),
            checkpoint_bytes: CHECKPOINT_BYTES,
            keep_going: self.keep_going,
        };
        let usual = (1.0 / survey.quantization.scale).ceil() as i64;
        let grid = CellGrid::for_extent(survey.extent_claimed(), usual);
        let progress = |points| self.progress.advance(points);
        scatter(sources, grid, stem, options, &progress, self.cancel).map_err(|error| match error {
            TileError::Sources(failures) => bad_files(survey, parts, failures),
            other => JobError::Tile(other),
        })
    }
}

/// The name of the spill that one process makes alone.
const ALONE: &str = "spill";

/// The spill in the job directory `dir`, of one process or of several.
///
/// # Errors
///
/// See [`Spill::join`].
pub(crate) fn scattered(dir: &Path) -> Result<Spill, JobError> {
    let mut claims = Claim::all(&POINTS, dir)?;
    claims.retain(|claim| claim.state == AttemptState::Complete);
    // If two came to the end of a group, the first of them will do.
    claims.dedup_by_key(|claim| claim.group);
    let stems: Vec<PathBuf> = match claims.is_empty() {
        true => vec![dir.join(ALONE)],
        false => claims.into_iter().map(|claim| claim.stem).collect(),
    };
    Ok(Spill::join(&stems)?)
}

/// What was read of each input of `survey`, and what was left out.
pub(crate) fn input_counts(survey: &Survey, spill: &Spill) -> Vec<InputCount> {
    let mut by_input = vec![PointCounts::default(); survey.inputs.len()];
    for ((input, _), counts) in parts(survey).into_iter().zip(spill.sources()) {
        by_input[input].add(&counts);
    }
    let read = survey
        .inputs
        .iter()
        .zip(by_input)
        .map(|(input, counts)| InputCount {
            path: input.path.display().to_string(),
            claimed: input.points_claimed,
            read: counts.read,
            rejected: counts.rejected,
            filtered: counts.filtered,
            outside: counts.outside,
            left_out: None,
        });
    let left_out = survey.left_out.iter().map(|bad| InputCount {
        path: bad.path.clone(),
        claimed: 0,
        read: 0,
        rejected: 0,
        filtered: 0,
        outside: 0,
        left_out: Some(bad.reason.clone()),
    });
    read.chain(left_out).collect()
}

/// Parts of inputs, biggest file first: the last to be decoded is a short one.
fn parts(survey: &Survey) -> Vec<Part> {
    let mut order: Vec<usize> = (0..survey.inputs.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse(survey.inputs[i].bytes));
    let parts = |i: usize| {
        survey.inputs[i]
            .parts(PART_POINTS, &survey.filter)
            .into_iter()
    };
    order
        .into_iter()
        .flat_map(|i| parts(i).map(move |part| (i, part)))
        .collect()
}

/// Points of `parts`, as the headers claim them.
fn points_of(parts: &[Part]) -> u64 {
    parts.iter().map(|(_, part)| part.end - part.start).sum()
}

/// Parts that one process brings to one spill, in their order: the same whoever asks.
fn groups(parts: &[Part]) -> Vec<&[Part]> {
    let points = points_of(parts);
    let count = points.div_ceil(GROUP_POINTS).clamp(1, GROUP_LIMIT as u64);
    let (mut groups, mut rest, mut taken) = (Vec::new(), parts, 0);
    while !rest.is_empty() {
        let number = groups.len() as u64 + 1;
        let is_of_group = |(_, part): &&Part| {
            let is_of_group = number == count || taken < number * points / count;
            if is_of_group {
                taken += part.end - part.start;
            }
            is_of_group
        };
        let (group, others) = rest.split_at(rest.iter().take_while(is_of_group).count());
        groups.push(group);
        rest = others;
    }
    groups
}

/// The files that failed, each once.
fn bad_files(survey: &Survey, parts: &[Part], failures: Vec<(usize, SourceError)>) -> JobError {
    let mut bad: Vec<LeftOut> = Vec::new();
    for (part, error) in failures {
        let path = survey.inputs[parts[part].0].path.display().to_string();
        if bad.iter().all(|known| known.path != path) {
            let reason = match error.downcast::<LasError>() {
                Ok(error) => error.problem,
                Err(error) => error.to_string(),
            };
            bad.push(LeftOut { path, reason });
        }
    }
    bad.sort_by(|a, b| a.path.cmp(&b.path));
    JobError::BadFiles(bad)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_alike_and_hold_every_part_once() {
        for (parts, expected) in [(1, 1), (8, 1), (20, 3), (10_000, 256)] {
            let mut parts: Vec<Part> = (0..parts)
                .map(|input| (input, 0..PART_POINTS - input as u64))
                .collect();
            // Files without points are read, too.
            parts.extend([(10_000, 0..0), (10_001, 0..0)]);
            let groups = groups(&parts);
            assert_eq!(groups.concat(), parts);
            assert_eq!(groups.len(), expected);
            let lengths = groups.iter().map(|group| group.len());
            let [least, most] = [lengths.clone().min(), lengths.max()].map(Option::unwrap);
            assert!(least * 2 >= most, "{least} to {most} parts");
        }
        assert!(groups(&[]).is_empty());
        assert_eq!(groups(&[(0, 0..0)]).len(), 1);
    }
}
