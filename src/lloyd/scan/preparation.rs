//! The way from points to the scan that is solved.
//!
//! ```text
//!   points ─► smoothed, if asked for ─► thinned ─► by voxel, with samples ─► holes closed
//! ```

use super::{
    filling::filling, points::Scan, smoothing::smoothed, thinning::LARGEST_COUNT_IN_VOXEL,
};
use crate::{
    geometry::{Quantization, Stored},
    lloyd::{SolverOptions, surface::Surface},
};

impl Scan {
    /// Thins `points`, smooths them, sorts them by voxel, takes the samples, and closes the
    /// holes, as `options` request.
    ///
    /// # Panics
    ///
    /// Unless spacing and fit radius are positive, and there are fewer than 2³² points.
    pub fn new(points: Vec<Stored>, quantization: Quantization, options: &SolverOptions) -> Self {
        let points = if options.smooth > 0.0 {
            let thinned = Self::thinned(points, &quantization, options);
            smoothed(thinned, &quantization, options)
        } else {
            points
        };
        let mut scan = Self::as_scanned(points, quantization, options);
        if scan.largest_count_in_voxel() > LARGEST_COUNT_IN_VOXEL {
            let kept = Self::thinned(scan.into_points(), &quantization, options);
            scan = Self::as_scanned(kept, quantization, options);
        }
        let filling = filling(Surface::new(&scan, options));
        if !filling.is_empty() {
            scan.fill(filling, options);
        }
        scan
    }
}
