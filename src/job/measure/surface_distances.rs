//! How far a cloud lies from surfaces that are known exactly.

use std::path::PathBuf;

use super::bare_points::{BARE_BYTES, BarePoints};
use crate::{
    geometry::Stored,
    job::JobError,
    las::{InputFile, PointFilter, expand_inputs},
    quality::{DistanceFigures, DistanceTally},
    tile::{Source, SourceError, TileError},
};

/// Measures the distances of the points of the cloud in `files` from a known surface. `distance`
/// returns the distance of a point given in world coordinates; `spacing` (CRS units) is the unit
/// of the figures.
///
/// # Errors
///
/// [`JobError`] if a file cannot be read.
pub(crate) fn measure_against_surface(
    files: &[PathBuf],
    spacing: f64,
    distance: impl Fn([f64; 3]) -> f64,
) -> Result<DistanceFigures, JobError> {
    let mut tally = DistanceTally::new(spacing);
    for path in expand_inputs(files, &PointFilter::default())? {
        let input = InputFile::survey(&path)?;
        let quantization = InputFile::common_quantization(std::iter::once(&input));
        let failed = |e: SourceError| JobError::Tile(TileError::Sources(vec![(0, e)]));
        let all = 0..input.points_claimed;
        let mut points =
            BarePoints::open(&input, all, quantization).map_err(|e| failed(e.into()))?;
        let mut records = Vec::new();
        while points.next_batch(&mut records).map_err(failed)?.read > 0 {
            for record in records.chunks_exact(BARE_BYTES) {
                tally.push(distance(quantization.world(Stored::of_record(record))));
            }
        }
    }
    Ok(tally.figures())
}
