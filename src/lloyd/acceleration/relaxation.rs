//! Over-relaxation with a local safeguard.
//!
//! A site moves beyond its centroid, x + ω (c − x), with an ω of its own. ω grows while the
//! residuals of the neighbourhood shrink and the site keeps its direction; it falls back to 1,
//! plain Lloyd, the moment either fails. A neighbourhood in which over-relaxation does not pay
//! (edges, poles, leaves) is spared it, whatever happens in the rest of the cloud.
//!
//! The safeguard uses the *last* residuals of the neighbours, not the present ones: influence
//! then travels no farther than in a plain Lloyd step, and tiles agree as exactly.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::iterate::Iterate;
use crate::geometry::Local;

/// Growth of ω after an iteration that went well.
const OMEGA_GAIN: f64 = 0.5;
/// Largest ω. At 2 over-relaxation of a quadratic ceases to converge.
const LARGEST_OMEGA: f64 = 1.8;
/// Residuals longer than this are jumps, not convergence.
const LARGEST_RESIDUAL_IN_SPACINGS: f64 = 0.25;

/// The memory of over-relaxation for all sites.
#[derive(Debug)]
pub(crate) struct Relaxation {
    sites: Vec<Memory>,
}

/// The memory of over-relaxation for one site.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct Memory {
    /// The factor of the last move.
    omega: f64,
    /// The residual of the last iteration (CRS units).
    last: Local,
    /// The squared norms of the residuals of the last iteration and of the one before (CRS
    /// units squared).
    squares: [f64; 2],
}

impl Default for Memory {
    /// The memory before the first iteration.
    fn default() -> Self {
        Self {
            omega: 1.0,
            last: Local::zeros(),
            squares: [0.0, f64::INFINITY],
        }
    }
}

impl Relaxation {
    /// An empty memory for `sites` sites.
    pub(super) fn new(sites: usize) -> Self {
        Self {
            sites: vec![Memory::default(); sites],
        }
    }

    /// The memory that consists of those of the sites.
    pub(super) fn resume(sites: Vec<Memory>) -> Self {
        Self { sites }
    }

    /// What is remembered of each site.
    pub(super) fn into_memories(self) -> Vec<Memory> {
        self.sites
    }

    /// The next positions of all sites.
    pub(super) fn next(&mut self, iterate: &Iterate<'_>) -> Vec<Local> {
        let memory = &self.sites;
        let (mut positions, mut next) = (Vec::new(), Vec::new());
        (0..memory.len())
            .into_par_iter()
            .map(|site| {
                let own = memory[site];
                let spacing = iterate.spacings.of(site);
                let largest = (LARGEST_RESIDUAL_IN_SPACINGS * spacing).powi(2);
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
                    (own.omega + OMEGA_GAIN).min(LARGEST_OMEGA)
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
            .unzip_into_vecs(&mut positions, &mut next);
        self.sites = next;
        positions
    }
}
