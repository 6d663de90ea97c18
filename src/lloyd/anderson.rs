//! Anderson acceleration with a uniformity check (paper, section IV-C).
//!
//! The next sites are a mixture of the last m + 1 results of the Lloyd step,
//!
//! ```text
//!   Y ← Σ α_j G(Y_j)      with Σ α_j = 1 and |Σ α_j D_j|² least,   D = G(Y) − Y
//! ```
//!
//! taken only where it is more uniform than the Lloyd step's own result
//! (equation 12, read as its text says: the smaller δ is the better one).
//!
//! In the paper one mixture serves the whole cloud. On a street a few sites
//! whose domain jumps (edges, poles, leaves) then decide the least squares,
//! and the check rejects everything. So here both are made by neighbourhood:
//! cubic blocks aligned to the run's quantization, each with its own mixture and its
//! own verdict, blended from block to block. One block for all is the paper's.

use rayon::prelude::*;

use super::acceleration::Iterate;
use crate::geometry::{CellIndex, Local, OccupiedCells, Stored, cell_of};

/// The paper's m.
const MEMORY: usize = 4;
/// Edge of a block, in spacings: some fifty sites on a surface, which four
/// coefficients do not overfit.
const BLOCK: f64 = 8.0;
/// Residual differences above this share of the spacing are jumps; they would
/// decide the least squares of their block.
const LARGEST_DIFFERENCE: f64 = 0.25;
/// Farthest from the Lloyd step's result, in spacings, that a mixture may put
/// a site.
const LARGEST_LEAP: f64 = 0.3;
/// Keeps the least squares regular when residuals are nearly parallel.
const RIDGE: f64 = 1e-6;

/// Normal equations of a block: lower triangle row by row, then the right.
type Equations = ([[f64; MEMORY]; MEMORY], [f64; MEMORY]);

pub(super) struct Anderson {
    blocks: Blocks,
    /// Past iterations, newest first: G(Y) and D.
    history: Vec<(Vec<Local>, Vec<Local>)>,
}

impl Anderson {
    pub(super) fn local(identities: &[Stored], scale: f64, spacing: f64) -> Self {
        Self::with_blocks(Blocks::new(identities, scale, Some(BLOCK * spacing)))
    }

    pub(super) fn global(identities: &[Stored], scale: f64) -> Self {
        Self::with_blocks(Blocks::new(identities, scale, None))
    }

    fn with_blocks(blocks: Blocks) -> Self {
        Self {
            blocks,
            history: Vec::new(),
        }
    }

    pub(super) fn next(&mut self, iterate: &Iterate<'_>) -> Vec<Local> {
        let count = iterate.sites.len();
        let targets: Vec<Local> = (0..count).map(|i| iterate.target(i)).collect();
        let residuals: Vec<Local> = (0..count).map(|i| iterate.residual(i)).collect();
        let depth = self.history.len();
        let next = if depth == 0 {
            targets.clone()
        } else {
            let mixed = self.mixture(iterate, &residuals);
            self.check(iterate, &mixed)
        };
        self.history.insert(0, (targets, residuals));
        self.history.truncate(MEMORY);
        next
    }

    /// The least squares of every block, and what they make of each site.
    fn mixture(&self, iterate: &Iterate<'_>, residuals: &[Local]) -> Vec<Local> {
        let largest = (LARGEST_DIFFERENCE * iterate.spacing).powi(2);
        let depth = self.history.len();
        let equations = self.blocks.sum(|site| {
            let mut equations: Equations = Default::default();
            let mut differences = [Local::zeros(); MEMORY];
            for (difference, (_, past)) in differences.iter_mut().zip(&self.history) {
                *difference = residuals[site] - past[site];
                if difference.norm_squared() > largest {
                    return Default::default();
                }
            }
            for j in 0..depth {
                equations.1[j] = differences[j].dot(&residuals[site]);
                for l in 0..=j {
                    equations.0[j][l] = differences[j].dot(&differences[l]);
                }
            }
            equations
        });
        let gammas: Vec<[f64; MEMORY]> = equations
            .into_iter()
            .map(|equations| solve(equations, depth))
            .collect();

        (0..iterate.sites.len())
            .into_par_iter()
            .map(|site| {
                let gamma = self.blocks.blend(site, |block| gammas[block]);
                let lloyd = iterate.target(site);
                let mut mixed = lloyd;
                for (share, (past, _)) in gamma.iter().zip(&self.history) {
                    mixed += (past[site] - lloyd) * *share;
                }
                let leap = mixed - lloyd;
                let limit = LARGEST_LEAP * iterate.spacing;
                // Written so that NaN is refused too.
                if leap.norm() <= limit {
                    iterate.steps[site].project(mixed)
                } else {
                    lloyd
                }
            })
            .collect()
    }

