//! Points of a rectangle, however many were scanned there.

use crate::job::JobError;
use crate::{
    geometry::{Quantization, Rect, Stored},
    lloyd::{Scan, SolverOptions},
    tile::Spill,
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
    let mut points: Vec<Stored> = Vec::new();
    let mut most = crowd as usize;
    spill.gather_each(
        rect,
        |found: &mut Vec<Stored>, record| found.push(Stored::of_record(record)),
        |found| {
            points.extend(found);
            if points.len() > most {
                points = Scan::thinned(std::mem::take(&mut points), quantization, options);
                most = most.max(2 * points.len());
            }
        },
    )?;
    Ok(points)
}
