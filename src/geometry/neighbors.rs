//! Points in the cells of a cubic lattice, to find those near a place.
//!
//! A uniform grid serves better than a tree here: the query radius is tied to
//! the spacing, and scans are full of coincident and coplanar points, which
//! cost a k-d tree its balance. Only occupied cells are kept, in a hash table
//! with open addressing.
//!
//! The cells belong to a lattice anchored at the local origin, and they are
//! visited in a fixed order (z, then y, then x; within a cell in the order the
//! points were given). So a sum over neighbours adds in an order that depends
//! on the data alone, and gives the same bits in every tile that sees it.

use super::Local;

/// Where a cell lies: whole cells from the local origin.
pub type CellIndex = [i32; 3];

/// The cell of edge `edge` that holds `point`.
pub fn cell_of(point: Local, edge: f64) -> CellIndex {
    // `as` saturates: a coordinate beyond the range lands in the last cell.
    [point.x, point.y, point.z].map(|c| (c / edge).floor() as i32)
}

/// Points by the cell of a cubic lattice.
#[derive(Debug, Clone)]
pub struct NeighborGrid {
    edge: f64,
    base: CellIndex,
    /// Points, sorted by cell.
    points: Vec<Local>,
    /// For each entry of `points` its place in the input.
    order: Vec<u32>,
    /// Packed cells, sorted, without repeats.
    cells: Vec<u64>,
    /// `points[starts[k]..starts[k + 1]]` lie in `cells[k]`.
    starts: Vec<u32>,
    /// Hash table of places in `cells`.
    table: Vec<u32>,
}

const EMPTY: u32 = u32::MAX;

impl NeighborGrid {
    /// Sorts `points` into cells of edge `edge` (CRS units).
    ///
    /// # Panics
    ///
    /// Unless `edge` is positive, there are fewer than 2³² points, and the
    /// points span less than 2²¹ cells on each axis (a tile does).
    pub fn new(points: &[Local], edge: f64) -> Self {
        assert!(edge > 0.0, "an edge of {edge}");
        let count = u32::try_from(points.len()).expect("a tile has fewer than 2^32 points");
        let indices: Vec<CellIndex> = points.iter().map(|&p| cell_of(p, edge)).collect();
        let mut base = [i32::MAX; 3];
        for index in &indices {
            for axis in 0..3 {
                base[axis] = base[axis].min(index[axis]);
            }
        }
        let mut keyed: Vec<(u64, u32)> = indices
            .iter()
            .zip(0..count)
            .map(|(&index, place)| {
                (
                    pack(index, base).expect("a tile spans less than 2^21 cells"),
                    place,
                )
            })
            .collect();
        keyed.sort_unstable();

        let mut cells: Vec<u64> = Vec::new();
        let mut starts = Vec::new();
        for (place, &(key, _)) in (0u32..).zip(&keyed) {
            if cells.last() != Some(&key) {
                cells.push(key);
                starts.push(place);
            }
        }
        starts.push(count);
        let table = hash_table(&cells);
        Self {
            edge,
            base,
            points: keyed.iter().map(|&(_, i)| points[i as usize]).collect(),
            order: keyed.iter().map(|&(_, i)| i).collect(),
            cells,
            starts,
            table,
        }
    }

    /// The points, sorted by cell.
    pub fn points(&self) -> &[Local] {
        &self.points
    }

    /// Calls `visit` with the place in the input and the coordinates of every
    /// point of the cells that a ball touches: all points within `radius` of
    /// `center`, and some beyond.
    pub fn visit_around(&self, center: Local, radius: f64, mut visit: impl FnMut(u32, Local)) {
        let reach = Local::repeat(radius);
        let low = cell_of(center - reach, self.edge);
        let high = cell_of(center + reach, self.edge);
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let range = self.range([x, y, z]);
                    for place in range {
                        visit(self.order[place], self.points[place]);
                    }
                }
            }
        }
    }

    /// Whether any point lies within `radius` of `center`.
    pub fn any_within(&self, center: Local, radius: f64) -> bool {
        let radius_squared = radius * radius;
        let hits = |index: CellIndex| {
            self.points[self.range(index)]
                .iter()
                .any(|p| (p - center).norm_squared() <= radius_squared)
        };
        // The cell of the centre first: there is nearly always one.
        let home = cell_of(center, self.edge);
        if hits(home) {
            return true;
        }
        let reach = Local::repeat(radius);
        let low = cell_of(center - reach, self.edge);
        let high = cell_of(center + reach, self.edge);
        (low[2]..=high[2]).any(|z| {
            (low[1]..=high[1])
                .any(|y| (low[0]..=high[0]).any(|x| [x, y, z] != home && hits([x, y, z])))
        })
    }

    /// Squared distance from `center` to the nearest point but those for which
    /// `skip` holds, if one lies within `radius`, with its place in the input.
    /// Of equally near points the first visited wins.
    pub fn nearest(
        &self,
        center: Local,
        radius: f64,
        skip: impl Fn(u32) -> bool,
    ) -> Option<(u32, f64)> {
        let search = |reach: f64, limit: f64| {
            let mut best: Option<(u32, f64)> = None;
            self.visit_around(center, reach, |index, point| {
                let squared = (point - center).norm_squared();
                if squared <= limit && best.is_none_or(|(_, b)| squared < b) && !skip(index) {
                    best = Some((index, squared));
                }
            });
            best
        };
        // Rings of growing reach: near points end the search early.
        let limit = radius * radius;
        let mut reach = self.edge.min(radius);
        loop {
            match search(reach, limit) {
                Some((index, squared)) if squared <= reach * reach => {
                    return Some((index, squared));
                }
                // Found in a corner of the cells: nothing lies nearer than the
                // ball through it holds.
                Some((_, squared)) => return search(squared.sqrt(), squared),
                None if reach >= radius => return None,
                None => reach = (2.0 * reach).min(radius),
            }
        }
    }

    fn range(&self, index: CellIndex) -> std::ops::Range<usize> {
        let Some(key) = pack(index, self.base) else {
            return 0..0;
        };
        let mask = self.table.len() - 1;
        let mut slot = spread(key) as usize & mask;
        loop {
            match self.table[slot] {
                EMPTY => return 0..0,
                place if self.cells[place as usize] == key => {
                    let place = place as usize;
                    return self.starts[place] as usize..self.starts[place + 1] as usize;
                }
                _ => slot = (slot + 1) & mask,
            }
        }
    }
}