    /// The uniformity check: by block, the mixture or the Lloyd step.
    fn check(&self, iterate: &Iterate<'_>, mixed: &[Local]) -> Vec<Local> {
        let sums = self.blocks.sum(|site| {
            let both = iterate
                .nearest_distance(site, |s| mixed[s])
                .zip(iterate.nearest_distance(site, |s| iterate.target(s)));
            let [m, l] = both.map_or([0.0; 2], |(m, l)| [m, l]);
            let one = f64::from(u8::from(both.is_some()));
            (
                [
                    [one, m, m * m, 0.0],
                    [0.0, l, l * l, 0.0],
                    [0.0; 4],
                    [0.0; 4],
                ],
                [0.0; 4],
            )
        });
        let accepted: Vec<[f64; MEMORY]> = sums
            .into_iter()
            .map(|([[n, m, mm, _], [_, l, ll, _], ..], _)| {
                // δ² = n Σd² / (Σd)² − 1, equation (6).
                let uniformity = |sum: f64, squares: f64| n * squares / (sum * sum) - 1.0;
                let better = uniformity(m, mm) < uniformity(l, ll);
                [f64::from(u8::from(better)), 0.0, 0.0, 0.0]
            })
            .collect();
        (0..iterate.sites.len())
            .into_par_iter()
            .map(|site| {
                let [share, ..] = self.blocks.blend(site, |block| accepted[block]);
                let lloyd = iterate.target(site);
                lloyd + (mixed[site] - lloyd) * share
            })
            .collect()
    }
}

/// Cubic blocks of sites, aligned to the run's quantization. Where a site belongs is
/// decided by its identity, once for all iterations.
struct Blocks {
    cells: OccupiedCells,
    /// Sites, sorted by block.
    order: Vec<u32>,
    indices: Vec<CellIndex>,
    /// Identity of each site in units of blocks; `None` with one block for all.
    places: Option<Vec<Local>>,
}

impl Blocks {
    fn new(identities: &[Stored], scale: f64, edge: Option<f64>) -> Self {
        let places: Option<Vec<Local>> = edge.map(|edge| {
            identities
                .iter()
                .map(|s| Local::new(s.x.into(), s.y.into(), s.z.into()) * (scale / edge))
                .collect()
        });
        let block = |site: usize| places.as_ref().map_or([0; 3], |p| cell_of(p[site], 1.0));
        let blocks: Vec<CellIndex> = (0..identities.len()).map(block).collect();
        let (cells, order) = OccupiedCells::sort(&blocks, |&block| block);
        let indices = cells
            .ranges()
            .map(|range| blocks[order[range.start] as usize])
            .collect();
        Self {
            cells,
            order,
            indices,
            places,
        }
    }

    /// Sums `term` over the sites of each block and, by half for every axis it
    /// is a block away, of the blocks around it.
    fn sum(&self, term: impl Fn(usize) -> Equations + Sync) -> Vec<Equations> {
        let ranges: Vec<_> = self.cells.ranges().collect();
        let own: Vec<Equations> = ranges
            .into_par_iter()
            .map(|range| {
                let mut total = Equations::default();
                for &site in &self.order[range] {
                    add(&mut total, &term(site as usize), 1.0);
                }
                total
            })
            .collect();
        self.indices
            .par_iter()
            .map(|&[x, y, z]| {
                let mut total = Equations::default();
                for dz in -1..=1_i32 {
                    for dy in -1..=1_i32 {
                        for dx in -1..=1_i32 {
                            if let Some(block) = self.cells.place([x + dx, y + dy, z + dz]) {
                                let away = dx.abs() + dy.abs() + dz.abs();
                                add(&mut total, &own[block], 0.5_f64.powi(away));
                            }
                        }
                    }
                }
                total
            })
            .collect()
    }

