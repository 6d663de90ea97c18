//! Which sites are near which, kept from one iteration to the next.
//!
//! Sites move little in an iteration. So each has a list of the others within the radius that
//! cuts a good cell *and a skin*, and the list is valid as long as no site has moved farther
//! than half the skin (Verlet, *Computer "experiments" on classical fluids*, 1967). A few always
//! move farther: these *strays* are looked up by their present positions, and once they are
//! many, all lists are made anew.
//!
//! The result does not depend on when the lists were made: two tiles that make them at
//! different times find the same neighbours in the same order.

use std::ops::Range;

use rayon::prelude::*;

pub(crate) use super::neighbor_lists::{BLOCKS_PER_TASK, NEAR_IN_SPACINGS};
use super::{
    neighbor_lists::{Lists, SITE_CELL_IN_SPACINGS, SKIN_IN_SPACINGS},
    site_spacings::SiteSpacings,
};
use crate::{
    geometry::{Local, Neighbor, NeighborGrid},
    lloyd::{field::SpacingField, surface::bounding_box},
};

/// Edge of a block. The sites of a block find their neighbours and their samples together.
pub(crate) const BLOCK_EDGE_IN_SPACINGS: f64 = 2.4;

/// Lists are made anew when there are more strays than one in this many sites.
const SITES_PER_STRAY: usize = 50;

/// Radius within which the sites of a list are.
const LISTED_IN_SPACINGS: f64 = NEAR_IN_SPACINGS + SKIN_IN_SPACINGS;

/// Room for the far list of a site of a surface.
const USUAL_FAR_COUNT: usize = 32;

/// A list of the sites that are farther than near from a site and can cut its cell. It is made
/// on demand, and valid as long as the other lists are.
#[derive(Clone, Default)]
pub(crate) struct FarList {
    /// The number of the lists that it was made with; 0 for none.
    version: u32,
    others: Vec<u32>,
}

/// The sites of a cloud, and what is near each.
pub(crate) struct Neighborhoods {
    spacings: SiteSpacings,
    /// The factor by which the spacing of a listed site may be coarser than that of the site that has the list.
    widening: f64,
    /// The positions of the sites.
    positions: Vec<Local>,
    /// The last move of each site (CRS units).
    moves: Vec<Local>,
    /// The length of the last move of each site (spacings).
    lengths: Vec<f32>,
    /// Ranges of sites that lie together.
    blocks: Vec<Range<usize>>,
    lists: Lists,
    /// Number of times that the lists were made.
    version: u32,
    /// The sites that have moved farther than half the skin since the lists were made.
    strays: Vec<u32>,
    /// The present positions of the strays by cell.
    strayed: NeighborGrid,
}

impl Neighborhoods {
    /// Neighbourhoods of sites at `positions`, which lie block by block, with the spacings of `field`.
    pub(crate) fn new(
        positions: Vec<Local>,
        blocks: Vec<Range<usize>>,
        field: &SpacingField,
    ) -> Self {
        let spacings = SiteSpacings::new(&positions, field);
        Self {
            lists: Lists::new(&positions, &blocks, &spacings, field),
            spacings,
            widening: field.widening(LISTED_IN_SPACINGS),
            version: 1,
            moves: vec![Local::zeros(); positions.len()],
            lengths: vec![0.0; positions.len()],
            positions,
            blocks,
            strays: Vec::new(),
            strayed: field.grid(&[], SITE_CELL_IN_SPACINGS),
        }
    }

    /// The neighbourhoods of sites whose last moves (CRS units) were `moves`.
    pub(crate) fn after(mut self, moves: Vec<Local>) -> Self {
        let length = |(site, way)| length_in_spacings(way, self.spacings.of(site));
        self.lengths = moves.iter().enumerate().map(length).collect();
        self.moves = moves;
        self
    }

    /// The positions of the sites and their last moves (CRS units), without what is near each.
    pub(crate) fn into_positions_and_moves(self) -> (Vec<Local>, Vec<Local>) {
        (self.positions, self.moves)
    }

    /// The positions of the sites.
    #[inline]
    pub(crate) fn positions(&self) -> &[Local] {
        &self.positions
    }

    /// The spacing at each site.
    #[inline]
    pub(crate) fn spacings(&self) -> &SiteSpacings {
        &self.spacings
    }

    /// The blocks, as ranges of the sites.
    pub(crate) fn blocks(&self) -> &[Range<usize>] {
        &self.blocks
    }

