//! What single precision takes of the coordinates of a PCD file.

use super::survey::Survey;
use crate::{job::description::JobDescription, las::Format};

/// The step of coordinates (CRS units) below which a loss is of no use to know.
const FINEST_STEP: f64 = 0.001;

/// A note where the output of `job` is PCD and its points are so far from their origin that they are rounded by more than their scale
/// rounds them.
pub(super) fn note_on_pcd(job: &JobDescription, survey: &Survey) -> Option<String> {
    if !job.format().is_ok_and(Format::is_pcd) {
        return None;
    }
    let (mut min, mut max) = survey.claimed_bounds();
    if let Some([west, south, east, north]) = survey.filter.bounds {
        min = [min[0].max(west), min[1].max(south), min[2]];
        max = [max[0].min(east), max[1].min(north), max[2]];
    }
    let loss = job.settings.pcd.origin.largest_rounding(min, max);
    let metres = (survey.crs.as_ref()).and_then(|crs| crs.metres_per_unit());
    let (in_unit, unit) = match metres {
        Some(metres) => (loss * metres, "m"),
        None => (loss, "CRS units"),
    };
    (loss > 0.5 * survey.quantization.scale.max(FINEST_STEP)).then(|| {
        format!(
            "coordinates of PCD have 24 bits, and the points are far from their origin: they are rounded by up to {in_unit:.4} \
             {unit}; give a nearer --pcd-origin, or write LAZ"
        )
    })
}
