//! Numbers of points of each input.

use serde::{Deserialize, Serialize};

use super::{input_parts::InputPart, survey::Survey};
use crate::{las::PointCounts, tile::Spill};

/// Numbers of points of one input.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct InputCount {
    /// Path of the file.
    pub(crate) path: String,
    /// Points that its header claims.
    pub(crate) claimed: u64,
    /// Points that were read.
    pub(crate) read: u64,
    /// Points out of the range of the run's quantization, which were left out.
    pub(crate) rejected: u64,
    /// Points that the filter excludes, which were left out.
    pub(crate) filtered: u64,
    /// Points outside of the bounds that the header claims.
    pub(crate) outside: u64,
    /// Why the whole file was left out; `None` if it was not.
    pub(crate) left_out: Option<String>,
}

/// Counts the points of each input of `survey` in its `spill`, then lists the inputs left out.
pub(super) fn input_counts(survey: &Survey, spill: &Spill) -> Vec<InputCount> {
    let mut by_input = vec![PointCounts::default(); survey.inputs.len()];
    for (part, counts) in InputPart::all(survey).iter().zip(spill.sources()) {
        by_input[part.input].add(&counts);
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
