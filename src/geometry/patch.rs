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
//! neighbour comes or goes; the frame's origin is the seed itself; and the
//! surface is kept as a formula, not as a mesh.

use nalgebra::{Matrix3, SymmetricEigen};

use super::Local;

/// A height function of degree 2 over a tangent plane.
///
/// Lengths are CRS units: `h` is a length, the slopes `p`, `q` have no unit,
/// the second derivatives `a`, `b`, `c` are inverse lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Where `u = v = w = 0`.
    pub origin: Local,
    /// The directions of `u`, `v` and `w`: orthonormal, right-handed.
    pub axes: [Local; 3],
    h: f64,
    p: f64,
    q: f64,
    a: f64,
    b: f64,
    c: f64,
    /// Root mean square of the heights that the patch leaves unexplained
    /// (CRS units), weighted as the fit was.
    pub residual: f64,
    /// Spread of the neighbours along their narrow direction in the plane over
    /// that along the wide one: 1 for a disc, 0 for a line.
    pub roundness: f64,
    /// Number of neighbours that carried weight.
    pub support: u32,
}

/// Which surface is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PatchKind {
    /// Degree 2, the paper's.
    #[default]
    Quadratic,
    /// Degree 1, the local planes of Chen et al. that the paper compares with.
    Plane,
}

/// With fewer neighbours six coefficients follow the noise: a plane is fitted.
const MIN_QUADRATIC_SUPPORT: u32 = 9;
/// With fewer neighbours there is no plane to speak of.
const MIN_SUPPORT: u32 = 4;

impl Patch {
    /// Fits a patch to those of `neighbors` that lie within `radius` of
    /// `seed`.
    ///
    /// `radius` (CRS units) is the only scale of the fit. On a smooth surface
    /// without noise the height is within O(`radius`³) and the slopes within
    /// O(`radius`²); noise asks for a larger radius, detail for a smaller one.
    ///
    /// `None` with fewer than four neighbours, or if they lie on one line.
    pub fn fit(seed: Local, neighbors: &[Local], radius: f64, kind: PatchKind) -> Option<Self> {
        let radius_squared = radius * radius;
        let weight = |d: Local| {
            let inside = 1.0 - d.norm_squared() / radius_squared;
            if inside > 0.0 { inside * inside } else { 0.0 }
        };

        // The best fitting plane: weighted mean and covariance.
        let (mut total, mut mean, mut support) = (0.0, Local::zeros(), 0);
        for &point in neighbors {
            let d = point - seed;
            let w = weight(d);
            if w > 0.0 {
                total += w;
                mean += d * w;
                support += 1;
            }
        }
        if support < MIN_SUPPORT {
            return None;
        }
        mean /= total;
        let mut covariance = Matrix3::zeros();
        for &point in neighbors {
            let d = point - seed;
            let w = weight(d);
            if w > 0.0 {
                let e = d - mean;
                covariance += e * e.transpose() * w;
            }
        }
        let (spread, [u, v, n]) = principal_axes(covariance)?;
        if spread[1].is_nan() || spread[1] <= 1e-9 * spread[0] {
            return None;
        }
        // The frame stands at the seed's foot on the best fitting plane.
        let origin = seed + n * n.dot(&mean);
        let mut patch = Self {
            origin,
            axes: [u, v, n],
            h: 0.0,
            p: 0.0,
            q: 0.0,
            a: 0.0,
            b: 0.0,
            c: 0.0,
            residual: 0.0,
            roundness: (spread[1] / spread[0]).sqrt(),
            support,
        };
        if kind == PatchKind::Quadratic && support >= MIN_QUADRATIC_SUPPORT {
            patch.fit_heights(seed, neighbors, radius, weight);
        }

        let mut squares = 0.0;
        for &point in neighbors {
            let w = weight(point - seed);
            if w > 0.0 {
                let [u, v, height] = patch.coordinates(point);
                squares += w * (height - patch.height(u, v)).powi(2);
            }
        }
        patch.residual = (squares / total).sqrt();
        Some(patch)
    }