/// Twice as many slots as cells keep the probes short.
fn hash_table(cells: &[u64]) -> Vec<u32> {
    let mut table = vec![EMPTY; (2 * cells.len()).next_power_of_two().max(2)];
    let mask = table.len() - 1;
    for (place, &key) in (0u32..).zip(cells) {
        let mut slot = spread(key) as usize & mask;
        while table[slot] != EMPTY {
            slot = (slot + 1) & mask;
        }
        table[slot] = place;
    }
    table
}

/// Three cell indices in one integer that sorts by z, y, x; `None` if the cell
/// is out of range of `base`.
pub(crate) fn pack(index: CellIndex, base: CellIndex) -> Option<u64> {
    let mut key = 0u64;
    for axis in [2, 1, 0] {
        let from_base = i64::from(index[axis]) - i64::from(base[axis]);
        if !(0..1 << 21).contains(&from_base) {
            return None;
        }
        key = key << 21 | from_base as u64;
    }
    Some(key)
}

/// A hash of `key` whose every bit depends on every bit of it (the finaliser
/// of SplitMix64; Steele, Lea and Flood, *Fast splittable pseudorandom number
/// generators*, 2014).
pub(crate) fn spread(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(n: u64, extent: f64) -> Vec<Local> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64 - 0.5;
        (0..n)
            .map(|i| Local::new(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)) * extent)
            .collect()
    }

    #[test]
    fn nearest_neighbours_match_brute_force() {
        let points = cloud(500, 10.0);
        let grid = NeighborGrid::new(&points, 0.7);
        for (i, &center) in points.iter().enumerate() {
            for radius in [0.3, 1.0, 4.0] {
                let found = grid.nearest(center, radius, |j| j as usize == i);
                let truth = points
                    .iter()
                    .enumerate()
                    .filter(|&(j, p)| j != i && (p - center).norm() <= radius)
                    .map(|(_, p)| (p - center).norm_squared())
                    .min_by(f64::total_cmp);
                assert_eq!(found.map(|(_, d)| d), truth);
                let any = points.iter().any(|p| (p - center * 1.3).norm() <= radius);
                assert_eq!(grid.any_within(center * 1.3, radius), any);
            }
        }
    }

    #[test]
    fn every_point_within_the_radius_is_visited_once() {
        let points = cloud(400, 6.0);
        let grid = NeighborGrid::new(&points, 0.9);
        for &center in &points {
            let mut seen = vec![0; points.len()];
            grid.visit_around(center, 1.5, |i, p| {
                assert_eq!(points[i as usize], p);
                seen[i as usize] += 1;
            });
            for (count, p) in seen.iter().zip(&points) {
                assert!(*count <= 1);
                assert!(*count == 1 || (p - center).norm() > 1.5);
            }
        }
    }

    #[test]
    fn the_order_of_a_visit_does_not_depend_on_points_far_away() {
        let near = cloud(200, 4.0);
        let mut both = cloud(50, 3.0);
        for p in &mut both {
            p.x -= 500.0;
        }
        both.extend(&near);
        let visit = |points: &[Local]| {
            let mut seen = Vec::new();
            NeighborGrid::new(points, 0.8).visit_around(Local::zeros(), 1.6, |_, p| seen.push(p));
            seen
        };
        assert_eq!(visit(&near), visit(&both));
    }

    #[test]
    fn an_empty_grid_finds_nothing() {
        let grid = NeighborGrid::new(&[], 1.0);
        assert!(!grid.any_within(Local::zeros(), 5.0));
        assert!(grid.nearest(Local::zeros(), 5.0, |_| false).is_none());
    }
}
