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

use nalgebra::Matrix3;

use super::Local;

/// A height of degree 2 over a plane: w = h + p u + q v + ½ (a u² + 2 b u v + c v²).
///
/// Lengths are CRS units: `h` is a length, the slopes `p`, `q` have no unit,
/// the second derivatives `a`, `b`, `c` are inverse lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Heights {
    h: f64,
    p: f64,
    q: f64,
    a: f64,
    b: f64,
    c: f64,
}

impl Heights {
    /// The height `w` over `(u, v)`.
    pub(super) fn at(&self, u: f64, v: f64) -> f64 {
        self.h + u * (self.p + 0.5 * self.a * u + self.b * v) + v * (self.q + 0.5 * self.c * v)
    }

    /// What the height is not linear by over a way of `(u, v)`: between its ends
    /// the chord lies t (1 − t) times this above the surface, at the share t.
    pub(super) fn bend(&self, u: f64, v: f64) -> f64 {
        0.5 * (self.a * u * u + 2.0 * self.b * u * v + self.c * v * v)
    }

    /// The derivatives along `u` and `v` over `(u, v)`.
    pub(super) fn slopes(&self, u: f64, v: f64) -> [f64; 2] {
        [
            self.p + self.a * u + self.b * v,
            self.q + self.b * u + self.c * v,
        ]
    }

    /// The same surface over the same plane, from a place `(u, v, w)`.
    fn from(&self, [u, v, w]: [f64; 3]) -> Self {
        let h = self.at(u, v) - w;
        let [p, q] = self.slopes(u, v);
        Self { h, p, q, ..*self }
    }
}

