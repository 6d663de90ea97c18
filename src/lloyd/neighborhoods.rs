//! Which sites are near which, kept from one iteration to the next.
//!
//! Sites move little in an iteration. So each has a list of those that lie within
//! what cuts a good cell *and a skin*, and the list holds as long as no site has
//! gone farther than half the skin (Verlet, *Computer "experiments" on classical
//! fluids*, 1967). A few always go farther: these *strays* are looked up by where
//! they are, and once they are many, all lists are made anew.
//!
//! What is found does not depend on when the lists were made: two tiles that make
//! them at different times find the same neighbours in the same order.

use std::ops::Range;

use rayon::prelude::*;

use crate::geometry::{AT_ONCE, Local, Neighbor, NeighborGrid};

/// Edge of a block, in spacings. Places of a block look for their neighbours and
/// for samples together.
pub(super) const BLOCK: f64 = 2.4;

/// Blocks that a thread takes at once.
pub(super) const BLOCKS_AT_ONCE: usize = AT_ONCE / 16;

/// The corners of the box about `places`.
pub(super) fn bounds(places: impl Iterator<Item = Local>) -> [Local; 2] {
    let far = Local::repeat(f64::INFINITY);
    places.fold([far, -far], |[low, high], place| {
        [low.inf(&place), high.sup(&place)]
    })
}

/// A ball of so many spacings holds what cuts a good cell.
pub(super) const NEAR: f64 = 1.6;

/// How much nearer to each other two sites may have come, in spacings. Wider lists
/// last longer, and take longer to go through.
const SKIN: f64 = 0.4;

/// Lists are made anew for more strays than one in so many sites.
const MANY: usize = 50;

/// Edge of the cells that sites are looked up by, in spacings.
const CELL: f64 = 1.6;

/// The sites of a cloud, and what is near each.
pub(super) struct Neighborhoods {
    spacing: f64,
    /// Where the sites are.
    places: Vec<Local>,
    /// What brought them there from where they were before …
    moves: Vec<Local>,
    /// … and how long it is, in spacings.
    lengths: Vec<f32>,
    /// Sites that lie together.
    blocks: Vec<Range<usize>>,
    lists: Lists,
    /// Sites that have gone farther than half the skin, and where they are.
    strays: Vec<u32>,
    strayed: NeighborGrid,
}

/// For every site those that were near it.
struct Lists {
    /// Where the sites were.
    places: Vec<Local>,
    /// The same, to be looked up.
    grid: NeighborGrid,
    /// Of site k they are `others[starts[k]..starts[k + 1]]`, nearest first.
    starts: Vec<u32>,
    others: Vec<u32>,
}

impl Neighborhoods {
    /// Sites at `places`, block by block.
    pub(super) fn new(places: Vec<Local>, blocks: Vec<Range<usize>>, spacing: f64) -> Self {
        Self {
            spacing,
            lists: Lists::new(places.clone(), &blocks, spacing),
            moves: vec![Local::zeros(); places.len()],
            lengths: vec![0.0; places.len()],
            places,
            blocks,
            strays: Vec::new(),
            strayed: NeighborGrid::new(&[], CELL * spacing),
        }
    }

    /// Where the sites are.
    pub(super) fn places(&self) -> &[Local] {
        &self.places
    }

    /// The spacing of the run (CRS units).
    pub(super) fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Sites that lie together, as ranges of them all.
    pub(super) fn blocks(&self) -> &[Range<usize>] {
        &self.blocks
    }

