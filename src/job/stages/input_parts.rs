//! Inputs in parts that are decoded independently, and groups of parts that processes share.

use std::ops::Range;

use super::survey::Survey;
use crate::{
    job::{
        cluster::GROUP_LIMIT,
        error::{JobError, LeftOut},
    },
    las::{LasError, PointStream},
    tile::SourceError,
};

/// Number of points in a part of an input: few enough that decoders end together, and that what is read
/// ahead of the decoder of a remote file is not much shorter: a part takes some four million bytes.
const POINTS_PER_PART: u64 = 250_000;

/// Largest number of points in a group of parts, as long as there are at most [`GROUP_LIMIT`]
/// groups. A process that is killed loses one group; a group has four parts for each of eight cores.
const POINTS_PER_GROUP: u64 = 32 * POINTS_PER_PART;

/// A part of an input.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct InputPart {
    /// The number of the input in the survey.
    pub(super) input: usize,
    /// The points of the part, by their numbers in the input.
    pub(super) points: Range<u64>,
}

impl InputPart {
    /// The parts of all inputs of `survey`, the largest file first: then the last part to be decoded
    /// is a short one.
    pub(super) fn all(survey: &Survey) -> Vec<Self> {
        let mut order: Vec<usize> = (0..survey.inputs.len()).collect();
        order.sort_by_key(|&input| std::cmp::Reverse(survey.inputs[input].bytes));
        let parts = |input: usize| {
            let parts = survey.inputs[input].parts(POINTS_PER_PART, &survey.filter);
            parts.into_iter().map(move |points| Self { input, points })
        };
        order.into_iter().flat_map(parts).collect()
    }

    /// The number of points in `parts`, as the headers claim them.
    pub(super) fn points_in(parts: &[Self]) -> u64 {
        parts.iter().map(Self::count).sum()
    }

    fn count(&self) -> u64 {
        self.points.end - self.points.start
    }

    /// Opens the part after the first `skip` of its points.
    ///
    /// # Errors
    ///
    /// See [`PointStream::open`].
    pub(super) fn open(&self, survey: &Survey, skip: u64) -> Result<PointStream, LasError> {
        let rest = self.points.start + skip..self.points.end;
        PointStream::open(
            &survey.inputs[self.input],
            rest,
            &survey.record,
            survey.quantization,
            &survey.filter,
        )
    }

    /// Divides `parts` into groups of nearly equal numbers of points. The order of the parts stays,
    /// and every process finds the same groups.
    pub(super) fn groups(parts: &[Self]) -> Vec<&[Self]> {
        let points = Self::points_in(parts);
        let count = points
            .div_ceil(POINTS_PER_GROUP)
            .clamp(1, GROUP_LIMIT as u64);
        let (mut groups, mut rest, mut taken) = (Vec::new(), parts, 0);
        while !rest.is_empty() {
            let number = groups.len() as u64 + 1;
            let is_of_group = |part: &&Self| {
                let is_of_group = number == count || taken < number * points / count;
                if is_of_group {
                    taken += part.count();
                }
                is_of_group
            };
            let (group, others) = rest.split_at(rest.iter().take_while(is_of_group).count());
            groups.push(group);
            rest = others;
        }
        groups
    }
}

/// The error that names each input with a part among `failures` once, with the reason of its first part.
pub(super) fn bad_files(
    survey: &Survey,
    parts: &[InputPart],
    mut failures: Vec<(usize, SourceError)>,
) -> JobError {
    failures.sort_by_key(|(part, _)| *part);
    let mut bad: Vec<LeftOut> = Vec::new();
    for (part, error) in failures {
        let path = &survey.inputs[parts[part].input].path;
        let path = path.display().to_string();
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

    fn part(input: usize, points: u64) -> InputPart {
        InputPart {
            input,
            points: 0..points,
        }
    }

    #[test]
    fn groups_are_alike_and_hold_every_part_once() {
        for (parts, expected) in [(1, 1), (32, 1), (80, 3), (10_000, 256)] {
            let mut parts: Vec<InputPart> = (0..parts)
                .map(|input| part(input, POINTS_PER_PART - input as u64))
                .collect();
            // Files without points are read, too.
            parts.extend([part(10_000, 0), part(10_001, 0)]);
            let groups = InputPart::groups(&parts);
            assert_eq!(groups.concat(), parts);
            assert_eq!(groups.len(), expected);
            let lengths = groups.iter().map(|group| group.len());
            let [least, most] = [lengths.clone().min(), lengths.max()].map(Option::unwrap);
            assert!(least * 2 >= most, "{least} to {most} parts");
        }
        assert!(InputPart::groups(&[]).is_empty());
        assert_eq!(InputPart::groups(&[part(0, 0)]).len(), 1);
    }
}
