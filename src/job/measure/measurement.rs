//! What the measurement of every part of a cloud needs to know.

use crate::{geometry::Quantization, tile::Spill, tiling::Plan};

/// How the parts of a cloud are measured. Lengths are CRS units.
pub(super) struct Measurement<'a> {
    /// The points of the cloud and of the scans it is compared with.
    pub(super) spill: &'a Spill,
    /// The parts.
    pub(super) plan: &'a Plan,
    /// Scale and offset of the points.
    pub(super) quantization: Quantization,
    /// The unit of the distances.
    pub(super) spacing: f64,
    /// The largest distance at which a part knows the nearest point of the other cloud; `None` if the
    /// cloud is compared with no scans.
    pub(super) comparison_reach: Option<f64>,
}