    /// Moves the sites to `places`.
    pub(super) fn go(&mut self, places: Vec<Local>) {
        let per_spacing = 1.0 / self.spacing;
        self.moves
            .par_iter_mut()
            .zip(&mut self.lengths)
            .zip(places.par_iter().zip(&self.places))
            .for_each(|((way, length), (now, before))| {
                *way = now - before;
                *length = (way.norm() * per_spacing) as f32;
            });
        self.places = places;
        let has_strayed = |&site: &u32| self.has_strayed(site, self.lists.places[site as usize]);
        let sites = 0..self.places.len() as u32;
        self.strays = sites.into_par_iter().filter(has_strayed).collect();
        if self.strays.len() > self.places.len() / MANY {
            self.lists = Lists::new(self.places.clone(), &self.blocks, self.spacing);
            self.strays.clear();
        }
        let strayed: Vec<Local> = self
            .strays
            .iter()
            .map(|&k| self.places[k as usize])
            .collect();
        self.strayed = NeighborGrid::new(&strayed, CELL * self.spacing);
    }

    /// Whether `site`, which was at `listed` when the lists were made, is far from there.
    fn has_strayed(&self, site: u32, listed: Local) -> bool {
        let skin = 0.5 * SKIN * self.spacing;
        (self.places[site as usize] - listed).norm_squared() > skin * skin
    }

    /// Fills `strays` with every stray that can be within `radius` (CRS units) of one of
    /// `block`.
    pub(super) fn strays_around(&self, block: &Range<usize>, radius: f64, strays: &mut Vec<u32>) {
        strays.clear();
        if !self.strays.is_empty() {
            let [low, high] = bounds(self.places[block.clone()].iter().copied());
            let reach = Local::repeat(radius);
            let add = |stray: u32, _| strays.push(self.strays[stray as usize]);
            self.strayed.visit_box(low - reach, high + reach, add);
        }
    }

    /// What brought `site` where it is.
    pub(super) fn last_move(&self, site: usize) -> Local {
        self.moves[site]
    }

    /// Its length, in spacings.
    pub(super) fn length_of_move(&self, site: usize) -> f32 {
        self.lengths[site]
    }

    /// All that can be near `site`, and more. `strays` are those around it; `None` if it is
    /// one, and has no list.
    pub(super) fn listed<'a>(
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

    /// Fills `neighbors` with every other site within [`NEAR`] of `site`. `strays`
    /// are those around it; `false` if it is one, and has no list.
    pub(super) fn near(&self, site: usize, strays: &[u32], neighbors: &mut Vec<Neighbor>) -> bool {
        let Some(listed) = self.listed(site, strays) else {
            return false;
        };
        let near = (NEAR * self.spacing).powi(2);
        neighbors.clear();
        neighbors.extend(
            listed
                .map(|other| self.neighbor(site, other))
                .filter(|neighbor| neighbor.distance_squared <= near),
        );
        true
    }

    /// Fills `found` with every site that can be within `radius` (CRS units) of one of
    /// `block`, wherever the sites have gone.
    pub(super) fn all_around(
        &self,
        block: &Range<usize>,
        radius: f64,
        found: &mut Vec<(u32, Local)>,
    ) {
        found.clear();
        let [low, high] = bounds(self.places[block.clone()].iter().copied());
        let reach = Local::repeat(radius + 0.5 * SKIN * self.spacing);
        let grid = &self.lists.grid;
        grid.visit_box(low - reach, high + reach, |site, listed| {
            if !self.has_strayed(site, listed) {
                found.push((site, self.places[site as usize]));
            }
        });
        self.strayed
            .visit_box(low - reach, high + reach, |stray, place| {
                found.push((self.strays[stray as usize], place));
            });
    }

    /// Site `other` as a neighbour of `site`.
    pub(super) fn neighbor(&self, site: usize, other: u32) -> Neighbor {
        neighbor(self.places[site], other, self.places[other as usize])
    }
}

/// Site `index` at `position` as a neighbour of one at `place`.
pub(super) fn neighbor(place: Local, index: u32, position: Local) -> Neighbor {
    Neighbor {
        distance_squared: (position - place).norm_squared(),
        index,
        position,
    }
}

