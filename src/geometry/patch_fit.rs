//! The fit of a patch: the best fitting plane, and over it heights by least squares (paper,
//! section III-B).

use nalgebra::Matrix3;

use super::{
    Local,
    height_equations::HeightEquations,
    heights::Heights,
    lanes::{LANES, Lanes, added, weight},
    narrow_frame::narrow_frame,
    patch::{Patch, PatchKind},
};

/// A fit to fewer neighbours is a plane: six coefficients would follow the noise.
const MIN_QUADRATIC_SUPPORT: u32 = 9;
/// A larger residual than this share of the radius is no noise of samples that are means: there
/// is no smooth surface (an edge, leaves).
const LARGEST_NOISE_IN_RADII: f64 = 0.025;
/// Heights that bend by more than this many radii over a radius follow the chance of few neighbours between which nothing holds them. Of 63 000
/// patches of a smaller radius near the edges of a simulated street 0.3 % bent by more than five radii, the worst by 168, with foot points up to 23
/// spacings away. With a limit of two, points of another street were up to 1.13 times as far from the truth.
const LARGEST_BEND_IN_RADII: f64 = 4.0;
/// Fewer neighbours determine no plane.
const MIN_SUPPORT: u32 = 4;

impl Patch {
    /// Fits a patch to the `neighbors` that lie within `radius` of `seed`.
    ///
    /// `radius` (CRS units) is the only scale of the fit. On a smooth surface
    /// without noise the height is within O(`radius`³) and the slopes within
    /// O(`radius`²); noise asks for a larger radius, detail for a smaller one.
    ///
    /// `None` with fewer than four neighbours, or if they lie on one line.
    pub fn fit(seed: Local, neighbors: &[Local], radius: f64, kind: PatchKind) -> Option<Self> {
        Self::fit_weighted(seed, neighbors, &[], radius, kind)
    }

    /// Fits a patch as [`fit`](Self::fit) does, to `neighbors` of which each has one of the
    /// `weights` beside that by its distance; without any weights all weigh the same.
    pub(crate) fn fit_weighted(
        seed: Local,
        neighbors: &[Local],
        weights: &[f64],
        radius: f64,
        kind: PatchKind,
    ) -> Option<Self> {
        // Unknowns are scaled by `radius` throughout, so that everything has like
        // magnitude, and the pivot test below has no unit.
        let near = Lanes::new(seed, neighbors, weights, radius);

        // The best fitting plane: weighted mean and covariance.
        let mut sums = [[0.0; LANES]; 11];
        for [x, y, z, own] in near.clone() {
            for k in 0..LANES {
                let (x, y, z) = (x[k], y[k], z[k]);
                let w = own[k] * weight(x, y, z);
                let (wx, wy, wz) = (w * x, w * y, w * z);
                let is_near = f64::from(u8::from(w > 0.0));
                let terms = [
                    w,
                    is_near,
                    wx,
                    wy,
                    wz,
                    wx * x,
                    wx * y,
                    wx * z,
                    wy * y,
                    wy * z,
                    wz * z,
                ];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    sum[k] += term;
                }
            }
        }
        let [total, support, x, y, z, xx, xy, xz, yy, yz, zz] = sums.map(added);
        let support = support as u32;
        if support < MIN_SUPPORT {
            return None;
        }
        let mean = Local::new(x, y, z) / total;
        let covariance =
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz) - mean * mean.transpose() * total;
        let (spread, [u, v, n]) = narrow_frame(covariance)?;
        if spread[1].is_nan() || spread[1] <= 1e-9 * spread[0] {
            return None;
        }
        let foot = n.dot(&mean);
        // The frame stands at the seed's foot on the best fitting plane.
        let origin = seed + n * (foot * radius);
        let mut patch = Self {
            origin,
            axes: [u, v, n],
            heights: Heights::default(),
            // The residual of the plane.
            residual: (spread[2] / total).sqrt() * radius,
            roundness: (spread[1] / spread[0]).sqrt(),
            support,
        };
        if kind == PatchKind::Quadratic && support >= MIN_QUADRATIC_SUPPORT {
            patch.fit_heights(near, foot, radius);
        }
        Some(patch)
    }

    /// Fits the six coefficients by least squares; keeps the plane where the neighbours do not
    /// determine them. `foot` is the height of the plane over the seed.
    fn fit_heights(&mut self, near: Lanes<'_>, foot: f64, radius: f64) {
        let equations = HeightEquations::new(near, self.axes, foot);
        let solved = equations.solve().map(|(heights, products)| {
            let heights = Heights::from_units_of(radius, heights);
            (heights, products)
        });
        let most = LARGEST_BEND_IN_RADII * radius;
        let determined = solved.filter(|(heights, _)| heights.max_quadratic_term(radius) <= most);
        if let Some((heights, products)) = determined {
            self.heights = heights;
            // The share of the mean squared height over the plane that the coefficients explain.
            let explained = products / equations.total() * radius * radius;
            let free = (equations.effective_number() - 6.0).max(1.0);
            self.shrink(explained, free, radius);
        }
    }

    /// Shrinks the patch towards the plane by the share of its curvature that noise would
    /// explain, after James and Stein. `explained` is the part of the plane's squared residual
    /// that the coefficients explain (CRS units squared), `free` the effective number of
    /// neighbours beyond the coefficients.
    fn shrink(&mut self, explained: f64, free: f64, radius: f64) {
        let left = (self.residual.powi(2) - explained).max(0.0);
        // The patch has three coefficients more than the plane.
        let share = share_beyond(3.0 * noise_of(left, radius) / free, explained);
        let Heights { h, p, q, a, b, c } = &mut self.heights;
        for coefficient in [h, p, q, a, b, c] {
            *coefficient *= share;
        }
        let left_out = (1.0 - share).powi(2) * explained.max(0.0);
        self.residual = (left + left_out).sqrt();
    }
}

/// The share of the mean squared height that coefficients have `explained` beyond what noise explains `by_chance` (CRS units squared).
pub(super) fn share_beyond(by_chance: f64, explained: f64) -> f64 {
    if explained > by_chance {
        1.0 - by_chance / explained
    } else {
        0.0
    }
}

/// The part of the mean squared height that is `left` unexplained within `radius` which can be noise (CRS units squared).
pub(super) fn noise_of(left: f64, radius: f64) -> f64 {
    left.min((LARGEST_NOISE_IN_RADII * radius).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Dice;

    /// All quadratics that vanish on a circle have the same heights at neighbours on it: what is over its middle is anybody's guess.
    #[test]
    fn heights_that_the_neighbors_do_not_determine_are_those_of_the_plane() {
        let mut dice = Dice(7);
        let mut bent = 0;
        for _ in 0..2_000 {
            let mut noise = |size: f64| size * (2.0 * dice.roll() - 1.0);
            let near_circle = |k: i32| {
                let turn = f64::from(k) * std::f64::consts::TAU / 12.0;
                let distance = 0.5 + noise(0.002);
                Local::new(distance * turn.cos(), distance * turn.sin(), 0.0)
                    + Local::z() * noise(0.02)
            };
            let neighbors: Vec<Local> = (0..12).map(near_circle).collect();
            let seed = Local::zeros();
            let patch = Patch::fit(seed, &neighbors, 1.0, PatchKind::Quadratic).unwrap();
            let foot = patch.foot_point(seed).norm();
            assert!(foot < 1.0, "{foot}");
            bent += u32::from(patch.max_quadratic_term(1.0) > 0.0);
        }
        // Most are taken, if with a bend.
        assert!((1..2_000).contains(&bent), "{bent}");
    }
}
