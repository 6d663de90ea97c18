//! The region of a tile, and the sites that can still influence it.
//!
//! ```text
//!   ┌───────────────────────┐   available   every point of the input in here is in the scan
//!   │   ┌ ─ ─ ─ ─ ─ ─ ─ ┐   │
//!   │     ┌───────────┐     │   band          results wanted for comparison with neighbours
//!   │   │ │   core    │ │   │   core          results wanted
//!   │     └───────────┘     │
//!   │   └ ─ ─ ─ ─ ─ ─ ─ ┘   │   A site outside of the band matters while the iterations that
//!   └───────────────────────┘   are left can carry its influence there: the dependency cone.
//! ```

use super::{options::SolverOptions, round::Round};
use crate::geometry::{Local, Quantization, Rect, Stored};

/// The part of the plane that is available, and the part in which sites are wanted.
#[derive(Clone, Copy, Debug)]
pub struct TileRegion {
    /// The rectangle in which every point of the input is in the scan.
    pub available: Rect,
    /// The rectangle in which elected sites are wanted.
    pub core: Rect,
    /// Width (stored units) of the band around the core in which sites are wanted too, to be
    /// compared with those of neighbouring tiles.
    pub band: i64,
}

/// Influence is followed this many times as far as it is taken to travel: the cone must not
/// change what is exact. On six real scans in 8 to 21 tiles the same sites are exact as with 1.6; one of them takes 0.94 of the
/// processor time.
const CONE_SAFETY: f64 = 1.25;

impl TileRegion {
    /// The region of a whole cloud, without tiles.
    pub fn everything() -> Self {
        const BEYOND_ALL_COORDINATES: i64 = 1 << 40;
        let all = Rect {
            min: [-BEYOND_ALL_COORDINATES; 2],
            max: [BEYOND_ALL_COORDINATES; 2],
        };
        Self {
            available: all,
            core: all,
            band: 0,
        }
    }

    /// Whether the site that was elected at `identity` is wanted.
    pub(super) fn wants(&self, identity: Stored) -> bool {
        self.core.contains(identity) || self.core.depth(identity) > -self.band
    }
}

/// The sites that can still influence the wanted ones: all at first, fewer with every
/// iteration.
pub(super) struct DependencyCone<'a> {
    region: &'a TileRegion,
    /// The first iteration of the next round.
    end: u32,
    /// Bound on how far influence travels in one iteration (stored units).
    reach: f64,
    /// Depth inside the available rectangle from which on sites and samples are right as the
    /// round begins (stored units).
    margin: i64,
}

impl<'a> DependencyCone<'a> {
    pub(super) fn new(
        region: &'a TileRegion,
        round: &Round,
        options: &SolverOptions,
        quantization: &Quantization,
    ) -> Self {
        Self {
            region,
            end: round.iterations.end,
            reach: CONE_SAFETY * options.reach_of_an_iteration() / quantization.scale,
            margin: quantization.units(round.margin),
        }
    }

    /// Whether the site of `identity` can influence a wanted site from `iteration` of the round
    /// on.
    pub(super) fn matters(&self, identity: Stored, iteration: u32) -> bool {
        let rings = f64::from(self.end - iteration + 2);
        let away = -self.region.core.depth(identity) - self.region.band;
        away as f64 <= rings * self.reach
    }

    /// Whether all sites within `radius` (CRS units) of `position` are those with which every
    /// tile began the round.
    pub(super) fn has_right_sites(
        &self,
        position: Local,
        radius: f64,
        quantization: &Quantization,
    ) -> bool {
        quantization.stored(position).is_some_and(|stored| {
            let margin = self.margin + quantization.units(radius);
            self.region.available.depth(stored) >= margin
        })
    }

    /// Whether every tile elects the seed `identity`.
    pub(super) fn is_right_seed(&self, identity: Stored) -> bool {
        self.region.available.depth(identity) >= self.margin
    }
}
