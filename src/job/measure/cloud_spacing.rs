//! The spacing of a cloud that comes without one, from the mean nearest distance of a sample.

use super::bare_points::gather_bare;
use crate::{
    geometry::{NeighborGrid, Quantization},
    job::JobError,
    tile::Spill,
    tiling::Plan,
};

/// The mean nearest distance in an even cloud, in hexagonal spacings.
const MEAN_DISTANCE_IN_SPACINGS: f64 = 0.85;
/// The number of points after which no further part is read.
const ENOUGH_POINTS: usize = 1000;
/// The number of points whose nearest distances are computed, at most.
const SAMPLE_POINTS: usize = 5000;

/// Estimates the hexagonal spacing of the cloud in `spill` (CRS units), from the first of its
/// `parts` that together contain enough points.
///
/// # Errors
///
/// [`JobError::Refused`] if no two points differ; [`JobError::Tile`] if the spill cannot be read.
pub(super) fn estimated_spacing(
    spill: &Spill,
    parts: &Plan,
    quantization: Quantization,
) -> Result<f64, JobError> {
    let mut positions = Vec::new();
    for part in &parts.tiles {
        let cloud = gather_bare(spill, &part.core)?;
        positions.extend(cloud.into_iter().map(|point| quantization.local(point)));
        if positions.len() >= ENOUGH_POINTS {
            break;
        }
    }
    let extent = spill.bounds().extent() as f64 * quantization.scale;
    let cell = (extent / (positions.len().max(1) as f64).sqrt()).max(quantization.scale);
    let grid = NeighborGrid::new(&positions, cell);
    let (mut sum, mut count) = (0.0, 0_u32);
    let step = positions.len().div_ceil(SAMPLE_POINTS).max(1);
    for &position in positions.iter().step_by(step) {
        // Coincident points say nothing of the distance to the next place.
        // No two points of a cube are farther from each other than two edges.
        let nearest = grid.nearest(position, (2.0 * extent).max(cell), |other| {
            positions[other as usize] == position
        });
        if let Some((_, distance_squared)) = nearest {
            sum += distance_squared.sqrt();
            count += 1;
        }
    }
    if count == 0 {
        return Err(JobError::Refused(
            "the cloud has no two different points: there is nothing to measure".into(),
        ));
    }
    Ok(sum / f64::from(count) / MEAN_DISTANCE_IN_SPACINGS)
}
