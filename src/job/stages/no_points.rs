//! The error of a job whose inputs have no point to resample.

use super::survey::Survey;
use crate::{
    job::{error::JobError, numbers::counted},
    las::{PointCounts, PointFilter},
    tile::Spill,
};

/// The error that says why no point of the inputs is in the `spill`: the filter, or the range of
/// the quantization.
pub(super) fn no_points(survey: &Survey, spill: &Spill) -> JobError {
    let mut counts = PointCounts::default();
    spill.sources().for_each(|source| counts.add(&source));
    let options = filter_options(&survey.filter);
    if options.is_empty() || (counts.filtered == 0 && counts.rejected > 0) {
        return JobError::Refused(format!(
            "none of the {} points of the input is within the range of its own scale and offset; \
             there is nothing to resample",
            counts.read
        ));
    }

    // The rectangles side by side show a mistaken axis, unit or CRS at once.
    let digits = (-survey.quantization.scale.log10()).ceil().max(0.0) as usize;
    let (min, max) = survey.claimed_bounds();
    let rectangle = |[west, south, east, north]: [f64; 4]| {
        format!("x {west:.digits$} to {east:.digits$}, y {south:.digits$} to {north:.digits$}")
    };
    let scan = rectangle([min[0], min[1], max[0], max[1]]);
    let requested = [
        ("--bounds requests", survey.filter.bounds),
        (
            "--polygon lies within",
            survey
                .filter
                .polygons
                .as_ref()
                .map(|ground| ground.bounds()),
        ),
    ];
    let requested: String = requested
        .into_iter()
        .filter_map(|(what, sides)| Some(format!("; {what} {}", rectangle(sides?))))
        .collect();
    // Parts of the inputs outside of the requested bounds are not even read, so the headers count.
    let claimed = survey.points_claimed();
    JobError::Refused(format!(
        "{} {} no point of the {claimed} in the input, and there is nothing to resample: the scan \
         covers {scan}{requested}; give another filter, or none",
        options.join(" and "),
        match options.len() {
            1 => "leaves",
            _ => "leave",
        },
    ))
}

/// The error that says that all of the `isolated` returns, which were to be left out, are all that there is.
pub(super) fn all_isolated(isolated: u64, spacing: f64) -> JobError {
    JobError::Refused(format!(
        "all {} that the output would have are isolated returns, and --isolated drop leaves them out; the \
         scan is too sparse for a spacing of {spacing}: give a wider one, or --isolated keep",
        counted(isolated, "point")
    ))
}

/// The options that give the conditions of `filter`.
fn filter_options(filter: &PointFilter) -> Vec<&'static str> {
    [
        ("--bounds", filter.bounds.is_some()),
        ("--polygon", filter.polygons.is_some()),
        ("--keep-class", filter.keep_classes.is_some()),
        ("--drop-class", !filter.drop_classes.is_empty()),
        ("--drop-withheld", filter.drop_withheld),
    ]
    .into_iter()
    .filter_map(|(option, is_given)| is_given.then_some(option))
    .collect()
}
