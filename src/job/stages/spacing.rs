//! The spacing of a job, chosen once for the whole cloud.

use super::{sampled_spill::SampledSpill, scattered_cloud::ScatteredCloud};
use crate::{
    job::{
        error::JobError,
        numbers::{counted, thousands},
        progress::Progress,
    },
    spacing::{MAX_SITES_PER_POINT, SpacingError, resolve},
};

/// Name of the file in the job directory that contains the spacing.
const SPACING_FILE: &str = "spacing.json";

/// Chooses the spacing (CRS units), or reads the one that an earlier run chose. Returns it with the
/// approximate number of points of the output.
///
/// # Errors
///
/// [`JobError::Refused`] if there is no such spacing for this cloud.
pub(super) fn choose_spacing(cloud: &ScatteredCloud<'_>) -> Result<(f64, u64), JobError> {
    if let Some(found) = cloud.directory.read(SPACING_FILE) {
        return Ok(found);
    }
    let (spill, settings) = (cloud.spill, &cloud.run.job.settings);
    let quantization = cloud.quantization();
    let sampled = SampledSpill::new(spill, cloud.budget(), &settings.solver);
    let chosen = resolve(&sampled, quantization, &settings.solver, settings.target);
    let chosen = chosen.map_err(refusal)?;
    cloud.run.progress.note(&format!(
        "spacing {:.4}, about {} out of {}",
        chosen.0,
        counted(chosen.1, "point"),
        thousands(spill.points())
    ));
    cloud.directory.write(SPACING_FILE, &chosen)?;
    Ok(chosen)
}

/// The error of a job that has no spacing, with the option to change.
fn refusal(error: SpacingError<JobError>) -> JobError {
    JobError::Refused(match error {
        SpacingError::Gather(error) => return error,
        SpacingError::TooWide {
            spacing,
            extent: 0.0,
        } => format!(
            "--spacing {} is wider than the coordinates of this scan can tell, whose points are all in one place: give less",
            short(spacing)
        ),
        SpacingError::TooWide { spacing, extent } => format!(
            "--spacing {} is too wide for this scan, which is {extent:.3} across (in CRS units): \
             give less than half of that",
            short(spacing)
        ),
        SpacingError::TooFine { spacing, scale } => format!(
            "--spacing {} is finer than coordinates on a scale of {} can tell; give at least {}",
            short(spacing),
            short(scale),
            short(2.0 * scale)
        ),
        SpacingError::TooMany { count, points } => format!(
            "--count {count} (or a --ratio that gives it) is more than the {points} points of the scan can carry: at most \
             {MAX_SITES_PER_POINT} for each; ask for fewer, or for a --spacing"
        ),
        SpacingError::AllEqual { .. } => {
            "all points of the scan are equal: there is no spacing between them".into()
        }
        SpacingError::CannotCarry {
            count,
            spacing,
            reached,
        } => format!(
            "--count {count} (or a --ratio that gives it) is more than this scan can carry: at a spacing of {} it gives about \
             {reached:.0} points; ask for fewer",
            short(spacing)
        ),
    })
}

/// `length` with at most nine digits: 13.6 for 13.600000000000001.
fn short(length: f64) -> f64 {
    format!("{length:.8e}").parse().unwrap_or(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_is_printed_without_the_error_of_its_last_bit() {
        assert_eq!(short(13.600_000_000_000_001).to_string(), "13.6");
        assert_eq!(short(2.0 * 0.001).to_string(), "0.002");
        assert_eq!(short(1e-9).to_string(), "0.000000001");
    }
}
