//! From tiles to one cloud: each seed once, and no seam.
//!
//! Tiles are joined by the *identity* of their sites, not by distance. A site
//! is at home in the tile whose core holds the point it was elected at, so
//! exactly one tile delivers it. Where tiles overlap they have solved the same
//! problem, and hold the same bits wherever both saw all that matters; what
//! they disagree on besides is blended by a partition of unity:
//!
//! ```text
//!   weight of a tile at a site
//!   1 ───────╮
//!             ╲            over the band on both sides of its border
//!   0          ╰──────     (½ on the border itself)
//!      core  │  outside
//! ```
//!
//! A larger disagreement (another basin of the energy) is not averaged: the
//! owner's word stands, and it is counted.

use serde::{Deserialize, Serialize};

use super::SolvedSite;
use crate::{
    geometry::{Local, Rect},
    quality::{DistanceFigures, DistanceTally},
};

/// Disagreement, in spacings, beyond which two tiles found different basins.
const ANOTHER_BASIN: f64 = 0.25;

/// How well tiles agreed. Lengths are CRS units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeamTally {
    spacing: f64,
    /// Sites that several tiles delivered.
    pub(crate) shared: u64,
    /// Of those, sites on which all agreed to the bit.
    pub(crate) identical: u64,
    /// Of those, sites on which the owner's word stands.
    pub(crate) resolved_by_owner: u64,
    /// Sites of a band that their home does not know.
    pub(crate) unmatched: u64,
    /// Largest disagreement of every shared site.
    disagreements: DistanceTally,
}

impl SeamTally {
    /// An empty tally, for an output at `spacing` (CRS units).
    pub fn new(spacing: f64) -> Self {
        Self {
            spacing,
            shared: 0,
            identical: 0,
            resolved_by_owner: 0,
            unmatched: 0,
            disagreements: DistanceTally::new(spacing),
        }
    }

    /// The disagreements of all shared sites.
    pub(crate) fn disagreements(&self) -> DistanceFigures {
        self.disagreements.figures()
    }
}

/// One tile's say on the sites of another.
#[derive(Clone, Debug)]
pub struct NeighborSites {
    /// The core of the tile that speaks.
    pub core: Rect,
    /// Its sites that are at home in the other, by identity.
    pub sites: Vec<SolvedSite>,
}

/// Where the sites of a tile end once its neighbours have been heard.
///
/// `own` are the sites at home in `core`, sorted by identity; `band` (stored
/// units) is how far around their cores tiles report.
pub fn blend(
    core: &Rect,
    own: &[SolvedSite],
    neighbors: &[NeighborSites],
    band: i64,
    tally: &mut SeamTally,
) -> Vec<Local> {
    let weight = |of: &Rect, site: &SolvedSite| {
        ((of.depth(site.identity) + band) as f64 / (2 * band).max(1) as f64).clamp(0.0, 1.0)
    };
    // The sum of weights and of weighted differences to the owner's word: where
    // all agree it is zero, and the owner's bits remain.
    let mut blends: Vec<(f64, Local)> = vec![(0.0, Local::zeros()); own.len()];
    let mut farthest: Vec<Option<f64>> = vec![None; own.len()];
    for neighbor in neighbors {
        for site in &neighbor.sites {
            let Ok(place) = own.binary_search_by_key(&site.identity, |s| s.identity) else {
                tally.unmatched += 1;
                continue;
            };
            let difference = site.position - own[place].position;
            let distance = difference.norm();
            let share = weight(&neighbor.core, site);
            blends[place].0 += share;
            blends[place].1 += difference * share;
            let seen = farthest[place].get_or_insert(0.0);
            *seen = seen.max(distance);
        }
    }
    own.iter()
        .zip(blends)
        .zip(farthest)
        .map(|((site, (weights, differences)), farthest)| {
            let Some(farthest) = farthest else {
                return site.position;
            };
            tally.shared += 1;
            tally.disagreements.push(farthest);
            if farthest == 0.0 {
                tally.identical += 1;
                site.position
            } else if farthest > ANOTHER_BASIN * tally.spacing {
                tally.resolved_by_owner += 1;
                site.position
            } else {
                // At least ½ is the owner's, so there is no division by zero.
                site.position + differences / (weight(core, site) + weights)
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Stored;

    fn site(x: i32, shift: f64) -> SolvedSite {
        SolvedSite {
            identity: Stored { x, y: 50, z: 0 },
            position: Local::new(f64::from(x) + shift, 50.0, 0.0),
            is_exact: false,
        }
    }

    fn rect(from: i64, to: i64) -> Rect {
        Rect {
            min: [from, 0],
            max: [to, 100],
        }
    }

    /// Two tiles that disagree by a constant meet in the middle: the shift
    /// falls from 0 to all of it over the band, without a step at the border.
    #[test]
    fn a_constant_disagreement_is_blended_without_a_step() {
        let (west, east) = (rect(0, 100), rect(100, 200));
        let at = |core: Rect, other: Rect, x: i32, own_shift: f64, guest_shift: f64| {
            let mut tally = SeamTally::new(10.0);
            let neighbor = NeighborSites {
                core: other,
                sites: vec![site(x, guest_shift)],
            };
            blend(&core, &[site(x, own_shift)], &[neighbor], 20, &mut tally)[0].x - f64::from(x)
        };
        let shifts: Vec<f64> = (82..119)
            .map(|x| {
                if x < 100 {
                    at(west, east, x, 0.0, 1.0)
                } else {
                    at(east, west, x, 1.0, 0.0)
                }
            })
            .collect();
        assert!(shifts[0] < 0.06 && shifts[36] > 0.94);
        for pair in shifts.windows(2) {
            assert!((0.0..0.05).contains(&(pair[1] - pair[0])), "{shifts:?}");
        }
    }

    #[test]
    fn agreement_keeps_the_owners_bits_and_another_basin_its_word() {
        let mut tally = SeamTally::new(1.0);
        let own = [site(95, 0.1), site(97, 0.1), site(99, 0.1)];
        let neighbor = NeighborSites {
            core: rect(100, 200),
            sites: vec![site(95, 0.1), site(97, 0.5), site(98, 0.0)],
        };
        let places = blend(&rect(0, 100), &own, &[neighbor], 20, &mut tally);
        assert_eq!(places[0], own[0].position);
        assert_eq!(places[1], own[1].position);
        assert_eq!(places[2], own[2].position);
        assert_eq!(
            (
                tally.shared,
                tally.identical,
                tally.resolved_by_owner,
                tally.unmatched
            ),
            (2, 1, 1, 1)
        );
    }
}