/// A height function of degree 2 over a tangent plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Where `u = v = w = 0`.
    pub(crate) origin: Local,
    /// The directions of `u`, `v` and `w`: orthonormal, right-handed. The last
    /// is the narrow one of the neighbourhood.
    pub(crate) axes: [Local; 3],
    heights: Heights,
    /// Root mean square of the heights that the patch leaves unexplained
    /// (CRS units), weighted as the fit was.
    pub(crate) residual: f64,
    /// Spread of the neighbours along their narrow direction in the plane over
    /// that along the wide one: 1 for a disc, 0 for a line.
    pub(crate) roundness: f64,
    /// Number of neighbours that carried weight.
    pub(crate) support: u32,
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
/// A larger residual than this share of the radius is no noise of samples that
/// are means, but a surface that is none: an edge, leaves.
const MOST_NOISE: f64 = 0.025;
/// A worse residual than this share of the smallest detail, and a patch does not
/// describe its neighbourhood: leaves, clutter, two sheets.
const WORST_RESIDUAL: f64 = 0.15;
/// A rounder neighbourhood than this has a surface; a narrower is a wire.
const LEAST_ROUNDNESS: f64 = 0.2;

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
        // Unknowns are scaled by `radius` throughout, so that everything has like
        // magnitude, and the pivot test below has no unit.
        let near = Lanes::new(seed, neighbors, radius);

        // The best fitting plane: weighted mean and covariance.
        let mut sums = [[0.0; LANES]; 12];
        for [x, y, z] in near.clone() {
            for k in 0..LANES {
                let (x, y, z) = (x[k], y[k], z[k]);
                let w = weight(x, y, z);
                let (wx, wy, wz) = (w * x, w * y, w * z);
                let is_near = f64::from(u8::from(w > 0.0));
                let terms = [
                    w,
                    w * w,
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
        let [
            total,
            total_squares,
            support,
            x,
            y,
            z,
            xx,
            xy,
            xz,
            yy,
            yz,
            zz,
        ] = sums.map(added);
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
            // Of the plane.
            residual: (spread[2] / total).sqrt() * radius,
            roundness: (spread[1] / spread[0]).sqrt(),
            support,
        };
        if kind == PatchKind::Quadratic && support >= MIN_QUADRATIC_SUPPORT {
            let free = total * total / total_squares - 6.0;
            patch.fit_heights(near, foot, total, free.max(1.0), radius);
        }
        Some(patch)
    }

    /// Least squares for the six coefficients; leaves the plane where the
    /// neighbours do not determine them. `foot` is the height of the plane over
    /// the seed, `total` the neighbours' weight, `free` their number beyond the
    /// coefficients.
    fn fit_heights(&mut self, near: Lanes<'_>, foot: f64, total: f64, free: f64, radius: f64) {
        // The normal equations are moments Σ w uⁱ vʲ: `degree[d][j]` with i = d − j.
        let axes = self.axes;
        let mut sums = [[0.0; LANES]; 21];
        for [x, y, z] in near {
            for k in 0..LANES {
                let (x, y, z) = (x[k], y[k], z[k]);
                let w = weight(x, y, z);
                let [u, v, height] = axes.map(|axis| axis.x * x + axis.y * y + axis.z * z);
                let height = height - foot;
                let (wu, wv) = (w * u, w * v);
                let (wuu, wuv, wvv) = (wu * u, wu * v, wv * v);
                let (uu, uv, vv) = (u * u, u * v, v * v);
                let terms = [
                    w,
                    wu,
                    wv,
                    wuu,
                    wuv,
                    wvv,
                    wuu * u,
                    wuu * v,
                    wvv * u,
                    wvv * v,
                    wuu * uu,
                    wuu * uv,
                    wuu * vv,
                    wuv * vv,
                    wvv * vv,
                    w * height,
                    wu * height,
                    wv * height,
                    0.5 * wuu * height,
                    wuv * height,
                    0.5 * wvv * height,
                ];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    sum[k] += term;
                }
            }
        }
        let [
            m00,
            m10,
            m01,
            m20,
            m11,
            m02,
            m30,
            m21,
            m12,
            m03,
            m40,
            m31,
            m22,
            m13,
            m04,
            right @ ..,
        ] = sums.map(added);
        let degree = [
            [m00, 0.0, 0.0, 0.0, 0.0],
            [m10, m01, 0.0, 0.0, 0.0],
            [m20, m11, m02, 0.0, 0.0],
            [m30, m21, m12, m03, 0.0],
            [m40, m31, m22, m13, m04],
        ];
        // Rows and columns: 1, u, v, ½u², uv, ½v², as (factor, i, j).
        const TERMS: [(f64, usize, usize); 6] = [
            (1.0, 0, 0),
            (1.0, 1, 0),
            (1.0, 0, 1),
            (0.5, 2, 0),
            (1.0, 1, 1),
            (0.5, 0, 2),
        ];
        let normal =
            TERMS.map(|(f, i, j)| TERMS.map(|(g, k, l)| f * g * degree[i + j + k + l][j + l]));
        if let Some(solved) = solve_cholesky(normal, right) {
            let [h, p, q, a, b, c] = solved;
            self.heights = Heights {
                h: h * radius,
                p,
                q,
                a: a / radius,
                b: b / radius,
                c: c / radius,
            };
            // Of the squared heights over the plane, what the coefficients explain.
            let products = solved.iter().zip(&right).map(|(x, b)| x * b);
            let explained = products.sum::<f64>() / total * radius * radius;
            self.shrink(explained, free, radius);
        }
    }

    /// Takes the patch back towards the plane by the share of its curvature that
    /// noise would explain, after James and Stein. `explained` is what it makes of
    /// the plane's squared residual (CRS units squared), `free` the number of
    /// neighbours beyond the coefficients.
    fn shrink(&mut self, explained: f64, free: f64, radius: f64) {
        let left = (self.residual.powi(2) - explained).max(0.0);
        let noise = left.min((MOST_NOISE * radius).powi(2));
        // Three coefficients more than those of the plane.
        let by_chance = 3.0 * noise / free;
        let share = if explained > by_chance {
            1.0 - by_chance / explained
        } else {
            0.0
        };
        let Heights { h, p, q, a, b, c } = &mut self.heights;
        for coefficient in [h, p, q, a, b, c] {
            *coefficient *= share;
        }
        let left_out = (1.0 - share).powi(2) * explained.max(0.0);
        self.residual = (left + left_out).sqrt();
    }

    /// Whether the patch describes its neighbourhood well enough to stand for a
    /// surface with details as small as `detail` (CRS units). Else it went
    /// through leaves, clutter, two sheets or a wire.
    pub(crate) fn describes(&self, detail: f64) -> bool {
        self.residual <= WORST_RESIDUAL * detail && self.roundness >= LEAST_ROUNDNESS
    }

    /// How far the patch can be relied on: 1 for a clean surface, falling to 0
    /// where it ceases to describe its neighbourhood.
    pub(crate) fn trust(&self, detail: f64) -> f64 {
        if self.describes(detail) {
            (2.0 * (1.0 - self.residual / (WORST_RESIDUAL * detail))).min(1.0)
        } else {
            0.0
        }
    }

    /// `[u, v, w]` of `point` in the patch's frame.
    pub(crate) fn coordinates(&self, point: Local) -> [f64; 3] {
        let d = point - self.origin;
        self.axes.map(|axis| axis.dot(&d))
    }

    /// The height `w` over `(u, v)`.
    pub(crate) fn height(&self, u: f64, v: f64) -> f64 {
        self.heights.at(u, v)
    }

    /// The heights over the patch's plane, from `place`.
    pub(super) fn heights_from(&self, place: Local) -> Heights {
        self.heights.from(self.coordinates(place))
    }

    /// How far the chord of a way of `length` (CRS units) can lie off the patch,
    /// times four.
    pub(crate) fn most_bend(&self, length: f64) -> f64 {
        let Heights { a, b, c, .. } = self.heights;
        let curvature = a * a + 2.0 * b * b + c * c;
        0.5 * curvature.sqrt() * length * length
    }

    /// The point of the patch over `(u, v)`.
    pub(crate) fn point(&self, u: f64, v: f64) -> Local {
        self.origin + self.axes[0] * u + self.axes[1] * v + self.axes[2] * self.height(u, v)
    }

    /// The foot point of `point`: its projection along the normal of the plane
    /// (paper, section IV-D).
    pub fn foot_point(&self, point: Local) -> Local {
        let [u, v, _] = self.coordinates(point);
        self.point(u, v)
    }

    /// Unit normal at the origin; its sign means nothing.
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
        let bent = (1.0 + q * q) * a - 2.0 * p * q * b + (1.0 + p * p) * c;
        let curvature = bent / (2.0 * steep * steep.sqrt());
        let normal = self.normal();
        match (normal.z, normal.y, normal.x) < (0.0, 0.0, 0.0) {
            true => (-normal, -curvature),
            false => (normal, curvature),
        }
    }

    /// Gaussian curvature over the origin (CRS units to the −2).
    #[cfg(test)]
    pub(crate) fn gaussian_curvature(&self) -> f64 {
        let Heights { p, q, a, b, c, .. } = self.heights;
        (a * c - b * b) / (1.0 + p * p + q * q).powi(2)
    }
}

