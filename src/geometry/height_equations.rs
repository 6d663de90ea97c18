//! The normal equations of the least squares for heights of degree 2.
//!
//! Their entries are the moments Σ w uⁱ vʲ with i + j ≤ 4, and their right sides Σ w height
//! times 1, u, v, ½ u², u v, ½ v². What the heights and the weights themselves add up to tells how good a solution is.

use super::{
    Local,
    lanes::{LANES, Lanes, added, weight},
};

/// Number of sums: fifteen moments, six right sides, Σ w height², Σ w².
const SUMS: usize = 23;

/// The unknowns by the terms 1, u, v, ½u², uv, ½v², each as (factor, power of u, power of v).
const TERMS: [(f64, usize, usize); 6] = [
    (1.0, 0, 0),
    (1.0, 1, 0),
    (1.0, 0, 1),
    (0.5, 2, 0),
    (1.0, 1, 1),
    (0.5, 0, 2),
];

/// The normal equations for the coefficients h, p, q, a, b, c.
pub(super) struct HeightEquations {
    matrix: [[f64; 6]; 6],
    right: [f64; 6],
    /// The weighted sum of squared heights.
    squared_heights: f64,
    /// The sum of the squared weights.
    squared_weights: f64,
}

impl HeightEquations {
    /// The equations for the heights of the neighbours `near` over a plane with the frame
    /// `axes`; `foot` is the height of the plane over the seed.
    pub(super) fn new(near: Lanes<'_>, axes: [Local; 3], foot: f64) -> Self {
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
            r0,
            r1,
            r2,
            r3,
            r4,
            r5,
            squared_heights,
            squared_weights,
        ] = sums(near, axes, foot);
        // Row d, column j: the moment of u to the power d − j and v to the power j.
        let degree = [
            [m00, 0.0, 0.0, 0.0, 0.0],
            [m10, m01, 0.0, 0.0, 0.0],
            [m20, m11, m02, 0.0, 0.0],
            [m30, m21, m12, m03, 0.0],
            [m40, m31, m22, m13, m04],
        ];
        let matrix =
            TERMS.map(|(f, i, j)| TERMS.map(|(g, k, l)| f * g * degree[i + j + k + l][j + l]));
        Self {
            matrix,
            right: [r0, r1, r2, r3, r4, r5],
            squared_heights,
            squared_weights,
        }
    }

    /// The sum of the weights.
    pub(super) fn total(&self) -> f64 {
        self.matrix[0][0]
    }

    /// The number of neighbours, with equal weights, that would determine a mean as well.
    pub(super) fn effective_number(&self) -> f64 {
        self.total().powi(2) / self.squared_weights
    }

    /// The weighted sum of squared heights that a solution with these `products` leaves.
    pub(super) fn left(&self, products: f64) -> f64 {
        (self.squared_heights - products).max(0.0)
    }

    /// The coefficients h, p, q of a plane, and how much of the weighted sum of squared heights they explain; `None` if the
    /// neighbours do not determine them.
    pub(super) fn solve_plane(&self) -> Option<([f64; 3], f64)> {
        let [first, second, third, ..] = self.matrix;
        let matrix = [first, second, third].map(|[a, b, c, ..]| [a, b, c]);
        let [a, b, c, ..] = self.right;
        let right = [a, b, c];
        let solved = solve_cholesky(matrix, right)?;
        Some((solved, product(solved, right)))
    }

    /// The weighted sum of the squares of the heights that `coefficients` have at the neighbours.
    pub(super) fn squares_of(&self, coefficients: [f64; 6]) -> f64 {
        let rows = self.matrix.map(|row| product(row, coefficients));
        product(rows, coefficients)
    }

    /// The coefficients, and how much of the weighted sum of squared heights they explain;
    /// `None` if the neighbours do not determine them.
    pub(super) fn solve(&self) -> Option<([f64; 6], f64)> {
        let solved = solve_cholesky(self.matrix, self.right)?;
        Some((solved, product(solved, self.right)))
    }
}

/// The scalar product.
fn product<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(&b).map(|(x, y)| x * y).sum()
}

/// All sums: one loop over the neighbours.
fn sums(near: Lanes<'_>, axes: [Local; 3], foot: f64) -> [f64; SUMS] {
    let mut sums = [[0.0; LANES]; SUMS];
    for [x, y, z, own] in near {
        for k in 0..LANES {
            let (x, y, z) = (x[k], y[k], z[k]);
            let w = own[k] * weight(x, y, z);
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
                w * height * height,
                w * w,
            ];
            for (sum, term) in sums.iter_mut().zip(terms) {
                sum[k] += term;
            }
        }
    }
    sums.map(added)
}

/// Solves a symmetric positive definite system given by its lower triangle; `None` when
/// a pivot vanishes beside the diagonal it came from.
fn solve_cholesky<const N: usize>(mut m: [[f64; N]; N], mut x: [f64; N]) -> Option<[f64; N]> {
    for i in 0..N {
        let diagonal = m[i][i];
        for j in 0..=i {
            let mut sum = m[i][j];
            for k in 0..j {
                sum -= m[i][k] * m[j][k];
            }
            if i == j {
                // This comparison refuses NaN.
                if !(sum > 1e-7 * diagonal && sum.is_finite()) {
                    return None;
                }
                m[i][i] = sum.sqrt();
            } else {
                m[i][j] = sum / m[j][j];
            }
        }
    }
    for i in 0..N {
        for k in 0..i {
            x[i] -= m[i][k] * x[k];
        }
        x[i] /= m[i][i];
    }
    for i in (0..N).rev() {
        for k in i + 1..N {
            x[i] -= m[k][i] * x[k];
        }
        x[i] /= m[i][i];
    }
    Some(x)
}
