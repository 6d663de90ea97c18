//! Stray returns: points that a scanner reports where there is nothing.

use super::{scanner::LARGEST_RANGE, street::Street};
use crate::geometry::Local;

/// The nearest return of rain (m).
const NEAREST_DROP: f64 = 1.0;
/// How far behind a surface an echo seems to come from (m), at least and at most.
const DETOUR: [f64; 2] = [0.5, 12.0];
/// How far beside a beam its edge may be, as a share of the range.
const HALF_BEAM: f64 = 0.01;
/// The least distance between two surfaces in one beam, for a return from between them (m).
const LEAST_GAP: f64 = 0.3;

impl Street {
    /// Returns the range of a stray return of a beam that meets a surface at `range`. Of the strays that `random`
    /// numbers between 0 and 1 choose, half are rain before the surface, a quarter echoes that took a detour and seem
    /// to come from behind it. A quarter are mixed of the surface and another one at the edge of the beam, and lie
    /// between these; where there is no other, they are rain.
    pub(super) fn stray_range(
        &self,
        origin: Local,
        direction: Local,
        range: f64,
        random: impl Fn(u64) -> f64,
    ) -> f64 {
        let (kind, share) = (random(0), random(1));
        if kind < 0.25 {
            return range + DETOUR[0] + share * (DETOUR[1] - DETOUR[0]);
        }
        if kind < 0.5 {
            let beside = [2, 3, 4].map(|k| HALF_BEAM * (2.0 * random(k) - 1.0));
            let edge = (direction + Local::from(beside)).normalize();
            let other = self.cast(origin, edge, LARGEST_RANGE);
            if let Some(other) = other.filter(|hit| (hit.range - range).abs() > LEAST_GAP) {
                return range + share * (other.range - range);
            }
        }
        // As many drops per metre everywhere.
        let nearest = NEAREST_DROP.min(0.5 * range);
        nearest + share * (range - nearest)
    }
}