/// So many neighbours are added at a time, each to a sum of its own: processors
/// do that at once, and in the same order everywhere.
const LANES: usize = 4;

/// Neighbours by [`LANES`], from the seed, in units of the radius; what is missing
/// of the last ones lies where the weight is zero.
#[derive(Clone)]
struct Lanes<'a> {
    seed: Local,
    per_radius: f64,
    rest: std::slice::Chunks<'a, Local>,
}

impl<'a> Lanes<'a> {
    fn new(seed: Local, neighbors: &'a [Local], radius: f64) -> Self {
        Self {
            seed,
            per_radius: 1.0 / radius,
            rest: neighbors.chunks(LANES),
        }
    }
}

impl Iterator for Lanes<'_> {
    type Item = [[f64; LANES]; 3];

    fn next(&mut self) -> Option<Self::Item> {
        let mut lanes = [[2.0; LANES]; 3];
        for (k, point) in self.rest.next()?.iter().enumerate() {
            let d = (point - self.seed) * self.per_radius;
            lanes[0][k] = d.x;
            lanes[1][k] = d.y;
            lanes[2][k] = d.z;
        }
        Some(lanes)
    }
}

/// Of a neighbour, by its way from the seed in units of the radius.
fn weight(x: f64, y: f64, z: f64) -> f64 {
    let w = (1.0 - (x * x + y * y + z * z)).max(0.0);
    w * w
}

