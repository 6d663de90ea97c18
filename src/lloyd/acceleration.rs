//! What is done with the centroids: taken as they are, or extrapolated.

use serde::{Deserialize, Serialize};

use super::{anderson::Anderson, relaxation::Relaxation};
use crate::geometry::{Local, Stored};

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

/// Neighbours remembered for a site; a cell has six, rarely more than nine.
pub(super) const LINKS: usize = 10;

/// Stands for no neighbour.
pub(super) const NO_LINK: u32 = u32::MAX;

/// What a Lloyd step found for every site, in the order of the sites.
#[derive(Debug)]
pub(super) struct Iterate<'a> {
    /// Where the sites are (paper: Y).
    pub(super) sites: &'a [Local],
    /// The centroids, projected and restricted (paper: G(Y)).
    pub(super) targets: &'a [Local],
    /// Sites whose cells touch.
    pub(super) links: &'a [[u32; LINKS]],
    /// Spacing asked for (CRS units).
    pub(super) spacing: f64,
}

impl Iterate<'_> {
    pub(super) fn residual(&self, site: usize) -> Local {
        self.targets[site] - self.sites[site]
    }

    /// Distance from `site` to its nearest linked neighbour were the sites at
    /// `places`.
    pub(super) fn nearest_distance(&self, site: usize, places: &[Local]) -> Option<f64> {
        self.links[site]
            .iter()
            .take_while(|&&link| link != NO_LINK)
            .map(|&link| (places[link as usize] - places[site]).norm_squared())
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
    /// caller; `project` does it for those that must be looked at first.
    pub(super) fn next(
        &mut self,
        iterate: &Iterate<'_>,
        project: &(dyn Fn(usize, Local) -> Local + Sync),
    ) -> Vec<Local> {
        match self {
            Self::None => iterate.targets.to_vec(),
            Self::Relaxation(relaxation) => relaxation.next(iterate),
            Self::Anderson(anderson) => anderson.next(iterate, project),
        }
    }
}