    /// Moves the sites to `positions`, with the spacings of `field`.
    pub(crate) fn move_to(&mut self, positions: Vec<Local>, field: &SpacingField) {
        // Lengths are in the spacings at the new positions, which are all that the next round knows.
        self.spacings.follow(&self.positions, &positions, field);
        let spacings = &self.spacings;
        self.moves
            .par_iter_mut()
            .zip(&mut self.lengths)
            .zip(positions.par_iter().zip(&self.positions))
            .enumerate()
            .for_each(|(site, ((way, length), (now, before)))| {
                *way = now - before;
                *length = length_in_spacings(way, spacings.of(site));
            });
        self.positions = positions;
        let has_strayed = |&site: &u32| self.has_strayed(site, self.lists.positions[site as usize]);
        let sites = 0..self.positions.len() as u32;
        self.strays = sites.into_par_iter().filter(has_strayed).collect();
        if self.strays.len() > self.positions.len() / SITES_PER_STRAY {
            let (positions, blocks) = (&self.positions, &self.blocks);
            self.lists.renew(positions, blocks, &self.spacings, field);
            self.version += 1;
            self.strays.clear();
        }
        let strayed: Vec<Local> = self
            .strays
            .iter()
            .map(|&k| self.positions[k as usize])
            .collect();
        self.strayed = field.grid(&strayed, SITE_CELL_IN_SPACINGS);
    }

    /// Whether `site`, which was at `listed` when the lists were made, has moved farther than
    /// half the skin.
    fn has_strayed(&self, site: u32, listed: Local) -> bool {
        // The lists of finer sites around it count on it, too.
        let skin = 0.5 * SKIN_IN_SPACINGS * self.spacings.of(site as usize) / self.widening;
        (self.positions[site as usize] - listed).norm_squared() > skin * skin
    }

    /// Fills `strays` with every stray that can be within `radius` (CRS units) of a site of
    /// `block`.
    pub(crate) fn strays_around(&self, block: &Range<usize>, radius: f64, strays: &mut Vec<u32>) {
        strays.clear();
        if !self.strays.is_empty() {
            let [low, high] = bounding_box(self.positions[block.clone()].iter().copied());
            let reach = Local::repeat(radius);
            let add = |stray: u32, _| strays.push(self.strays[stray as usize]);
            self.strayed.visit_box(low - reach, high + reach, add);
        }
    }

    /// The last move of `site` (CRS units).
    #[inline]
    pub(crate) fn last_move(&self, site: usize) -> Local {
        self.moves[site]
    }

    /// The length of the last move of `site` (spacings).
    #[inline]
    pub(crate) fn length_of_move(&self, site: usize) -> f32 {
        self.lengths[site]
    }

    /// All sites that can be near `site`, and more; `None` if it is a stray, and has no list.
    /// `strays` are the strays around the block of the site.
    pub(crate) fn listed<'a>(
        &'a self,
        site: usize,
        strays: &'a [u32],
    ) -> Option<impl Iterator<Item = u32> + 'a> {
        let has_list = !strays.contains(&(site as u32));
        has_list.then(|| {
            let listed = self.lists.of(site);
            let missing = strays.iter().filter(|stray| !listed.contains(stray));
            listed.iter().chain(missing).copied()
        })
    }

    /// Fills `neighbors` with every other site within [`NEAR_IN_SPACINGS`] of `site`; `false`
    /// if it is a stray, and has no list. `strays` are the strays around the block of the
    /// site.
    pub(crate) fn near(&self, site: usize, strays: &[u32], neighbors: &mut Vec<Neighbor>) -> bool {
        let Some(listed) = self.listed(site, strays) else {
            return false;
        };
        let near = (NEAR_IN_SPACINGS * self.spacings.of(site)).powi(2);
        neighbors.clear();
        neighbors.extend(
            listed
                .map(|other| self.neighbor(site, other))
                .filter(|neighbor| neighbor.distance_squared <= near),
        );
        true
    }

    /// Fills `found` with every site that can be within `radius` (CRS units) of a site
    /// of `block`, wherever the sites have moved.
    pub(crate) fn all_around(
        &self,
        block: &Range<usize>,
        radius: f64,
        found: &mut Vec<(u32, Local)>,
    ) {
        found.clear();
        let [low, high] = bounding_box(self.positions[block.clone()].iter().copied());
        let skin = 0.5 * SKIN_IN_SPACINGS * self.spacings.coarsest_of(block) * self.widening;
        let reach = Local::repeat(radius + skin);
        let grid = &self.lists.grid;
        grid.visit_box(low - reach, high + reach, |site, listed| {
            if !self.has_strayed(site, listed) {
                found.push((site, self.positions[site as usize]));
            }
        });
        self.strayed
            .visit_box(low - reach, high + reach, |stray, position| {
                found.push((self.strays[stray as usize], position));
            });
    }

    /// Whether `list` was made before the other lists.
    pub(crate) fn is_outdated(&self, list: &FarList) -> bool {
        list.version != self.version
    }

    /// The sites that stood around `block` when the lists were made, with where they stood: all
    /// that can be in the far list of one of its sites for a `radius` (CRS units).
    pub(crate) fn listed_around(&self, block: &Range<usize>, radius: f64) -> Vec<(u32, Local)> {
        let mut found = Vec::new();
        let positions = self.lists.positions[block.clone()].iter().copied();
        let [low, high] = bounding_box(positions);
        let skin = SKIN_IN_SPACINGS * self.spacings.coarsest_of(block) * self.widening;
        let reach = Local::repeat(radius + skin);
        self.lists
            .grid
            .visit_box(low - reach, high + reach, |site, position| {
                found.push((site, position));
            });
        found
    }

    /// Makes the `list` of `site` anew: those of the sites `listed` that can be farther than
    /// near and within `radius` (CRS units) as long as neither has strayed.
    pub(crate) fn renew(
        &self,
        list: &mut FarList,
        site: usize,
        radius: f64,
        listed: &[(u32, Local)],
    ) {
        let spacing = self.spacings.of(site);
        let skin = SKIN_IN_SPACINGS * spacing;
        let [least, most] = [NEAR_IN_SPACINGS * spacing - skin, radius + skin];
        let position = self.lists.positions[site];
        let is_far = |&&(_, other): &&(u32, Local)| {
            let squared = (other - position).norm_squared();
            squared >= least * least && squared <= most * most
        };
        list.version = self.version;
        list.others.clear();
        list.others.reserve(USUAL_FAR_COUNT);
        let far = listed.iter().filter(is_far).map(|&(other, _)| other);
        list.others.extend(far);
    }

    /// The sites of `list`, and those of `strays` that are not among them. A site itself may be
    /// among the strays.
    pub(crate) fn far<'a>(
        &self,
        list: &'a FarList,
        strays: &'a [u32],
    ) -> impl Iterator<Item = u32> + 'a {
        let missing = strays.iter().filter(|stray| !list.others.contains(stray));
        list.others.iter().chain(missing).copied()
    }

    /// Site `other` as a neighbour of `site`.
    #[inline]
    pub(crate) fn neighbor(&self, site: usize, other: u32) -> Neighbor {
        Neighbor::new(self.positions[site], other, self.positions[other as usize])
    }
}

