//! What of a cloud is known, what is asked for, and what can matter to that.

use super::SolverOptions;
use crate::geometry::{Local, Quantization, Rect, Stored};

/// What part of the plane is known, and what part is asked for.
#[derive(Clone, Copy, Debug)]
pub struct TileRegion {
    /// Every point of the input in here is in the scan.
    pub known: Rect,
    /// Sites elected in here are wanted …
    pub core: Rect,
    /// … and those this far around it (stored units), to compare with
    /// neighbours.
    pub band: i64,
}

impl TileRegion {
    /// The whole of a cloud, without tiles.
    pub fn everything() -> Self {
        const FAR: i64 = 1 << 40;
        let all = Rect {
            min: [-FAR; 2],
            max: [FAR; 2],
        };
        Self {
            known: all,
            core: all,
            band: 0,
        }
    }

    /// Whether the site that was elected at `identity` is wanted.
    pub(super) fn wants(&self, identity: Stored) -> bool {
        self.core.contains(identity) || self.core.depth(identity) > -self.band
    }
}

/// Which sites can still reach the core: all at first, fewer with every
/// iteration.
pub(super) struct DependencyCone<'a> {
    domain: &'a TileRegion,
    iterations: u32,
    reach: f64,
    seed_margin: i64,
}

impl<'a> DependencyCone<'a> {
    pub(super) fn new(
        domain: &'a TileRegion,
        options: &SolverOptions,
        quantization: &Quantization,
    ) -> Self {
        Self {
            domain,
            iterations: options.iterations,
            // Half as much again as influence is taken to travel: what is
            // exact must not be lost to the cone.
            reach: 1.6 * options.reach_of_an_iteration() / quantization.scale,
            seed_margin: quantization.units(options.seed_margin()),
        }
    }

    pub(super) fn matters(&self, identity: Stored, iteration: u32) -> bool {
        let rings = f64::from(self.iterations - iteration + 2);
        let away = -self.domain.core.depth(identity) - self.domain.band;
        away as f64 <= rings * self.reach
    }

    /// Whether all seeds within `radius` (CRS units) of `place` are known to be right.
    pub(super) fn knows(&self, place: Local, radius: f64, quantization: &Quantization) -> bool {
        quantization.stored(place).is_some_and(|stored| {
            self.domain.known.depth(stored) >= self.seed_margin + quantization.units(radius)
        })
    }

    /// Whether the seed `identity` is known to be right.
    pub(super) fn knows_seed(&self, identity: Stored) -> bool {
        self.domain.known.depth(identity) >= self.seed_margin
    }
}
