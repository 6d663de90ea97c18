//! The weighted neighbours of a fit, several at a time.

use super::Local;

/// Number of neighbours that are added at a time, each to a sum of its own: processors do that
/// at once, and in the same order everywhere.
pub(super) const LANES: usize = 4;

/// Neighbours in groups of [`LANES`], seen from the seed, in units of the radius, and the weight
/// that each has by itself. The last group is filled up with positions where the weight by the
/// distance is zero.
#[derive(Clone)]
pub(super) struct Lanes<'a> {
    seed: Local,
    per_radius: f64,
    rest: std::slice::Chunks<'a, Local>,
    weights: std::slice::Chunks<'a, f64>,
}

impl<'a> Lanes<'a> {
    /// The `neighbors` of `seed` with these `weights`; without any weights all weigh the same.
    pub(super) fn new(
        seed: Local,
        neighbors: &'a [Local],
        weights: &'a [f64],
        radius: f64,
    ) -> Self {
        Self {
            seed,
            per_radius: 1.0 / radius,
            rest: neighbors.chunks(LANES),
            weights: weights.chunks(LANES),
        }
    }
}

impl Iterator for Lanes<'_> {
    /// The three coordinates, and the weights.
    type Item = [[f64; LANES]; 4];

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let mut lanes = [[2.0; LANES]; 4];
        lanes[3] = [1.0; LANES];
        for (k, point) in self.rest.next()?.iter().enumerate() {
            let d = (point - self.seed) * self.per_radius;
            lanes[0][k] = d.x;
            lanes[1][k] = d.y;
            lanes[2][k] = d.z;
        }
        if let Some(weights) = self.weights.next() {
            lanes[3][..weights.len()].copy_from_slice(weights);
        }
        Some(lanes)
    }
}

/// The weight by the distance of a neighbour at (x, y, z), seen from the seed, in units of the radius.
#[inline]
pub(super) fn weight(x: f64, y: f64, z: f64) -> f64 {
    let w = (1.0 - (x * x + y * y + z * z)).max(0.0);
    w * w
}

/// The sum over the lanes.
#[inline]
pub(super) fn added(lanes: [f64; LANES]) -> f64 {
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}
