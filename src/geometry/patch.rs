//! A quadratic patch: the surface near a seed, as a height over a plane.
//!
//! Accelerated Lloyd's Method for Resampling 3D Point Clouds, section III-B,
//! equation (4). The plane is the best fitting one of the neighbourhood; over
//! it the height is fitted by least squares:
//!
//! ```text
//!   w = h + p u + q v + ½ (a u² + 2 b u v + c v²)
//! ```
//!
//! Where we depart from the paper: the neighbours are those within a radius
//! tied to the spacing, thinned evenly, and not the k nearest (k points cover
//! a pinhead where the scan is dense and a house where it is sparse); they
//! weigh less towards the rim, so that the patch changes smoothly when a
//! neighbour comes or goes; the frame's origin is the seed itself; the surface
//! is kept as a formula, not as a mesh; and of what a quadratic explains beyond
//! the plane, the share is left out that noise alone would seem to explain.

use super::{Local, heights::Heights};

/// A height function of degree 2 over a tangent plane.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Patch {
    /// The position where `u = v = w = 0`.
    pub(crate) origin: Local,
    /// The directions of `u`, `v` and `w`: orthonormal, right-handed. The last
    /// is the narrow one of the neighbourhood.
    pub(crate) axes: [Local; 3],
    pub(super) heights: Heights,
    /// Root mean square of the heights that the patch leaves unexplained
    /// (CRS units), weighted as the fit was.
    pub(crate) residual: f64,
    /// Spread of the neighbours along their narrow direction in the plane over
    /// that along the wide one: 1 for a disc, 0 for a line.
    pub(crate) roundness: f64,
    /// Number of neighbours that carried weight.
    pub(crate) support: u32,
}

/// The kind of surface that is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PatchKind {
    /// A surface of degree 2, the paper's.
    #[default]
    Quadratic,
    /// A plane: the local planes of Chen et al. that the paper compares with.
    Plane,
}

/// A patch with a larger residual than this share of the smallest detail does not describe its
/// neighbourhood: leaves, clutter, two sheets.
const LARGEST_RESIDUAL_IN_DETAILS: f64 = 0.15;
/// A neighbourhood that is less round is a wire, not a surface.
const LEAST_ROUNDNESS: f64 = 0.2;

impl Patch {
    /// The plane through `origin` with this unit `normal`.
    pub(crate) fn plane(origin: Local, normal: Local) -> Self {
        // The axis that is farthest from the normal is across it.
        let along = Local::ith_axis(normal.iamin()).into_inner();
        let first = along.cross(&normal).normalize();
        Self {
            origin,
            axes: [first, normal.cross(&first), normal],
            heights: Heights::default(),
            residual: 0.0,
            roundness: 1.0,
            support: 0,
        }
    }

    /// Whether the patch describes its neighbourhood well enough to stand for a
    /// surface with details as small as `detail` (CRS units). A patch through leaves, clutter,
    /// two sheets or a wire does not.
    pub(crate) fn describes(&self, detail: f64) -> bool {
        self.residual <= LARGEST_RESIDUAL_IN_DETAILS * detail && self.roundness >= LEAST_ROUNDNESS
    }

    /// How far the patch can be relied on: 1 for a clean surface, falling to 0
    /// where it ceases to describe its neighbourhood.
    pub(crate) fn trust(&self, detail: f64) -> f64 {
        if self.describes(detail) {
            (2.0 * (1.0 - self.residual / (LARGEST_RESIDUAL_IN_DETAILS * detail))).min(1.0)
        } else {
            0.0
        }
    }

    /// `[u, v, w]` of `point` in the patch's frame.
    #[inline]
    pub(crate) fn coordinates(&self, point: Local) -> [f64; 3] {
        let d = point - self.origin;
        self.axes.map(|axis| axis.dot(&d))
    }

    /// The height `w` over `(u, v)`.
    #[inline]
    pub(crate) fn height(&self, u: f64, v: f64) -> f64 {
        self.heights.at(u, v)
    }

    /// The heights over the patch's plane, seen from `position`.
    #[inline]
    pub(super) fn heights_from(&self, position: Local) -> Heights {
        self.heights.seen_from(self.coordinates(position))
    }