    /// Least squares for the six coefficients; leaves the plane where the
    /// neighbours do not determine them.
    fn fit_heights(
        &mut self,
        seed: Local,
        neighbors: &[Local],
        radius: f64,
        weight: impl Fn(Local) -> f64,
    ) {
        // Unknowns are scaled by `radius`, so that the six columns have like
        // magnitude and the pivot test below has no unit.
        let mut normal = [[0.0; 6]; 6];
        let mut right = [0.0; 6];
        for &point in neighbors {
            let w = weight(point - seed);
            if w <= 0.0 {
                continue;
            }
            let [u, v, height] = self.coordinates(point).map(|c| c / radius);
            let row = [1.0, u, v, 0.5 * u * u, u * v, 0.5 * v * v];
            for i in 0..6 {
                let wi = w * row[i];
                right[i] += wi * height;
                for j in 0..=i {
                    normal[i][j] += wi * row[j];
                }
            }
        }
        if let Some([h, p, q, a, b, c]) = solve_cholesky(normal, right) {
            self.h = h * radius;
            self.p = p;
            self.q = q;
            self.a = a / radius;
            self.b = b / radius;
            self.c = c / radius;
        }
    }

    /// `[u, v, w]` of `point` in the patch's frame.
    pub fn coordinates(&self, point: Local) -> [f64; 3] {
        let d = point - self.origin;
        self.axes.map(|axis| axis.dot(&d))
    }

    /// The height `w` over `(u, v)`.
    pub fn height(&self, u: f64, v: f64) -> f64 {
        self.h + u * (self.p + 0.5 * self.a * u + self.b * v) + v * (self.q + 0.5 * self.c * v)
    }

    /// The point of the patch over `(u, v)`.
    pub fn point(&self, u: f64, v: f64) -> Local {
        self.origin + self.axes[0] * u + self.axes[1] * v + self.axes[2] * self.height(u, v)
    }

    /// The foot point of `point`: its projection along the normal of the plane
    /// (paper, section IV-D).
    pub fn foot_point(&self, point: Local) -> Local {
        let [u, v, _] = self.coordinates(point);
        self.point(u, v)
    }

    /// Unit normal at the origin; its sign means nothing.
    pub fn normal(&self) -> Local {
        (self.axes[2] - self.axes[0] * self.p - self.axes[1] * self.q).normalize()
    }

    /// Gaussian curvature over the origin (CRS units to the −2).
    pub fn gaussian_curvature(&self) -> f64 {
        (self.a * self.c - self.b * self.b) / (1.0 + self.p * self.p + self.q * self.q).powi(2)
    }
}

/// Eigenvalues in falling order with a right-handed frame of eigenvectors,
/// whose signs are fixed by the vectors themselves; `None` if `covariance` is
/// zero or not finite.
fn principal_axes(covariance: Matrix3<f64>) -> Option<([f64; 3], [Local; 3])> {
    // `SymmetricEigen` would not return from an infinite matrix.
    let scale = covariance.amax();
    if !(scale > 0.0 && scale.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(covariance / scale);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let spread = order.map(|k| eigen.eigenvalues[k].max(0.0) * scale);
    let u: Local = eigen.eigenvectors.column(order[0]).into();
    let n: Local = eigen.eigenvectors.column(order[2]).into();
    Some((spread, [u, n.cross(&u), n]))
}

/// Solves a symmetric positive system given by its lower triangle; `None` when
/// a pivot vanishes beside the diagonal it came from.
fn solve_cholesky(mut m: [[f64; 6]; 6], mut x: [f64; 6]) -> Option<[f64; 6]> {
    for i in 0..6 {
        let diagonal = m[i][i];
        for j in 0..=i {
            let mut sum = m[i][j];
            for k in 0..j {
                sum -= m[i][k] * m[j][k];
            }
            if i == j {
                // Written so that NaN fails.
                if !(sum > 1e-7 * diagonal && sum.is_finite()) {
                    return None;
                }
                m[i][i] = sum.sqrt();
            } else {
                m[i][j] = sum / m[j][j];
            }
        }
    }
    for i in 0..6 {
        for k in 0..i {
            x[i] -= m[i][k] * x[k];
        }
        x[i] /= m[i][i];
    }
    for i in (0..6).rev() {
        for k in i + 1..6 {
            x[i] -= m[k][i] * x[k];
        }
        x[i] /= m[i][i];
    }
    Some(x)
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
        assert!(cylinder.gaussian_curvature().abs() < 1e-3);
        let (_, saddle) = fitted(|x, y| 0.2 * (x * x - y * y), 0.5);
        assert!((saddle.gaussian_curvature() + 0.16).abs() < 2e-3);
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
