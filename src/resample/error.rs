//! Why a cloud cannot be resampled.

use crate::spacing::{MAX_SITES_PER_POINT, SpacingError};

/// The shortest length that can be asked for, and the least extent of points at several places, the inverse of the farthest
/// coordinate. Powers of lengths that are much shorter are no longer numbers of 64 bits.
pub(super) const SHORTEST_LENGTH: f64 = 1e-12;

/// Why [`resample`](crate::resample) gave no points. Lengths are in the unit of the points.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResampleError {
    /// A setting of the options is out of its range.
    #[error("{option} {}: {remedy}", short(*value))]
    InvalidOption {
        /// The method of [`Options`](crate::Options) that set it.
        option: &'static str,
        /// The value that was given.
        value: f64,
        /// What the value must be.
        remedy: &'static str,
    },
    /// There is no input point.
    #[error("there are no points to resample")]
    NoPoints,
    /// There are more input points than indices of 32 bits.
    #[error(
        "{points} points are more than can be resampled in memory: cut the cloud, or run a job on files"
    )]
    TooManyPoints {
        /// Number of input points.
        points: usize,
    },
    /// A coordinate is not a number, infinite, or too large for a cloud of surfaces.
    #[error("point {index}: coordinates {coordinates:?} are not within ±10¹²; remove the point")]
    InvalidPoint {
        /// Index of the first such input point.
        index: usize,
        /// The coordinates of that point.
        coordinates: [f64; 3],
    },
    /// The input points are so near to each other that powers of their distances are no longer numbers.
    #[error(
        "the cloud is {extent:e} across, less than {SHORTEST_LENGTH:e}: give points and lengths in a smaller unit"
    )]
    TooSmall {
        /// The longest side of the bounding box of the input.
        extent: f64,
    },
    /// All input points are equal, and a count or a ratio was requested.
    #[error(
        "all {points} points are equal: there is no spacing between them; give a spacing instead"
    )]
    AllEqual {
        /// Number of input points.
        points: usize,
    },
    /// The spacing is more than half of the extent of the cloud.
    #[error(
        "spacing {spacing} is too wide for a cloud that is {extent} across: give less than half of that"
    )]
    TooWide {
        /// The requested spacing.
        spacing: f64,
        /// The longest side of the bounding box of the input.
        extent: f64,
    },
    /// The spacing is less than two steps of the grid that coordinates are rounded to.
    #[error("spacing {spacing} is finer than coordinates on a scale of {scale} can tell: give at least {}", 2.0 * scale)]
    TooFine {
        /// The requested spacing.
        spacing: f64,
        /// The step of the grid.
        scale: f64,
    },
    /// More points are requested than a cloud of this size is given.
    #[error(
        "count {count} is more than {points} points can carry: at most {MAX_SITES_PER_POINT} for each; ask for \
         fewer, or for a spacing"
    )]
    TooMany {
        /// The requested number of output points.
        count: u64,
        /// Number of input points.
        points: u64,
    },
    /// The surfaces of the cloud do not carry the count.
    #[error(
        "count {count} is more than this cloud can carry: at a spacing of {spacing:.3e} it gives approximately \
         {reached} points; ask for fewer"
    )]
    CannotCarry {
        /// The requested number of output points.
        count: u64,
        /// The finest spacing that was tried.
        spacing: f64,
        /// Estimated number of output points at that spacing.
        reached: u64,
    },
    /// The progress callback stopped the work.
    #[error("stopped by the caller")]
    Cancelled,
}

/// `value` without the zeros of a very small number.
fn short(value: f64) -> String {
    match value != 0.0 && value.abs() < SHORTEST_LENGTH {
        true => format!("{value:e}"),
        false => value.to_string(),
    }
}

impl From<SpacingError<Self>> for ResampleError {
    fn from(error: SpacingError<Self>) -> Self {
        match error {
            SpacingError::TooWide { spacing, extent } => Self::TooWide { spacing, extent },
            SpacingError::TooFine { spacing, scale } => Self::TooFine { spacing, scale },
            SpacingError::TooMany { count, points } => Self::TooMany { count, points },
            SpacingError::AllEqual { points } => Self::AllEqual {
                points: points as usize,
            },
            SpacingError::CannotCarry {
                count,
                spacing,
                reached,
            } => Self::CannotCarry {
                count,
                spacing,
                reached: reached.round() as u64,
            },
            SpacingError::Gather(error) => error,
        }
    }
}
