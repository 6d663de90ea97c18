//! A cell from the neighbours that it had: in fewer steps than by clipping.
//!
//! ```text
//!        c1___c0        corner k: where the bisectors of ring[k] and ring[k + 1] meet on the
//!       /      \         patch. An edge that runs backwards is gone; what else can cut off a
//!     c2   x   c5        corner does so afterwards.
//!       \______/
//!       c3    c4
//! ```

use super::{
    Local, Neighbor, Patch,
    bisector::{Bisector, meeting},
    cell::{Cell, Corner, MOST_EDGES},
    heights::Heights,
};

impl Cell {
    /// Computes the cell of `site` on `patch` from the neighbours of `ring` with which it
    /// shared edges not long ago, counter-clockwise: its corners are where the bisectors of
    /// consecutive neighbours meet, except for a few that were lost or are new. `false` if
    /// that does not lead to a cell within `radius` (CRS units). The contents of `ring` are
    /// lost.
    ///
    /// `neighbors` must contain every other site within twice `radius`.
    pub fn close(
        &mut self,
        patch: &Patch,
        site: Local,
        radius: f64,
        ring: &mut Vec<Neighbor>,
        neighbors: &[Neighbor],
    ) -> bool {
        let surface = patch.heights_from(site);
        if !self.close_ring(patch, site, &surface, radius, ring) {
            return false;
        }
        // The other neighbours that can cut off a corner, in an order that does not depend on the
        // caller's.
        let security = self.security_squared();
        let is_other = |neighbor: &&Neighbor| {
            neighbor.distance_squared <= security
                && neighbor.distance_squared > 0.0
                && self.neighbors().all(|edge| edge != neighbor.index)
        };
        ring.clear();
        ring.extend(neighbors.iter().filter(is_other));
        Neighbor::sort(ring);
        for neighbor in &*ring {
            self.cut_by(neighbor, &Bisector::new(patch, site, neighbor), &surface);
        }
        true
    }

    /// Makes the polygon between the bisectors of `ring`, and removes the neighbours that have
    /// no edge any more; `false` if that leads to no polygon within `radius`.
    fn close_ring(
        &mut self,
        patch: &Patch,
        site: Local,
        surface: &Heights,
        radius: f64,
        ring: &mut Vec<Neighbor>,
    ) -> bool {
        if ring.len() > MOST_EDGES {
            return false;
        }
        let mut bisectors = [Bisector::default(); MOST_EDGES];
        for (bisector, neighbor) in bisectors.iter_mut().zip(&*ring) {
            *bisector = Bisector::new(patch, site, neighbor);
        }
        while ring.len() >= 3 {
            let count = ring.len();
            let bisectors = &mut bisectors[..count];
            if !self.meet_around(bisectors, ring, surface, radius) {
                return false;
            }
            let corners = &self.polygons[0][..count];
            // Each edge must still run counter-clockwise.
            let is_behind = |&k: &usize| {
                let before = if k == 0 { count - 1 } else { k - 1 };
                let way = corners[k].position - corners[before].position;
                let towards = bisectors[k].direction;
                towards.x * way.y - towards.y * way.x <= 0.0
            };
            let Some(gone) = (0..count).find(is_behind) else {
                return true;
            };
            ring.remove(gone);
            bisectors[gone..].rotate_left(1);
        }
        false
    }

    /// Makes a polygon of the points where each of `bisectors` meets the next; `false` if two of
    /// them do not meet, or beyond `radius`.
    fn meet_around(
        &mut self,
        bisectors: &[Bisector],
        ring: &[Neighbor],
        surface: &Heights,
        radius: f64,
    ) -> bool {
        let count = ring.len();
        self.current = 0;
        self.count = count;
        for k in 0..count {
            let next = if k + 1 == count { 0 } else { k + 1 };
            match meeting(&bisectors[k], &bisectors[next], surface, radius) {
                Some(position) if position.norm_squared() <= radius * radius => {
                    self.polygons[0][k] = Corner {
                        position,
                        edge: ring[next].index,
                    };
                }
                _ => return false,
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{
        BOUNDING_SIDES,
        test_cells::{bent, hexagonal, sorted},
    };

    /// Clipping is the slow twin of closing; on a bent patch its corners lie on chords.
    #[test]
    fn a_cell_closed_where_it_was_is_the_same_as_a_clipped_one() {
        for (curvature, tolerance) in [(0.0, 1e-12), (0.1, 1e-2)] {
            let patch = bent(curvature);
            let (mut met, mut changed) = (0, 0);
            for seed in 0..80_u64 {
                let roll =
                    |k: u64| crate::geometry::spread(100 * seed + k) as f64 / u64::MAX as f64;
                let moved = |by: f64, shift: u64| {
                    let moved = |(k, place): (u64, Local)| {
                        let [x, y] = [2 * k, 2 * k + 1].map(|k| roll(k + shift) - 0.5);
                        patch.foot_point(place + Local::new(x, y, 0.0) * by)
                    };
                    (0..).zip(hexagonal(3)).map(moved).collect::<Vec<Local>>()
                };
                let site = patch.foot_point(Local::zeros());
                let (mut cell, mut twin) = (Cell::new(), Cell::new());
                let reach = [1.0; BOUNDING_SIDES];
                twin.clip(&patch, site, &reach, &sorted(site, &moved(0.6, 0)));
                let links: Vec<u32> = twin.neighbors().collect();
                let neighbors = sorted(site, &moved(0.7, 9));
                twin.clip(&patch, site, &reach, &neighbors);
                let linked = |&link: &u32| *neighbors.iter().find(|n| n.index == link).unwrap();
                let mut ring: Vec<Neighbor> = links.iter().map(linked).collect();
                if !cell.close(&patch, site, 0.8, &mut ring, &neighbors) {
                    continue;
                }
                met += 1;
                let [own, other] = [&cell, &twin].map(|c| c.moments(&patch, site).unwrap());
                assert!((own.area - other.area).abs() < tolerance);
                assert!((own.centroid - other.centroid).norm() < tolerance);
                let sorted_neighbors = |cell: &Cell| {
                    let mut neighbors: Vec<u32> = cell.neighbors().collect();
                    neighbors.sort_unstable();
                    neighbors
                };
                let now = sorted_neighbors(&cell);
                assert!(curvature > 0.0 || now == sorted_neighbors(&twin));
                let mut before = links;
                before.sort_unstable();
                changed += usize::from(now != before);
            }
            assert!(met > 30 && changed > 5, "{met}, {changed}");
        }
    }
}
