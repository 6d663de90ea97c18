//! How the spacing may vary over a cloud.

use serde::{Deserialize, Serialize};

/// How the spacing may vary over a cloud. Everything is in proportion to the coarsest spacing, which is the one that the
/// options of the solver state.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grading {
    /// The finest spacing as a share of the coarsest.
    pub(crate) finest: f64,
    /// By how much the spacing may grow over a distance, per unit of the distance.
    pub(crate) slope: f64,
    /// How far around a point the rules look that say which spacing is wanted there (coarsest spacings).
    pub(crate) seen: f64,
    /// Whether the widest hole to close is a number of spacings, and not a length.
    pub(crate) scales_fill: bool,
    /// No patch is fitted to a wider neighbourhood (CRS units).
    pub(crate) widest_fit: f64,
}

/// The spacings of neighbouring layers differ by this factor, √2.
const LAYER_RATIO: f64 = std::f64::consts::SQRT_2;

/// A source is taken to be this wide around the middle of its cell, in edges of the cell: so all of the cell, and what lies
/// beside it on a patch, has the spacing that is wanted there.
pub(super) const SOURCE_RADIUS_IN_EDGES: f64 = 1.5;

impl Grading {
    /// The spacing (as a share of the coarsest) between `finest` and 1, in which a cell is at most `gradation` times as long
    /// as its neighbours. The rules look `seen` coarsest spacings around a point.
    pub(crate) fn new(finest: f64, gradation: f64, seen: f64) -> Self {
        Self {
            finest,
            // Two neighbours stand apart by the mean of their spacings.
            slope: 2.0 * (gradation - 1.0) / (gradation + 1.0),
            seen,
            scales_fill: true,
            widest_fit: f64::MAX,
        }
    }

    /// Distance (coarsest spacings) from which on the points of a scan do not matter to the spacing at a position.
    pub(crate) fn reach(&self) -> f64 {
        (1.0 - self.finest) / self.slope + 2.0 * SOURCE_RADIUS_IN_EDGES + self.seen
    }

    /// The finest spacing of each layer, as shares of the coarsest, in ascending order.
    pub(super) fn layers(&self) -> Vec<f64> {
        let shares = std::iter::successors(Some(self.finest), |share| Some(share * LAYER_RATIO));
        shares.take_while(|&share| share <= 1.0).collect()
    }
}
