//! Which sites are neighbours: the ring of sites around each cell.
//!
//! ```text
//!        b___a            The edges of a cell, counter-clockwise: each lies on the
//!       /     \           bisector between the site and one neighbour, or it is a *gap*:
//!     c     x  f          the border of what was scanned.
//!       \_____/           Closed: a b c d e f.     Open, if f is a gap: a b c d e.
//!        d   e
//! ```

use rayon::prelude::*;

/// An edge of a cell that lies on no bisector.
pub(super) const GAP: u32 = u32::MAX;

/// The edges of one cell before the sites are in their final order.
#[derive(Clone, Debug)]
pub(super) struct Edges {
    /// The index of the site in the order of the solver.
    pub(super) site: u32,
    /// The indices of the neighbours in the order of the solver, counter-clockwise as seen
    /// from the tip of the normal, and [`GAP`] for edges that lie on no bisector.
    pub(super) around: Box<[u32]>,
}

/// The rings of all sites of a solution, in the order of the sites.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Rings {
    /// The ring of site k is `neighbors[starts[k]..starts[k + 1]]`.
    starts: Vec<usize>,
    neighbors: Vec<u32>,
    is_closed: Vec<bool>,
}

/// The neighbours of one site, in order around its cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ring<'a> {
    /// The indices of the neighbours among the sites of the solution, each once,
    /// counter-clockwise as seen from the tip of the normal. An open ring begins after a gap;
    /// a site without a cell has no neighbours.
    pub(crate) neighbors: &'a [u32],
    /// Whether neighbours bound the cell all around.
    pub(crate) is_closed: bool,
}

impl Rings {
    /// The rings of sites whose cells have `edges`, given in the final order of the sites;
    /// `count` is the number of all sites of the solver. A neighbour that has no `edges` is
    /// not among the final sites, and makes a gap.
    pub(super) fn new(edges: &[Edges], count: usize) -> Self {
        let mut final_index = vec![GAP; count];
        for (index, edges) in (0..).zip(edges) {
            final_index[edges.site as usize] = index;
        }
        let rings: Vec<(Vec<u32>, bool)> = edges
            .par_iter()
            .map(|edges| {
                ring(edges.around.iter().map(|&other| match other {
                    GAP => GAP,
                    other => final_index[other as usize],
                }))
            })
            .collect();
        let mut starts = Vec::with_capacity(rings.len() + 1);
        starts.push(0);
        let mut neighbors = Vec::with_capacity(rings.iter().map(|(ring, _)| ring.len()).sum());
        for (ring, _) in &rings {
            neighbors.extend_from_slice(ring);
            starts.push(neighbors.len());
        }
        Self {
            starts,
            neighbors,
            is_closed: rings.into_iter().map(|(_, is_closed)| is_closed).collect(),
        }
    }

    /// The ring of the site with index `site`.
    ///
    /// # Panics
    ///
    /// If there are not that many sites.
    pub(crate) fn of(&self, site: usize) -> Ring<'_> {
        Ring {
            neighbors: &self.neighbors[self.starts[site]..self.starts[site + 1]],
            is_closed: self.is_closed[site],
        }
    }
}

/// The neighbours of a cell with the edges `around`, each once, from behind a gap if there is
/// one; and whether there is none.
fn ring(around: impl Iterator<Item = u32>) -> (Vec<u32>, bool) {
    let mut ring: Vec<u32> = around.collect();
    let last_gap = ring.iter().rposition(|&edge| edge == GAP);
    ring.rotate_left(last_gap.map_or(0, |gap| gap + 1));
    let mut kept = 0;
    for k in 0..ring.len() {
        // A bisector that bounds a bent cell twice is the edge of one neighbour.
        if ring[k] != GAP && !ring[..kept].contains(&ring[k]) {
            ring[kept] = ring[k];
            kept += 1;
        }
    }
    ring.truncate(kept);
    (ring, last_gap.is_none() && kept >= 3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_ring_begins_after_its_gap() {
        assert_eq!(
            ring([1, 2, GAP, GAP, 3, 4].into_iter()),
            (vec![3, 4, 1, 2], false)
        );
        assert_eq!(ring([GAP, 5, 6].into_iter()), (vec![5, 6], false));
        assert_eq!(ring([5, 6, 7].into_iter()), (vec![5, 6, 7], true));
        assert_eq!(ring([GAP; 12].into_iter()), (vec![], false));
        assert_eq!(ring(std::iter::empty()), (vec![], false));
    }

    #[test]
    fn a_neighbor_that_bounds_a_cell_twice_is_listed_once() {
        assert_eq!(ring([1, 2, 1, 3].into_iter()), (vec![1, 2, 3], true));
    }

    #[test]
    fn a_neighbor_that_is_not_among_the_sites_makes_a_gap() {
        let edges = |site: u32, around: &[u32]| Edges {
            site,
            around: around.into(),
        };
        let rings = Rings::new(
            &[edges(4, &[0, 3, 2]), edges(2, &[0, 4, 3]), edges(0, &[])],
            5,
        );
        assert_eq!(rings.of(0).neighbors, [1, 2]);
        assert_eq!(rings.of(1).neighbors, [2, 0]);
        assert!(!rings.of(0).is_closed && rings.of(2).neighbors.is_empty());
    }
}