    /// Bound on the quadratic term of the heights over a way of `length` (CRS units): four
    /// times the largest distance of a chord from the patch.
    #[inline]
    pub(crate) fn max_quadratic_term(&self, length: f64) -> f64 {
        self.heights.max_quadratic_term(length)
    }

    /// The position that is seen from `site` in the direction `way` of the patch's frame.
    #[inline]
    pub(super) fn seen_from(&self, site: Local, way: Local) -> Local {
        site + self.axes[0] * way.x + self.axes[1] * way.y + self.axes[2] * way.z
    }

    /// The point of the patch over `(u, v)`.
    #[inline]
    pub(crate) fn point(&self, u: f64, v: f64) -> Local {
        self.origin + self.axes[0] * u + self.axes[1] * v + self.axes[2] * self.height(u, v)
    }

    /// The foot point of `point`: its projection along the normal of the plane
    /// (paper, section IV-D).
    pub fn foot_point(&self, point: Local) -> Local {
        let [u, v, _] = self.coordinates(point);
        self.point(u, v)
    }

    /// The unit normal at the origin, of either sign.
    #[inline]
    pub(crate) fn normal(&self) -> Local {
        let Heights { p, q, .. } = self.heights;
        (self.axes[2] - self.axes[0] * p - self.axes[1] * q).normalize()
    }

    /// The unit normal at the origin that points upwards, of a vertical surface northwards
    /// or else eastwards, and the mean curvature there (1 / CRS unit), positive where the
    /// surface bends towards the normal.
    pub(crate) fn upwards(&self) -> (Local, f64) {
        let Heights { p, q, a, b, c, .. } = self.heights;
        let steep = 1.0 + p * p + q * q;
        let numerator = (1.0 + q * q) * a - 2.0 * p * q * b + (1.0 + p * p) * c;
        let curvature = numerator / (2.0 * steep * steep.sqrt());
        let normal = self.normal();
        match points_upwards(normal) {
            false => (-normal, -curvature),
            true => (normal, curvature),
        }
    }

    /// The larger of the two principal curvatures over the origin, without its sign (1 / CRS unit).
    pub(crate) fn largest_curvature(&self) -> f64 {
        let Heights { p, q, a, b, c, .. } = self.heights;
        let steep = 1.0 + p * p + q * q;
        let gaussian = (a * c - b * b) / (steep * steep);
        let mean = self.upwards().1.abs();
        mean + (mean * mean - gaussian).max(0.0).sqrt()
    }

    /// The unit normal over `(u, v)` in the patch's frame.
    #[inline]
    pub(crate) fn normal_at(&self, u: f64, v: f64) -> Local {
        let [p, q] = self.heights.slopes(u, v);
        (self.axes[2] - self.axes[0] * p - self.axes[1] * q).normalize()
    }

    /// Gaussian curvature over the origin (CRS units to the −2).
    #[cfg(test)]
    pub(crate) fn gaussian_curvature(&self) -> f64 {
        let Heights { p, q, a, b, c, .. } = self.heights;
        (a * c - b * b) / (1.0 + p * p + q * q).powi(2)
    }
}

/// Whether a `normal` points upwards, that of a vertical surface northwards or else eastwards.
fn points_upwards(normal: Local) -> bool {
    (normal.z, normal.y, normal.x) >= (0.0, 0.0, 0.0)
}

