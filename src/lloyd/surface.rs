//! The surface that a scan shows at the scale of the solver's options.

use super::{Scan, SolverOptions};
use crate::geometry::{Local, Quantization};

/// A scan, and the options by which patches are fitted to it.
#[derive(Clone, Copy)]
pub(super) struct Surface<'a> {
    pub(super) scan: &'a Scan,
    pub(super) options: &'a SolverOptions,
}

impl<'a> Surface<'a> {
    #[inline]
    pub(super) fn new(scan: &'a Scan, options: &'a SolverOptions) -> Self {
        Self { scan, options }
    }

    /// The spacing of the output (CRS units).
    #[inline]
    pub(super) fn spacing(&self) -> f64 {
        self.options.spacing
    }

    /// The quantization of the run.
    #[inline]
    pub(super) fn quantization(&self) -> &'a Quantization {
        self.scan.quantization()
    }
}

/// The corners of the bounding box of `positions`.
pub(super) fn bounding_box(positions: impl Iterator<Item = Local>) -> [Local; 2] {
    let far = Local::repeat(f64::INFINITY);
    positions.fold([far, -far], |[low, high], position| {
        [low.inf(&position), high.sup(&position)]
    })
}