    /// Linear interpolation at `site` of what the blocks about it hold.
    fn blend(&self, site: usize, of: impl Fn(usize) -> [f64; MEMORY]) -> [f64; MEMORY] {
        let Some(places) = &self.places else {
            return of(0);
        };
        let place = places[site] - Local::repeat(0.5);
        let corner = cell_of(place, 1.0);
        let mut total = [0.0; MEMORY];
        let mut weights = 0.0;
        for k in 0..8_i32 {
            let offset = [k & 1, k >> 1 & 1, k >> 2];
            let index: CellIndex = std::array::from_fn(|axis| corner[axis] + offset[axis]);
            if let Some(block) = self.cells.place(index) {
                let weight: f64 = (0..3)
                    .map(|axis| 1.0 - (place[axis] - f64::from(index[axis])).abs())
                    .product();
                weights += weight;
                for (sum, value) in total.iter_mut().zip(of(block)) {
                    *sum += weight * value;
                }
            }
        }
        // The site's own block exists and has at least an eighth of the weight.
        total.map(|sum| sum / weights)
    }
}

fn add(total: &mut Equations, term: &Equations, weight: f64) {
    for j in 0..MEMORY {
        total.1[j] += weight * term.1[j];
        for l in 0..MEMORY {
            total.0[j][l] += weight * term.0[j][l];
        }
    }
}

/// The shares of the past iterations; none of them where the equations do not
/// tell.
fn solve((matrix, right): Equations, depth: usize) -> [f64; MEMORY] {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lloyd::step::Step;

    /// A linear fixed point iteration x ← M x in every coordinate, with known
    /// answer 0: Anderson must find it in a few steps where plain iteration
    /// crawls.
    #[test]
    fn a_linear_iteration_ends_sooner_with_mixing() {
        let count = 60;
        let identities: Vec<Stored> = (0..count).map(|i| Stored { x: i, y: 0, z: 0 }).collect();
        let rate = |i: usize| [0.9, 0.7, 0.5][i % 3];
        let step = |sites: &[Local]| -> Vec<Local> {
            sites.iter().enumerate().map(|(i, s)| s * rate(i)).collect()
        };
        let mut anderson = Anderson::global(&identities, 1.0);
        let mut sites: Vec<Local> = (0..count).map(|_| Local::new(0.01, -0.02, 0.005)).collect();
        let mut plain = sites.clone();
        for _ in 0..6 {
            plain = step(&plain);
            let targets = step(&sites);
            let steps: Vec<Step> = targets.iter().map(|&t| Step::new(t)).collect();
            let iterate = Iterate {
                sites: &sites,
                steps: &steps,
                spacing: 1.0,
            };
            let residuals: Vec<Local> = (0..sites.len()).map(|i| iterate.residual(i)).collect();
            let next = if anderson.history.is_empty() {
                targets.clone()
            } else {
                anderson.mixture(&iterate, &residuals)
            };
            anderson.history.insert(0, (targets, residuals));
            anderson.history.truncate(MEMORY);
            sites = next;
        }
        let norm = |s: &[Local]| s.iter().map(|x| x.norm()).fold(0.0, f64::max);
        assert!(
            norm(&sites) < 0.01 * norm(&plain),
            "{} {}",
            norm(&sites),
            norm(&plain)
        );
    }

    #[test]
    fn blending_a_constant_gives_the_constant() {
        let identities: Vec<Stored> = (0..500)
            .map(|i| Stored {
                x: i * 37 % 1000,
                y: i * 91 % 700,
                z: i % 13,
            })
            .collect();
        let blocks = Blocks::new(&identities, 0.01, Some(1.3));
        for site in 0..identities.len() {
            let [value, ..] = blocks.blend(site, |_| [2.5, 0.0, 0.0, 0.0]);
            assert!((value - 2.5).abs() < 1e-12);
        }
    }
}