/// The length of `way` (CRS units) in spacings.
#[inline]
fn length_in_spacings(way: &Local, spacing: f64) -> f32 {
    (way.norm() * (1.0 / spacing)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// Comparison with all pairs of sites.
    #[test]
    fn near_sites_are_found_however_far_the_sites_have_moved() {
        let roll = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let n = 600;
        let mut positions: Vec<Local> = (0..n)
            .map(|k| Local::new(20.0 * roll(3 * k), 20.0 * roll(3 * k + 1), roll(3 * k + 2)))
            .collect();
        positions[1] = positions[0];
        let blocks = (0..n as usize).step_by(10).map(|k| k..k + 10).collect();
        let field = SpacingField::constant(1.0);
        let mut sites = Neighborhoods::new(positions.clone(), blocks, &field);
        let mut met_strays = 0;
        for round in 1..8_u64 {
            // All sites move a little, some far.
            for (k, position) in (0_u64..).zip(&mut positions) {
                let far = if k % 60 == 0 { 1.0 } else { 0.03 };
                let way = |axis| roll(spread(round) ^ (3 * k + axis)) - 0.5;
                *position += Local::new(way(0), way(1), way(2)) * far;
            }
            sites.move_to(positions.clone(), &field);
            met_strays += sites.strays.len();
            let (mut found, mut around, mut all) = (Vec::new(), Vec::new(), Vec::new());
            for own in 0..positions.len() {
                for radius in [NEAR_IN_SPACINGS, 2.5] {
                    let mut truth: Vec<(f64, u32)> = (0..)
                        .zip(&positions)
                        .map(|(other, &position)| {
                            ((position - positions[own]).norm_squared(), other)
                        })
                        .filter(|&(d, other)| d <= radius * radius && other != own as u32)
                        .collect();
                    truth.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    let block = own / 10 * 10..own / 10 * 10 + 10;
                    sites.strays_around(&block, radius, &mut around);
                    if radius > NEAR_IN_SPACINGS || !sites.near(own, &around, &mut found) {
                        sites.all_around(&block, radius, &mut all);
                        let position = positions[own];
                        let others = all
                            .iter()
                            .map(|&(k, other)| Neighbor::new(position, k, other));
                        found = others
                            .filter(|n| n.distance_squared <= radius * radius)
                            .filter(|n| n.index as usize != own)
                            .collect();
                    }
                    Neighbor::sort(&mut found);
                    let found: Vec<(f64, u32)> = found
                        .iter()
                        .map(|n| (n.distance_squared, n.index))
                        .collect();
                    assert_eq!(found, truth, "round {round}, site {own}, radius {radius}");
                }
            }
        }
        assert!(met_strays > 0);
    }
}
