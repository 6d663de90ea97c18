//! The way from points to the scan that is solved.
//!
//! ```text
//!   points ─► smoothed, if asked for ─► thinned ─► by voxel, with samples ─► holes closed
//! ```

use super::{filling::filling, points::Scan, smoothing::smoothed, thinned::ThinnedPoints};
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
        Self::prepared(points.into(), quantization, options)
    }

    /// Thins, smooths, sorts, samples and closes like [`new`](Self::new) what is left of
    /// `points` that may have been thinned before.
    ///
    /// # Panics
    ///
    /// Unless spacing and fit radius are positive, and there are fewer than 2³² points.
    pub(crate) fn prepared(
        points: ThinnedPoints,
        quantization: Quantization,
        options: &SolverOptions,
    ) -> Self {
        Self::closed(points, quantization, options, |scan| {
            filling(Surface::new(scan, options))
        })
    }

    /// Prepares `points` like [`prepared`](Self::prepared), but closes the holes with the
    /// positions `filling`, which are known.
    ///
    /// # Panics
    ///
    /// Unless spacing and fit radius are positive, and there are fewer than 2³² points.
    pub(crate) fn filled_with(
        filling: Vec<Stored>,
        points: ThinnedPoints,
        quantization: Quantization,
        options: &SolverOptions,
    ) -> Self {
        Self::closed(points, quantization, options, |_| filling)
    }

    /// Thins, smooths, sorts and samples `points`, and closes the holes with the positions
    /// `filling`.
    fn closed(
        mut points: ThinnedPoints,
        quantization: Quantization,
        options: &SolverOptions,
        filling: impl FnOnce(&Self) -> Vec<Stored>,
    ) -> Self {
        if options.smooth > 0.0 {
            points = smoothed(points, &quantization, options);
        }
        let mut scan = Self::thinned(points, quantization, options);
        let filling = filling(&scan);
        if !filling.is_empty() {
            scan.fill(filling, options);
        }
        scan
    }
}
