//! What the measurement of every part of a cloud needs to know.

use crate::{geometry::Quantization, tile::Spill, tiling::Plan};

/// How the parts of a cloud are measured. Lengths are CRS units.
pub(super) struct Measurement<'a> {
    /// The points of the cloud.
    pub(super) spill: &'a Spill,
    /// The parts.
    pub(super) plan: &'a Plan,
    /// Scale and offset of the points.
    pub(super) quantization: Quantization,
    /// The unit of the distances.
    pub(super) spacing: f64,
}