fn added(lanes: [f64; LANES]) -> f64 {
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}

/// Eigenvalues of a covariance in falling order, and a right-handed frame whose
/// third axis belongs to the smallest; `None` if there is no such axis, or
/// `covariance` is zero or not finite.
///
/// Roots and products alone, no angles: the same bits on every machine.
fn narrow_frame(covariance: Matrix3<f64>) -> Option<([f64; 3], [Local; 3])> {
    let trace = covariance.trace();
    if !(trace > 0.0 && trace.is_finite()) {
        return None;
    }
    let m = covariance / trace;
    // The characteristic polynomial λ³ − λ² + minors λ − determinant falls to
    // zero from the left at its smallest root: Newton's steps from 0 never pass
    // it. They converge fast unless the two smaller roots are close, and then
    // there is no surface.
    let [xx, xy, xz, yy, yz, zz] = [m.m11, m.m12, m.m13, m.m22, m.m23, m.m33];
    let minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz;
    let determinant =
        xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
    let mut smallest = 0.0_f64;
    for _ in 0..24 {
        let value = ((smallest - 1.0) * smallest + minors) * smallest - determinant;
        let slope = (3.0 * smallest - 2.0) * smallest + minors;
        let step = -value / slope;
        if step.is_nan() || step <= 1e-15 {
            break;
        }
        smallest += step;
    }
    // The other two have the rest of the trace and of the minors.
    let half_sum = 0.5 * (1.0 - smallest);
    let product = minors - 2.0 * smallest * half_sum;
    let half_gap = (half_sum * half_sum - product).max(0.0).sqrt();
    let spread = [half_sum + half_gap, half_sum - half_gap, smallest].map(|s| s.max(0.0) * trace);

    // What is left of the matrix without the smallest eigenvalue has rank two:
    // the normal of its rows is the axis.
    let rest = m - Matrix3::from_diagonal_element(smallest);
    let rows = [rest.column(0), rest.column(1), rest.column(2)];
    let normal = [(0, 1), (0, 2), (1, 2)]
        .map(|(i, j)| rows[i].cross(&rows[j]))
        .into_iter()
        .max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    let length = normal.norm();
    if length.is_nan() || length <= 1e-12 {
        return None;
    }
    let n = normal / length;
    // Any direction across will do for the first: along the coordinate axis
    // that is farthest from the normal.
    let mut u = Local::zeros();
    u[n.iamin()] = 1.0;
    u = (u - n * n.dot(&u)).normalize();
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

    /// The twin: nalgebra's iterative solver.
    #[test]
    fn the_narrow_frame_agrees_with_an_iterative_eigen_solver() {
        let mut state = 5_u64;
        let mut roll = || {
            state = crate::geometry::spread(state);
            state as f64 / u64::MAX as f64 - 0.5
        };
        for flatness in [1.0, 0.3, 1e-3, 1e-6, 0.0] {
            for _ in 0..50 {
                let turn =
                    nalgebra::Rotation3::from_euler_angles(roll(), 6.0 * roll(), 6.0 * roll());
                let mut covariance = Matrix3::zeros();
                for _ in 0..20 {
                    let p = turn * Local::new(roll(), 0.6 * roll(), 0.3 * flatness * roll());
                    covariance += p * p.transpose() * 1e-4;
                }
                let (spread, [_, _, n]) = narrow_frame(covariance).unwrap();
                let eigen = nalgebra::SymmetricEigen::new(covariance);
                let mut order = [0, 1, 2];
                order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
                for (k, &o) in order.iter().enumerate() {
                    assert!((spread[k] - eigen.eigenvalues[o]).abs() < 1e-12 * spread[0]);
                }
                let cosine = n.dot(&eigen.eigenvectors.column(order[2]));
                assert!((cosine.abs() - 1.0).abs() < 1e-9, "{cosine}");
            }
        }
    }

    #[test]
    fn the_axes_are_orthonormal_and_right_handed() {
        let (_, patch) = fitted(|x, y| 0.1 * x * y, 1.0);
        let [u, v, n] = patch.axes;
        assert!((u.cross(&v) - n).norm() < 1e-12);
    }
}
