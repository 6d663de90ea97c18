//! Points of a rectangle, however many were scanned there.

use crate::job::JobError;
use crate::{
    geometry::{Quantization, Rect, Stored},
    lloyd::SolverOptions,
    tile::Spill,
    tiling::CountedCloud,
};

/// The points of `spill` in `rect`, all of them or, if they are more than `crowd`,
/// no fewer than a scan for `options` keeps of them. ResourceSample at a time are about twice
/// as many as are kept, or `crowd`.
pub(crate) fn gather_points(
    spill: &Spill,
    rect: &Rect,
    quantization: &Quantization,
    options: &SolverOptions,
    crowd: u64,
) -> Result<Vec<Stored>, JobError> {
    Ok(CountedCloud::gather(
        spill,
        rect,
        quantization,
        options,
        crowd,
    )?)
}
