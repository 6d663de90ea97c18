//! Sites at the beginning of a round that is not the first, as their states come in.
//!
//! States are large. So the places of the sites come first, all of them; then each piece of the
//! states is taken apart and let go before the next is read.

use std::ops::Range;

use rayon::prelude::*;

use super::{
    acceleration::Memory,
    blocks::in_blocks,
    count::CountCorrection,
    field::SpacingField,
    site_state::SiteState,
    step::{Links, Step},
};
use crate::geometry::{Local, Stored};

/// The sites that a tile knows at the beginning of a round, in the order of their blocks, and of
/// their identities within a block.
pub(crate) struct ResumedSites<'a> {
    pub(super) blocks: Vec<Range<usize>>,
    pub(super) identities: Vec<Stored>,
    pub(super) positions: Vec<Local>,
    pub(super) steps: Vec<Step>,
    pub(super) moves: Vec<Local>,
    pub(super) memories: Vec<Option<Memory>>,
    /// The indices of the sites in the order of their identities.
    by_identity: Vec<u32>,
    correction: &'a CountCorrection,
}

impl<'a> ResumedSites<'a> {
    /// Sites of these identities and positions, without their states, for an output with the spacings of `field`. Those that leave by
    /// `correction` are dropped; those that come are known already.
    pub(crate) fn new(
        mut known: Vec<(Stored, Local)>,
        field: &SpacingField,
        correction: &'a CountCorrection,
    ) -> Self {
        known.retain(|(identity, _)| !correction.leaves(identity));
        known.par_sort_unstable_by_key(|&(identity, _)| identity);
        let positions: Vec<Local> = known.iter().map(|&(_, position)| position).collect();
        let (blocks, order) = in_blocks(&positions, field);
        let positions: Vec<Local> = order.iter().map(|&k| positions[k as usize]).collect();
        let mut by_identity = vec![0; order.len()];
        for (site, &k) in (0..).zip(&order) {
            by_identity[k as usize] = site;
        }
        Self {
            blocks,
            identities: order.iter().map(|&k| known[k as usize].0).collect(),
            // All tiles know the same of sites that come.
            steps: positions.iter().map(|&p| Step::between_rounds(p)).collect(),
            moves: vec![Local::zeros(); positions.len()],
            memories: vec![None; positions.len()],
            positions,
            by_identity,
            correction,
        }
    }

    /// The identities of the sites, in the order of their blocks.
    #[cfg(test)]
    pub(crate) fn identities(&self) -> &[Stored] {
        &self.identities
    }

    /// Adds the states of some of the sites; those of others are left out.
    pub(crate) fn add(&mut self, states: Vec<SiteState>) {
        for state in states {
            let Some(site) = self.index_of(&state.identity) else {
                continue;
            };
            let mut is_disturbed = self.correction.disturbs(state.position);
            let links = state.links.iter();
            let links = links.filter(|link| {
                let leaves = self.correction.leaves(link);
                is_disturbed |= leaves;
                !leaves
            });
            let links: Option<Vec<u32>> = links.map(|link| self.index_of(link)).collect();
            let links = links.map(|links| Links::new(links.into_iter()));
            let site = site as usize;
            self.steps[site] = state.step;
            self.steps[site].resume(state.position, links);
            if is_disturbed {
                self.steps[site].reset(state.position);
            }
            self.moves[site] = state.last_move;
            self.memories[site] = state.memory;
        }
    }

    /// The index of the site of `identity`, if it is known.
    fn index_of(&self, identity: &Stored) -> Option<u32> {
        let key = |&site: &u32| self.identities[site as usize];
        let found = self.by_identity.binary_search_by_key(identity, key).ok()?;
        Some(self.by_identity[found])
    }
}
