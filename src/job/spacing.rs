//! The spacing of a job, and what to do where there is none.

use super::JobError;
use crate::{
    spacing::{MAX_SITES_PER_POINT, SpacingError},
    tile::TileError,
};

/// The error of a job that has no spacing, with the option to change.
pub(super) fn refusal(error: SpacingError<TileError>) -> JobError {
    JobError::Refused(match error {
        SpacingError::Gather(error) => return error.into(),
        SpacingError::TooWide { spacing, extent } => format!(
            "--spacing {spacing} is too wide for this scan, which is {extent:.3} across (in CRS units): give \
             less than half of that"
        ),
        SpacingError::TooFine { spacing, scale } => format!(
            "--spacing {spacing} is finer than coordinates on a scale of {scale} can tell; give at least {}",
            2.0 * scale
        ),
        SpacingError::TooMany { count, points } => format!(
            "--count {count} is more than the {points} points of the scan can carry: at most \
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
            "--count {count} is more than this scan can carry: at a spacing of {spacing:.3e} it gives about \
             {reached:.0} points; ask for fewer"
        ),
    })
}
