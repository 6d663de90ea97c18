//! For every site a list of the others that were near it when the list was made.

use std::ops::Range;

use rayon::prelude::*;

use super::site_spacings::SiteSpacings;
use crate::{
    geometry::{ITEMS_PER_TASK, Local, NeighborGrid},
    lloyd::{field::SpacingField, surface::bounding_box},
};

/// Blocks that a thread takes at a time.
pub(crate) const BLOCKS_PER_TASK: usize = ITEMS_PER_TASK / 16;

/// A ball of this radius contains all neighbours that cut a good cell.
pub(crate) const NEAR_IN_SPACINGS: f64 = 1.6;

/// How much nearer to each other two sites may come before the lists are out of date. Wider
/// lists last longer, and take longer to go through.
pub(super) const SKIN_IN_SPACINGS: f64 = 0.4;

/// Blocks whose lists are made before they are put with the others: all of them at once would be in memory twice. In tests there are
/// more than so many, too.
const BLOCKS_TOGETHER: usize = if cfg!(test) { 7 } else { 4096 };

/// Edge of the cells by which sites are looked up.
pub(super) const SITE_CELL_IN_SPACINGS: f64 = 1.6;

/// For every site the others that were near it when the lists were made.
pub(super) struct Lists {
    /// The positions of the sites when the lists were made.
    pub(super) positions: Vec<Local>,
    /// The positions of the sites, sorted by cell.
    pub(super) grid: NeighborGrid,
    /// The list of site k is `others[starts[k]..starts[k + 1]]`, nearest first.
    starts: Vec<u32>,
    others: Vec<u32>,
}

impl Lists {
    /// Lists all others within a near radius and a skin of each of the sites, which lie block
    /// by block.
    pub(super) fn new(
        positions: &[Local],
        blocks: &[Range<usize>],
        spacings: &SiteSpacings,
        field: &SpacingField,
    ) -> Self {
        let mut lists = Self {
            positions: Vec::new(),
            grid: field.grid(&[], SITE_CELL_IN_SPACINGS),
            starts: Vec::new(),
            others: Vec::new(),
        };
        lists.renew(positions, blocks, spacings, field);
        lists
    }

    /// Makes the lists anew, as [`new`](Self::new) does, in the memory of the present ones.
    pub(super) fn renew(
        &mut self,
        positions: &[Local],
        blocks: &[Range<usize>],
        spacings: &SiteSpacings,
        field: &SpacingField,
    ) {
        // The former grid makes room for the next.
        self.grid = field.grid(&[], SITE_CELL_IN_SPACINGS);
        self.grid = field.grid_by(positions, spacings.of_sites(), SITE_CELL_IN_SPACINGS);
        self.positions.clear();
        self.positions.extend_from_slice(positions);
        self.starts.clear();
        self.starts.reserve_exact(positions.len() + 1);
        self.starts.push(0);
        self.others.clear();
        let grid = &self.grid;
        let radius_at = |spacing: f64| (NEAR_IN_SPACINGS + SKIN_IN_SPACINGS) * spacing;
        let of_block = |around: &mut Vec<(u32, Local)>, block: &Range<usize>| {
            let [low, high] = bounding_box(positions[block.clone()].iter().copied());
            let reach = Local::repeat(radius_at(spacings.coarsest_of(block)));
            around.clear();
            grid.visit_box(low - reach, high + reach, |other, position| {
                around.push((other, position));
            });
            // A distance that is not negative sorts as its bits do: one word to a site.
            let mut near: Vec<u64> = Vec::new();
            let (mut counts, mut others) = (Vec::with_capacity(block.len()), Vec::new());
            near.resize(around.len(), 0);
            for site in block.clone() {
                let radius = radius_at(spacings.of(site));
                // Every word is written, and stays if its site is near: no branch is mispredicted.
                let mut count = 0;
                for &(other, position) in &*around {
                    let squared = (position - positions[site]).norm_squared();
                    near[count] = u64::from((squared as f32).to_bits()) << 32 | u64::from(other);
                    count += usize::from(squared <= radius * radius && other as usize != site);
                }
                let near = &mut near[..count];
                near.sort_unstable();
                counts.push(count as u32);
                others.extend(near.iter().map(|&word| word as u32));
            }
            (counts, others)
        };
        let mut end = 0;
        for blocks in blocks.chunks(BLOCKS_TOGETHER) {
            let by_block: Vec<(Vec<u32>, Vec<u32>)> = blocks
                .par_iter()
                .with_max_len(BLOCKS_PER_TASK)
                .map_init(Vec::new, of_block)
                .collect();
            for (counts, others) in by_block {
                self.starts.extend(counts.iter().map(|count| {
                    end += count;
                    end
                }));
                self.others.extend(others);
            }
        }
    }

    /// The sites that were near `site`.
    pub(super) fn of(&self, site: usize) -> &[u32] {
        &self.others[self.starts[site] as usize..self.starts[site + 1] as usize]
    }
}
