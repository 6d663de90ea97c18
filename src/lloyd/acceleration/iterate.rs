//! One iterate of the fixed-point iteration Y ← G(Y), where G is a Lloyd step.

use crate::{
    geometry::Local,
    lloyd::step::{SiteSpacings, Step},
};

/// The results of a Lloyd step for all sites, in the order of the sites.
pub(crate) struct Iterate<'a> {
    /// The positions before the step (paper: Y).
    pub(crate) sites: &'a [Local],
    /// The steps of the sites.
    pub(crate) steps: &'a [Step],
    /// The spacing at each site.
    pub(crate) spacings: &'a SiteSpacings,
    /// The coarsest spacing (CRS units).
    pub(crate) spacing: f64,
}

impl Iterate<'_> {
    /// The centroid of `site`, projected and restricted (paper: G(Y)).
    pub(super) fn target(&self, site: usize) -> Local {
        self.steps[site].target
    }

    /// The move of `site` to its target (paper: D = G(Y) − Y).
    pub(super) fn residual(&self, site: usize) -> Local {
        self.target(site) - self.sites[site]
    }

    /// The sites whose cells share an edge with that of `site`.
    pub(super) fn links(&self, site: usize) -> impl Iterator<Item = usize> {
        self.steps[site].links.sites().map(|link| link as usize)
    }

    /// Distance from `site` to its nearest linked neighbour, with every site at the position
    /// that `position` gives.
    pub(super) fn nearest_distance(
        &self,
        site: usize,
        position: impl Fn(usize) -> Local,
    ) -> Option<f64> {
        self.links(site)
            .map(|link| (position(link) - position(site)).norm_squared())
            .min_by(f64::total_cmp)
            .map(f64::sqrt)
    }
}
