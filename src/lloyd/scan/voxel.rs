//! The cubic voxels of a scan, anchored at the run's origin.

use crate::{geometry::Quantization, lloyd::SolverOptions};

/// Voxels to a spacing. Two and a half give some thirty samples to a patch of radius 1.2 spacings. With
/// three, and the sums of all points in both cases, a simulated street of 5 M points had an energy ratio of
/// 1.034 where it has 1.025; other figures did not move.
pub(super) const VOXELS_PER_SPACING: f64 = 2.5;

/// The edge of a voxel (CRS units): at least one stored unit, as a finer voxel would contain
/// one point at most.
///
/// # Panics
///
/// Unless the spacing is positive.
pub(super) fn voxel_edge(quantization: &Quantization, options: &SolverOptions) -> f64 {
    let spacing = options.finest_spacing();
    assert!(spacing > 0.0, "a spacing of {spacing}");
    (spacing / VOXELS_PER_SPACING).max(quantization.scale)
}
