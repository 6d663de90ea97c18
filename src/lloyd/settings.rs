//! Settings of the solver that are known before the spacing is.

use serde::{Deserialize, Serialize};

use super::{Acceleration, EdgeRule, Grading, IsolatedRule, Restriction, SeedRule, SolverOptions};
use crate::geometry::PatchKind;

/// Settings of the solver that are known before the spacing is. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SolverSettings {
    /// Number of Lloyd iterations: the paper's K.
    pub(crate) iterations: u32,
    /// How centroids are extrapolated to the positions of the next iteration.
    pub(crate) acceleration: Acceleration,
    /// The rule by which seeds are chosen.
    pub(crate) seeds: SeedRule,
    /// The kind of surface that is fitted near a site.
    pub(crate) patch: PatchKind,
    /// How far from the scan a site may move.
    pub(crate) restriction: Restriction,
    /// Radius of the surface fit; `None` stands for a multiple of the spacing.
    pub(crate) smooth: Option<f64>,
    /// Width of the widest hole to close, 0 for none; `None` stands for a multiple of the spacing.
    pub(crate) fill: Option<f64>,
    /// Where sites next to a sharp edge end.
    #[serde(default, skip_serializing_if = "EdgeRule::is_default")]
    pub(crate) edges: EdgeRule,
    /// How the spacing varies; `None` if it is the same everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) grading: Option<Grading>,
    /// Seed of every hash.
    pub(crate) seed: u64,
    /// What becomes of isolated returns.
    #[serde(default, skip_serializing_if = "IsolatedRule::is_default")]
    pub(crate) isolated: IsolatedRule,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            iterations: 20,
            acceleration: Acceleration::default(),
            seeds: SeedRule::default(),
            patch: PatchKind::default(),
            restriction: Restriction::Local,
            smooth: None,
            fill: None,
            edges: EdgeRule::default(),
            grading: None,
            seed: 0,
            isolated: IsolatedRule::default(),
        }
    }
}

impl SolverSettings {
    /// Whether isolated returns are left out.
    pub(crate) fn drops_isolated(&self) -> bool {
        self.isolated == IsolatedRule::Drop
    }

    /// Settings like these with which isolated returns stay.
    pub(crate) fn with_isolated(self) -> Self {
        Self {
            isolated: IsolatedRule::Keep,
            ..self
        }
    }

    /// Options of the solver at `spacing` (CRS units), if approximately `seeds_per_point` sites are to result
    /// for each point of the scan.
    pub(crate) fn at(&self, spacing: f64, seeds_per_point: f64) -> SolverOptions {
        let defaults = SolverOptions::new(spacing);
        // Holes are a few spacings wide: spacings of the output, or of the scan where the scan is coarser.
        let scan_is_coarser = seeds_per_point.max(1.0).sqrt();
        SolverOptions {
            fill: self.fill.unwrap_or(defaults.fill * scan_is_coarser),
            fit_radius: self.smooth.unwrap_or(f64::MAX).min(defaults.fit_radius),
            smooth: self
                .smooth
                .filter(|&radius| radius > defaults.fit_radius)
                .unwrap_or(0.0),
            iterations: self.iterations,
            seeds: self.seeds,
            seeds_per_point,
            acceleration: self.acceleration,
            patch: self.patch,
            restriction: self.restriction,
            edge_capture: self.edges.capture(spacing),
            grading: self.grading.map(|grading| Grading {
                scales_fill: self.fill.is_none(),
                widest_fit: self.smooth.unwrap_or(f64::MAX),
                ..grading
            }),
            drops_isolated: self.drops_isolated(),
            seed: self.seed,
            ..defaults
        }
    }
}
