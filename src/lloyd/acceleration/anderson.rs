//! Anderson acceleration with a uniformity check (paper, section IV-C).
//!
//! The next sites are a mixture of the last m + 1 results of the Lloyd step,
//!
//! ```text
//!   Y ← Σ α_j G(Y_j)      with Σ α_j = 1 and |Σ α_j D_j|² least,   D = G(Y) − Y
//! ```
//!
//! taken only where it is more uniform than the Lloyd step's own result (equation 12, read as
//! its text says: the smaller δ is the better one).
//!
//! In the paper one mixture serves the whole cloud. On a street a few sites whose cells jump
//! (edges, poles, leaves) then decide the least squares, and the check rejects everything. So
//! here both are made by neighbourhood: cubic blocks, each with its own mixture and its own
//! verdict, blended from block to block. One block for all is the paper's rule.

use rayon::prelude::*;

use super::{
    anderson_blocks::Blocks,
    iterate::Iterate,
    normal_equations::{Equations, MEMORY, solve},
};
use crate::{
    geometry::{Local, Stored},
    quality::delta_squared,
};

/// Edge of a block: some fifty sites on a surface, which four coefficients do not overfit.
const BLOCK_EDGE_IN_SPACINGS: f64 = 8.0;
/// Longer differences of residuals are jumps; they would decide the least squares of their
/// block.
const LARGEST_DIFFERENCE_IN_SPACINGS: f64 = 0.25;
/// Farthest from the result of the Lloyd step that a mixture may put a site.
const LARGEST_LEAP_IN_SPACINGS: f64 = 0.3;

/// Anderson mixing with its memory of past iterations.
pub(crate) struct Anderson {
    blocks: Blocks,
    /// The targets G(Y) and residuals D of past iterations, newest first.
    history: Vec<(Vec<Local>, Vec<Local>)>,
}

impl Anderson {
    /// Mixes by neighbourhood: in cubic blocks, which are blended.
    pub(super) fn local(identities: &[Stored], scale: f64, spacing: f64) -> Self {
        Self::with_blocks(Blocks::new(
            identities,
            scale,
            Some(BLOCK_EDGE_IN_SPACINGS * spacing),
        ))
    }

    /// Mixes all sites at once, as the paper does.
    pub(super) fn global(identities: &[Stored], scale: f64) -> Self {
        Self::with_blocks(Blocks::new(identities, scale, None))
    }

    fn with_blocks(blocks: Blocks) -> Self {
        Self {
            blocks,
            history: Vec::new(),
        }
    }

    /// The next positions of all sites.
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

    /// Solves the least squares of every block, and mixes the targets of each site.
    fn mixture(&self, iterate: &Iterate<'_>, residuals: &[Local]) -> Vec<Local> {
        let largest = (LARGEST_DIFFERENCE_IN_SPACINGS * iterate.spacing).powi(2);
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
                let limit = LARGEST_LEAP_IN_SPACINGS * iterate.spacing;
                // This comparison refuses NaN, too.
                if leap.norm() <= limit {
                    iterate.steps[site].project(mixed)
                } else {
                    lloyd
                }
            })
            .collect()
    }

    /// The uniformity check: takes, block by block, the mixture or the Lloyd step.
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
                let better = delta_squared(n, m, mm) < delta_squared(n, l, ll);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lloyd::{
        field::SpacingField,
        step::{SiteSpacings, Step},
    };

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
                spacings: &SiteSpacings::new(&sites, &SpacingField::constant(1.0)),
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
}
