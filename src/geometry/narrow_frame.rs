//! The principal frame of a neighbourhood.

use nalgebra::Matrix3;

use super::Local;

/// The mean of `places`, of which there is at least one, and their covariance. Rounding depends on the order.
pub(crate) fn mean_and_covariance(places: &[Local]) -> (Local, Matrix3<f64>) {
    let count = places.len() as f64;
    let mean = places.iter().sum::<Local>() / count;
    let square = |place: &Local| (place - mean) * (place - mean).transpose();
    (
        mean,
        places.iter().map(square).sum::<Matrix3<f64>>() / count,
    )
}

/// The eigenvalues of a covariance in falling order, and a right-handed frame whose
/// third axis belongs to the smallest; `None` if there is no such axis, or
/// `covariance` is zero or not finite.
///
/// Roots and products alone, no angles: the same bits on every machine.
pub(crate) fn narrow_frame(covariance: Matrix3<f64>) -> Option<([f64; 3], [Local; 3])> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The slow twin is nalgebra's iterative solver.
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
}
