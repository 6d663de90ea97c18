//! Every input once, to the spill.

use std::{ops::Range, path::Path, sync::atomic::AtomicBool};

use serde::{Deserialize, Serialize};

use super::{JobError, LeftOut, Progress, Survey, Unit, memory::Budget};
use crate::{
    las::{LasError, PointStream},
    tile::{
        CellGrid, Opener, PointCounts, ScatterOptions, Source, SourceError, Spill, TileError,
        scatter,
    },
};

/// Points of an input that are decoded by themselves.
const PART_POINTS: u64 = 1_000_000;
/// Bytes spilled between checkpoints: what a scatter that is killed loses.
const CHECKPOINT_BYTES: u64 = 1 << 30;

/// Points of one input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputCount {
    /// The file.
    pub path: String,
    /// Points that its header claims.
    pub claimed: u64,
    /// Points read.
    pub read: u64,
    /// Points out of the range of the run's scale, left out.
    pub rejected: u64,
    /// Points that were not asked for, left out.
    pub filtered: u64,
    /// Points outside of the bounds that the header claims.
    pub outside: u64,
    /// Why the whole file was left out, if it was.
    pub left_out: Option<String>,
}

impl Source for PointStream {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        Ok(Self::next_batch(self, records)?)
    }
}

/// Brings all inputs to the spill at `stem`, from where an earlier run left it; if
/// `keep_going`, all files that fail are named, not only the first.
///
/// # Errors
///
/// [`JobError::BadFiles`] if files cannot be read to their end.
pub(super) fn scatter_inputs(
    survey: &Survey,
    stem: &Path,
    budget: &Budget,
    keep_going: bool,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Result<Spill, JobError> {
    let parts = parts(survey);
    if !Spill::is_complete(stem) {
        let points = parts.iter().map(|(_, part)| part.end - part.start).sum();
        progress.begin("scatter", points, 0, Unit::Points);
        let sources = parts
            .iter()
            .map(|(input, part)| {
                let open = move |skip| {
                    let rest = part.start + skip..part.end;
                    let input = &survey.inputs[*input];
                    let (record, lattice) = (&survey.record, survey.lattice);
                    let stream = PointStream::open(input, rest, record, lattice, &survey.filter)?;
                    Ok(Box::new(stream) as Box<dyn Source>)
                };
                Box::new(open) as Opener<'_>
            })
            .collect();
        let options = ScatterOptions {
            record_length: survey.record.record_length(),
            threads: budget.decoders(),
            buffer_bytes: budget.buffers(),
            checkpoint_bytes: CHECKPOINT_BYTES,
            keep_going,
        };
        let usual = (1.0 / survey.lattice.scale).ceil() as i64;
        let grid = CellGrid::for_extent(survey.extent_claimed(), usual);
        scatter(
            sources,
            grid,
            stem,
            options,
            &|n| progress.advance(n),
            cancel,
        )
        .map_err(|error| match error {
            TileError::Sources(failures) => bad_files(survey, &parts, failures),
            other => JobError::Tile(other),
        })?;
        progress.end();
    }
    let spill = Spill::open(stem)?;
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

/// What was read of each input of `survey`, and what was left out.
pub(super) fn input_counts(survey: &Survey, spill: &Spill) -> Vec<InputCount> {
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
fn parts(survey: &Survey) -> Vec<(usize, Range<u64>)> {
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

/// The files that failed, each once.
fn bad_files(
    survey: &Survey,
    parts: &[(usize, Range<u64>)],
    failures: Vec<(usize, SourceError)>,
) -> JobError {
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
