//! What is done with the centroids: taken as they are, or extrapolated.

use serde::{Deserialize, Serialize};

use super::{anderson::Anderson, relaxation::Relaxation, step::Step};
use crate::geometry::{Local, MOST_EDGES, Stored};

/// How an iteration goes from the centroids to the next sites.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Acceleration {
    /// Plain Lloyd: to the centroid (paper, section IV-B).
    None,
    /// Beyond the centroid, as far as each neighbourhood bears it.
    #[default]
    Relaxation,
    /// Anderson mixing and uniformity check by neighbourhood.
    Anderson,
    /// Anderson mixing and uniformity check of all sites at once: the paper's
    /// section IV-C to the letter. What it does depends on the tiling.
    AndersonGlobal,
}

/// Neighbours remembered for a site.
pub(super) const LINKS: usize = MOST_EDGES;

/// Stands for no neighbour.
pub(super) const NO_LINK: u32 = u32::MAX;

/// The neighbours of `links`.
pub(super) fn linked(links: &[u32; LINKS]) -> impl Iterator<Item = u32> {
    links.iter().copied().take_while(|&link| link != NO_LINK)
}

/// What a Lloyd step found for every site, in the order of the sites.
pub(super) struct Iterate<'a> {
    /// Where the sites are (paper: Y).
    pub(super) sites: &'a [Local],
    /// Where the step would have them.
    pub(super) steps: &'a [Step],
    /// Spacing asked for (CRS units).
    pub(super) spacing: f64,
}

impl Iterate<'_> {
    /// The centroid, projected and restricted (paper: G(Y)).
    pub(super) fn target(&self, site: usize) -> Local {
        self.steps[site].target
    }

    pub(super) fn residual(&self, site: usize) -> Local {
        self.target(site) - self.sites[site]
    }

    /// The sites whose cells touch that of `site`.
    pub(super) fn links(&self, site: usize) -> impl Iterator<Item = usize> {
        linked(&self.steps[site].links).map(|link| link as usize)
    }

    /// Distance from `site` to its nearest linked neighbour were each site
    /// where `place` says.
    pub(super) fn nearest_distance(
        &self,
        site: usize,
        place: impl Fn(usize) -> Local,
    ) -> Option<f64> {
        self.links(site)
            .map(|link| (place(link) - place(site)).norm_squared())
            .min_by(f64::total_cmp)
            .map(f64::sqrt)
    }
}

/// An acceleration with what it remembers of past iterations.
pub(super) enum Accelerator {
    None,
    Relaxation(Relaxation),
    Anderson(Box<Anderson>),
}

impl Accelerator {
    pub(super) fn new(
        acceleration: Acceleration,
        identities: &[Stored],
        scale: f64,
        spacing: f64,
    ) -> Self {
        match acceleration {
            Acceleration::None => Self::None,
            Acceleration::Relaxation => Self::Relaxation(Relaxation::new(identities.len())),
            Acceleration::Anderson => {
                Self::Anderson(Box::new(Anderson::local(identities, scale, spacing)))
            }
            Acceleration::AndersonGlobal => {
                Self::Anderson(Box::new(Anderson::global(identities, scale)))
            }
        }
    }

    /// Places beyond the targets, to be projected and restricted by the
    /// caller.
    pub(super) fn next(&mut self, iterate: &Iterate<'_>) -> Vec<Local> {
        match self {
            Self::None => iterate.steps.iter().map(|step| step.target).collect(),
            Self::Relaxation(relaxation) => relaxation.next(iterate),
            Self::Anderson(anderson) => anderson.next(iterate),
        }
    }
}
