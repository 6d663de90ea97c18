//! The spacing at each site.

use std::ops::Range;

use rayon::prelude::*;

use crate::{
    geometry::{ITEMS_PER_TASK, Local},
    lloyd::field::SpacingField,
};

/// The spacing at each site of a cloud (CRS units).
#[derive(Clone, Debug)]
pub(crate) struct SiteSpacings {
    /// The coarsest spacing of the run.
    coarsest: f64,
    /// The spacing at each site; empty if it is the same everywhere.
    of_sites: Vec<f64>,
}

impl SiteSpacings {
    /// The spacings of `field` at `positions`.
    pub(crate) fn new(positions: &[Local], field: &SpacingField) -> Self {
        let of_sites = match field.is_constant() {
            true => Vec::new(),
            false => field.at_all(positions),
        };
        Self {
            coarsest: field.coarsest(),
            of_sites,
        }
    }

    /// Takes note that sites have moved from the positions `before` to the positions `now`.
    pub(super) fn follow(&mut self, before: &[Local], now: &[Local], field: &SpacingField) {
        self.of_sites
            .par_iter_mut()
            .zip(before.par_iter().zip(now))
            .with_max_len(ITEMS_PER_TASK)
            .filter(|(_, (before, now))| before != now)
            .for_each(|(spacing, (_, &now))| *spacing = field.at(now));
    }

    /// The spacing at each site; empty if it is the same everywhere.
    pub(super) fn of_sites(&self) -> &[f64] {
        &self.of_sites
    }

    /// The spacing at `site`.
    #[inline]
    pub(crate) fn of(&self, site: usize) -> f64 {
        self.of_sites.get(site).copied().unwrap_or(self.coarsest)
    }

    /// The coarsest spacing at the sites of `block`.
    pub(crate) fn coarsest_of(&self, block: &Range<usize>) -> f64 {
        match self.of_sites.get(block.clone()) {
            Some(spacings) if !spacings.is_empty() => spacings.iter().copied().fold(0.0, f64::max),
            _ => self.coarsest,
        }
    }
}
