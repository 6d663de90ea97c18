//! The normal equations of Anderson's least squares.
//!
//! ```text
//!   |D − Σ γ_j (D − D_j)|² least:   Σ_l ⟨ΔD_j, ΔD_l⟩ γ_l = ⟨ΔD_j, D⟩,   ΔD_j = D − D_j
//! ```

/// Number of past iterations that are mixed: the paper's m.
pub(super) const MEMORY: usize = 4;

/// Share of the trace that is added to the diagonal: it keeps the least squares regular when
/// residuals are nearly parallel.
const RIDGE: f64 = 1e-6;

/// The lower triangle of the matrix, row by row, and the right side.
pub(super) type Equations = ([[f64; MEMORY]; MEMORY], [f64; MEMORY]);

/// Adds `weight` times `term` to `total`.
pub(super) fn add(total: &mut Equations, term: &Equations, weight: f64) {
    for j in 0..MEMORY {
        total.1[j] += weight * term.1[j];
        for l in 0..MEMORY {
            total.0[j][l] += weight * term.0[j][l];
        }
    }
}

/// The shares of the `depth` past iterations; all are zero where the equations do not
/// determine them.
pub(super) fn solve((matrix, right): Equations, depth: usize) -> [f64; MEMORY] {
    let trace: f64 = (0..depth).map(|j| matrix[j][j]).sum();
    let mut m = nalgebra::Matrix4::identity();
    for j in 0..depth {
        for l in 0..=j {
            m[(j, l)] = matrix[j][l];
            m[(l, j)] = matrix[j][l];
        }
        m[(j, j)] += RIDGE * trace;
    }
    let solved = (trace > 0.0)
        .then(|| m.cholesky())
        .flatten()
        .map(|c| c.solve(&nalgebra::Vector4::from(right)));
    solved
        .filter(|shares| shares.iter().all(|s| s.is_finite()))
        .map_or([0.0; MEMORY], Into::into)
}
