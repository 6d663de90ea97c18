//! A site with the figures of its cell.

use crate::{
    geometry::{Local, Stored},
    quality::Surroundings,
};

/// Bound on the search for the nearest other site.
pub(crate) const FARTHEST_NEIGHBOR_IN_SPACINGS: f64 = 4.0;

/// A site of a solution. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// The seed that the site started from; it decides in which tile the site is at home.
    pub identity: Stored,
    /// The position of the site after the last iteration (local coordinates).
    pub position: Local,
    /// Whether everything that the site depends on was available: all tiles for which this is
    /// true have the same bits.
    pub is_exact: bool,
    /// Whether the site stayed where it was elected, because no patch there can be trusted; it
    /// has no cell.
    pub is_fixed: bool,
    /// How far the patch describes the scan around it: 1 for a clean surface, less in rough places, 0 without a patch to
    /// trust.
    pub trust: f64,
    /// Whether neighbours bound the cell all around.
    pub is_closed: bool,
    /// Number of edges of the cell that lie on bisectors with neighbours.
    pub neighbors: u8,
    /// Unit normal of the patch, which points upwards; `None` without a patch to trust.
    pub normal: Option<Local>,
    /// Mean curvature of the patch (1 / CRS unit), positive where the surface bends towards
    /// the normal; NaN without a patch to trust.
    pub curvature: f64,
    /// The spacing that is wanted where the site is (CRS units).
    pub spacing: f64,
    /// Area of the cell (CRS units squared); 0 without a cell.
    pub area: f64,
    /// Energy of the cell (paper, equation 2); 0 without a cell.
    pub energy: f64,
    /// Distance to the nearest other site; infinite beyond
    /// `FARTHEST_NEIGHBOR_IN_SPACINGS`.
    pub nearest: f64,
}

impl Site {
    /// Whether the scan describes a surface where the site is, and not leaves, a wire or clutter.
    pub(crate) fn is_on_surface(&self) -> bool {
        self.trust >= 1.0
    }

    /// What is around the site.
    pub(crate) fn surroundings(&self) -> Surroundings {
        Surroundings::of(self.is_on_surface(), self.is_closed)
    }

    /// The area of the cell (CRS units squared), if the input describes a surface there and
    /// neighbours bound the cell all around.
    pub(crate) fn bounded_area(&self) -> Option<f64> {
        let is_bounded = self.is_closed && !self.is_fixed && self.area > 0.0;
        is_bounded.then_some(self.area)
    }
}
