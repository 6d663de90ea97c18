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

use super::acceleration::Iterate;
use crate::geometry::Local;

/// ω gains this much for each iteration that went well …
const GAIN: f64 = 0.5;
/// … up to here. At 2 over-relaxation of a quadratic ceases to converge.
const MOST: f64 = 1.8;
/// Residuals above this share of the spacing are jumps, not convergence.
const LARGEST_RESIDUAL: f64 = 0.25;

#[derive(Debug)]
pub(super) struct Relaxation {
    sites: Vec<Memory>,
}

/// What a site remembers.
#[derive(Clone, Copy, Debug)]
struct Memory {
    omega: f64,
    /// Residual of the last iteration …
    last: Local,
    /// … its squared norm, and that of the one before.
    squares: [f64; 2],
}

impl Relaxation {
    pub(super) fn new(sites: usize) -> Self {
        let fresh = Memory {
            omega: 1.0,
            last: Local::zeros(),
            squares: [0.0, f64::INFINITY],
        };
        Self {
            sites: vec![fresh; sites],
        }
    }

    pub(super) fn next(&mut self, iterate: &Iterate<'_>) -> Vec<Local> {
        let largest = (LARGEST_RESIDUAL * iterate.spacing).powi(2);
        let memory = &self.sites;
        let (mut places, mut next) = (Vec::new(), Vec::new());
        (0..memory.len())
            .into_par_iter()
            .map(|site| {
                let own = memory[site];
                let residual = iterate.residual(site);
                let square = residual.norm_squared();
                let (mut now, mut before) = (0.0, 0.0);
                for link in iterate.links(site) {
                    let [last, before_last] = memory[link].squares;
                    now += last;
                    before += before_last;
                }
                let shrinks = now <= before;
                let keeps_direction = residual.dot(&own.last) >= 0.0;
                let omega = if shrinks && keeps_direction && square <= largest {
                    (own.omega + GAIN).min(MOST)
                } else {
                    1.0
                };
                let memory = Memory {
                    omega,
                    last: residual,
                    squares: [square, own.squares[0]],
                };
                (iterate.sites[site] + residual * omega, memory)
            })
            .unzip_into_vecs(&mut places, &mut next);
        self.sites = next;
        places
    }
}