/// The one of `normal` and its opposite that points upwards, that of a vertical surface northwards or else eastwards.
pub(crate) fn upwards(normal: Local) -> Local {
    if points_upwards(normal) {
        normal
    } else {
        -normal
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of `surface` over an irregular disc, turned out of the axes.
    fn sampled(surface: impl Fn(f64, f64) -> f64, radius: f64) -> (Local, Vec<Local>) {
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, -0.7, 1.1);
        let shift = Local::new(12.0, -7.0, 3.0);
        let mut points = Vec::new();
        for i in -9..=9 {
            for j in -9..=9 {
                let jitter = 0.05 * f64::from((i * 7 + j * 3) % 5);
                let (x, y) = (
                    radius * (f64::from(i) + jitter) / 9.0,
                    radius * (f64::from(j) - jitter) / 9.0,
                );
                points.push(turn * Local::new(x, y, surface(x, y)) + shift);
            }
        }
        (
            turn * Local::new(0.0, 0.0, surface(0.0, 0.0)) + shift,
            points,
        )
    }

    fn fitted(surface: impl Fn(f64, f64) -> f64, radius: f64) -> (Local, Patch) {
        let (seed, points) = sampled(surface, radius);
        let patch = Patch::fit(seed, &points, radius, PatchKind::Quadratic).unwrap();
        (seed, patch)
    }

    #[test]
    fn a_plane_is_reproduced_exactly() {
        let (seed, patch) = fitted(|x, y| 0.3 * x - 0.2 * y, 1.0);
        assert!(patch.residual < 1e-12);
        assert!((patch.foot_point(seed) - seed).norm() < 1e-12);
        assert!(patch.gaussian_curvature().abs() < 1e-10);
    }

    #[test]
    fn a_sphere_has_the_gaussian_curvature_of_its_radius() {
        for radius in [2.0, 5.0] {
            let (seed, patch) = fitted(
                |x, y| radius - (radius * radius - x * x - y * y).sqrt(),
                0.4,
            );
            let curvature = 1.0 / (radius * radius);
            assert!((patch.gaussian_curvature() / curvature - 1.0).abs() < 0.05);
            assert!((patch.foot_point(seed) - seed).norm() < 2e-4);
        }
    }

    #[test]
    fn a_cylinder_has_no_gaussian_curvature_and_a_saddle_a_negative_one() {
        let (_, cylinder) = fitted(|x, _| 3.0 - (9.0 - x * x).sqrt(), 0.5);
        assert!((cylinder.largest_curvature() - 1.0 / 3.0).abs() < 5e-3);
        assert!(cylinder.gaussian_curvature().abs() < 1e-3);
        let (_, saddle) = fitted(|x, y| 0.2 * (x * x - y * y), 0.5);
        assert!((saddle.gaussian_curvature() + 0.16).abs() < 2e-3);
        assert!((saddle.largest_curvature() - 0.4).abs() < 5e-3);
    }

    #[test]
    fn the_height_converges_with_the_third_power_of_the_radius() {
        let error = |radius: f64| {
            let (seed, patch) = fitted(|x, y| (x + 0.3).sin() * (0.8 * y).cos(), radius);
            (patch.foot_point(seed) - seed).norm()
        };
        assert!(error(0.1) < error(0.4) / 16.0);
    }

    #[test]
    fn a_neighbor_with_a_weight_counts_as_often() {
        let (seed, points) = sampled(|x, y| 0.1 * x * x + 0.02 * (9.0 * x * y).sin(), 0.5);
        let weights: Vec<f64> = (0..points.len()).map(|k| 1.0 + (k % 3) as f64).collect();
        let often = points.iter().enumerate();
        let often: Vec<Local> = often
            .flat_map(|(k, &point)| std::iter::repeat_n(point, 1 + k % 3))
            .collect();
        let kind = PatchKind::Plane;
        let weighted = Patch::fit_weighted(seed, &points, &weights, 0.5, kind).unwrap();
        let repeated = Patch::fit(seed, &often, 0.5, kind).unwrap();
        assert!((weighted.origin - repeated.origin).norm() < 1e-12);
        assert!((weighted.axes[2] - repeated.axes[2]).norm() < 1e-9);
        assert!((weighted.residual - repeated.residual).abs() < 1e-12);
    }

    #[test]
    fn points_on_a_line_or_too_few_make_no_patch() {
        let line: Vec<Local> = (0..30)
            .map(|i| Local::new(f64::from(i) * 0.02, 0.0, 0.0))
            .collect();
        assert!(Patch::fit(line[3], &line, 1.0, PatchKind::Quadratic).is_none());
        assert!(Patch::fit(line[0], &line[..3], 1.0, PatchKind::Quadratic).is_none());
        let same = vec![Local::new(1.0, 2.0, 3.0); 40];
        assert!(Patch::fit(same[0], &same, 1.0, PatchKind::Quadratic).is_none());
        let bad = vec![Local::repeat(f64::NAN); 40];
        assert!(Patch::fit(bad[0], &bad, 1.0, PatchKind::Quadratic).is_none());
    }

    #[test]
    fn the_axes_are_orthonormal_and_right_handed() {
        let (_, patch) = fitted(|x, y| 0.1 * x * y, 1.0);
        let [u, v, n] = patch.axes;
        assert!((u.cross(&v) - n).norm() < 1e-12);
    }
}
