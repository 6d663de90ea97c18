//! From tiles to one cloud: each site once, and no seam.
//!
//! Tiles are joined by the *identity* of their sites, not by distance. The home of a site is the
//! tile whose core contains the point at which the site was elected, so exactly one tile delivers
//! it. Where tiles overlap they have solved the same problem, and have the same bits wherever both
//! contain the whole dependency cone; elsewhere their positions are blended by a partition of
//! unity:
//!
//! ```text
//!   weight of a tile at a site
//!   1 ───────╮
//!             ╲            over the band on both sides of its border
//!   0          ╰──────     (½ on the border itself)
//!      core  │  outside
//! ```
//!
//! If the positions are farther apart, the tiles have converged to different basins of the
//! energy. These are not averaged: the position of the home is taken, and the site is counted.

use serde::{Deserialize, Serialize};

use super::solved_tile::SolvedSite;
use crate::{
    geometry::{Local, Rect},
    quality::{DistanceFigures, DistanceTally},
};

/// The distance between the positions of two tiles, in spacings, beyond which they have converged
/// to different basins of the energy.
const BASIN_DISTANCE_IN_SPACINGS: f64 = 0.25;

/// How well the tiles agree on the sites that several of them have solved. Lengths are CRS units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeamTally {
    spacing: f64,
    /// The number of sites that several tiles have solved.
    pub(crate) shared: u64,
    /// The number of shared sites on which all tiles agree to the bit.
    pub(crate) identical: u64,
    /// The number of shared sites whose positions are in different basins, so that the position
    /// of the home was taken.
    pub(crate) resolved_by_owner: u64,
    /// The number of sites in the band of a tile that do not exist in their home.
    pub(crate) unmatched: u64,
    /// The largest distance, for every shared site, from the home's position to another tile's.
    disagreements: DistanceTally,
}

impl SeamTally {
    /// Makes an empty tally for an output at `spacing` (CRS units).
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

    /// Adds the sites of another part of the cloud.
    pub(crate) fn add(&mut self, other: &Self) {
        self.shared += other.shared;
        self.identical += other.identical;
        self.resolved_by_owner += other.resolved_by_owner;
        self.unmatched += other.unmatched;
        self.disagreements.add(&other.disagreements);
    }

    /// The distances between the positions of all shared sites.
    pub(crate) fn disagreements(&self) -> DistanceFigures {
        self.disagreements.figures()
    }
}

/// The sites of one tile as a neighbouring tile has solved them.
#[derive(Clone, Debug)]
pub struct NeighborSites {
    /// The core of the neighbouring tile.
    pub core: Rect,
    /// The sites in the band of the neighbouring tile whose home is the first tile, sorted by
    /// identity.
    pub sites: Vec<SolvedSite>,
}

/// Computes the final positions of the sites of a tile from its own and its neighbours' positions.
///
/// `own` are the sites whose home is the tile with this `core`, sorted by identity. `band` (stored
/// units) is the width around their cores in which tiles deliver the sites of others.
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
    // The sums of the weights and of the weighted differences to the position of the home. Where
    // all agree the second sum is zero, and the bits of the home remain.
    let mut blends: Vec<(f64, Local)> = vec![(0.0, Local::zeros()); own.len()];
    let mut farthest: Vec<Option<f64>> = vec![None; own.len()];
    for neighbor in neighbors {
        for site in &neighbor.sites {
            let Ok(index) = own.binary_search_by_key(&site.identity, |s| s.identity) else {
                tally.unmatched += 1;
                continue;
            };
            let difference = site.position - own[index].position;
            let distance = difference.norm();
            let share = weight(&neighbor.core, site);
            blends[index].0 += share;
            blends[index].1 += difference * share;
            let largest = farthest[index].get_or_insert(0.0);
            *largest = largest.max(distance);
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
            } else if farthest > BASIN_DISTANCE_IN_SPACINGS * tally.spacing {
                tally.resolved_by_owner += 1;
                site.position
            } else {
                // The weight of the home is at least ½, so the divisor is not zero.
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

    /// Two tiles disagree by a constant. The shift of the blend rises from 0 to the whole constant
    /// over the band, without a step at the border.
    #[test]
    fn a_constant_disagreement_is_blended_without_a_step() {
        let (west, east) = (rect(0, 100), rect(100, 200));
        let at = |core: Rect, other: Rect, x: i32, own_shift: f64, neighbor_shift: f64| {
            let mut tally = SeamTally::new(10.0);
            let neighbor = NeighborSites {
                core: other,
                sites: vec![site(x, neighbor_shift)],
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
    fn agreement_and_another_basin_leave_the_position_of_the_home() {
        let mut tally = SeamTally::new(1.0);
        let own = [site(95, 0.1), site(97, 0.1), site(99, 0.1)];
        let neighbor = NeighborSites {
            core: rect(100, 200),
            sites: vec![site(95, 0.1), site(97, 0.5), site(98, 0.0)],
        };
        let positions = blend(&rect(0, 100), &own, &[neighbor], 20, &mut tally);
        assert_eq!(positions[0], own[0].position);
        assert_eq!(positions[1], own[1].position);
        assert_eq!(positions[2], own[2].position);
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
