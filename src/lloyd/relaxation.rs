//! Over-relaxation with a local safeguard.
//!
//! A site goes beyond its centroid, x + ω (c − x), with an ω of its own. ω
//! grows while the residuals of the neighbourhood shrink and the site keeps
//! its direction; it falls back to 1, plain Lloyd, the moment either fails. So
//! a neighbourhood in which over-relaxation does not pay (edges, poles, leaves)
//! is spared it, without a look at the rest of the cloud.
//!
//! The safeguard looks at the *last* residuals of the neighbours, not at the
//! present ones: a step then reaches no farther than a plain Lloyd step does,
//! and tiles agree as exactly.

use rayon::prelude::*;

use super::acceleration::{Iterate, NO_LINK};
use crate::geometry::Local;

/// ω gains this much for each iteration that went well …
const GAIN: f64 = 0.25;
/// … up to here. At 2 over-relaxation of a quadratic ceases to converge.
const MOST: f64 = 1.8;
/// Residuals above this share of the spacing are jumps, not convergence.
const LARGEST_RESIDUAL: f64 = 0.25;

#[derive(Debug)]
pub(super) struct Relaxation {
    omega: Vec<f64>,
    /// Residuals of the last iteration, and squared norms of the one before.
    last: Vec<Local>,
    before_last: Vec<f64>,
}

impl Relaxation {
    pub(super) fn new(sites: usize) -> Self {
        Self {
            omega: vec![1.0; sites],
            last: vec![Local::zeros(); sites],
            before_last: vec![f64::INFINITY; sites],
        }
    }

    pub(super) fn next(&mut self, iterate: &Iterate<'_>) -> Vec<Local> {
        let largest = (LARGEST_RESIDUAL * iterate.spacing).powi(2);
        let omega: Vec<f64> = (0..iterate.sites.len())
            .into_par_iter()
            .map(|site| {
                let residual = iterate.residual(site);
                let (mut now, mut before) = (0.0, 0.0);
                for &link in iterate.links[site].iter().take_while(|&&l| l != NO_LINK) {
                    now += self.last[link as usize].norm_squared();
                    before += self.before_last[link as usize];
                }
                let shrinks = now <= before;
                let keeps_direction = residual.dot(&self.last[site]) >= 0.0;
                if shrinks && keeps_direction && residual.norm_squared() <= largest {
                    (self.omega[site] + GAIN).min(MOST)
                } else {
                    1.0
                }
            })
            .collect();
        self.omega = omega;
        for site in 0..iterate.sites.len() {
            self.before_last[site] = self.last[site].norm_squared();
            self.last[site] = iterate.residual(site);
        }
        (0..iterate.sites.len())
            .map(|site| iterate.sites[site] + iterate.residual(site) * self.omega[site])
            .collect()
    }
}