impl Lists {
    fn new(places: Vec<Local>, blocks: &[Range<usize>], spacing: f64) -> Self {
        let grid = NeighborGrid::new(&places, CELL * spacing);
        let radius = (NEAR + SKIN) * spacing;
        let of_block = |around: &mut Vec<(u32, Local)>, block: &Range<usize>| {
            let [low, high] = bounds(places[block.clone()].iter().copied());
            let reach = Local::repeat(radius);
            around.clear();
            grid.visit_box(low - reach, high + reach, |other, place| {
                around.push((other, place));
            });
            // A distance that is not negative sorts as its bits do: one word to a site.
            let mut near: Vec<u64> = Vec::new();
            let (mut counts, mut others) = (Vec::with_capacity(block.len()), Vec::new());
            for site in block.clone() {
                near.clear();
                near.extend(around.iter().filter_map(|&(other, place)| {
                    let squared = (place - places[site]).norm_squared();
                    (squared <= radius * radius && other as usize != site)
                        .then(|| u64::from((squared as f32).to_bits()) << 32 | u64::from(other))
                }));
                near.sort_unstable();
                counts.push(near.len() as u32);
                others.extend(near.iter().map(|&word| word as u32));
            }
            (counts, others)
        };
        let by_block: Vec<(Vec<u32>, Vec<u32>)> = blocks
            .par_iter()
            .with_max_len(BLOCKS_AT_ONCE)
            .map_init(Vec::new, of_block)
            .collect();
        let mut starts = vec![0];
        let mut end = 0;
        for count in by_block.iter().flat_map(|(counts, _)| counts) {
            end += count;
            starts.push(end);
        }
        let mut others = vec![0; end as usize];
        let mut rest = &mut others[..];
        let mut parts = Vec::with_capacity(by_block.len());
        for (_, found) in &by_block {
            let (part, after) = rest.split_at_mut(found.len());
            parts.push((part, found));
            rest = after;
        }
        let parts = parts.into_par_iter();
        parts.for_each(|(part, found)| part.copy_from_slice(found));
        Self {
            places,
            grid,
            starts,
            others,
        }
    }

    fn of(&self, site: usize) -> &[u32] {
        &self.others[self.starts[site] as usize..self.starts[site + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// Kept lists, against a look at all sites.
    #[test]
    fn what_is_near_is_found_however_far_the_sites_have_gone() {
        let roll = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let n = 600;
        let mut places: Vec<Local> = (0..n)
            .map(|k| Local::new(20.0 * roll(3 * k), 20.0 * roll(3 * k + 1), roll(3 * k + 2)))
            .collect();
        places[1] = places[0];
        let blocks = (0..n as usize).step_by(10).map(|k| k..k + 10).collect();
        let mut sites = Neighborhoods::new(places.clone(), blocks, 1.0);
        let mut met_strays = 0;
        for round in 1..8_u64 {
            // All go a little, some far.
            for (k, place) in (0_u64..).zip(&mut places) {
                let far = if k % 60 == 0 { 1.0 } else { 0.03 };
                let way = |axis| roll(spread(round) ^ (3 * k + axis)) - 0.5;
                *place += Local::new(way(0), way(1), way(2)) * far;
            }
            sites.go(places.clone());
            met_strays += sites.strays.len();
            let (mut found, mut around, mut all) = (Vec::new(), Vec::new(), Vec::new());
            for own in 0..places.len() {
                for radius in [NEAR, 2.5] {
                    let mut truth: Vec<(f64, u32)> = (0..)
                        .zip(&places)
                        .map(|(other, &place)| ((place - places[own]).norm_squared(), other))
                        .filter(|&(d, other)| d <= radius * radius && other != own as u32)
                        .collect();
                    truth.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    let block = own / 10 * 10..own / 10 * 10 + 10;
                    sites.strays_around(&block, radius, &mut around);
                    if radius > NEAR || !sites.near(own, &around, &mut found) {
                        sites.all_around(&block, radius, &mut all);
                        let place = places[own];
                        let others = all.iter().map(|&(k, other)| neighbor(place, k, other));
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
