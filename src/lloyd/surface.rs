//! The surface that a scan shows at the scale of the solver's options.

use super::{Scan, SolverOptions, field::SpacingField};
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

    /// The spacing of the output (CRS units); the coarsest one if it varies.
    #[inline]
    pub(super) fn spacing(&self) -> f64 {
        self.options.spacing
    }

    /// The spacing that is wanted everywhere.
    #[inline]
    pub(super) fn field(&self) -> &'a SpacingField {
        self.scan.field()
    }

    /// The options at `position`.
    #[inline]
    pub(super) fn options_at(&self, position: Local) -> SolverOptions {
        self.options.at(self.field().at(position))
    }

    /// The options at that of `positions` where the spacing is coarsest.
    pub(super) fn coarsest_options(&self, positions: impl Iterator<Item = Local>) -> SolverOptions {
        let spacings = positions.map(|position| self.field().at(position));
        self.options.at(spacings.fold(0.0, f64::max))
    }

    /// The surface by the options where the spacing is `spacing` (CRS units); they are put into `place` if they differ.
    #[inline]
    pub(super) fn at<'b>(&self, spacing: f64, place: &'b mut Option<SolverOptions>) -> Surface<'b>
    where
        'a: 'b,
    {
        match self.field().is_constant() {
            true => *self,
            false => self.with(place.insert(self.options.at(spacing))),
        }
    }

    /// The scan by other `options`: those of a place.
    #[inline]
    pub(super) fn with<'b>(&self, options: &'b SolverOptions) -> Surface<'b>
    where
        'a: 'b,
    {
        Surface::new(self.scan, options)
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
