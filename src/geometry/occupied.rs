//! Which cells of a cubic lattice are occupied, and by which points.
//!
//! Points are sorted by cell; an occupied cell is a range of them. Empty cells
//! cost nothing: the occupied ones are found through a hash table with open
//! addressing.

use rayon::prelude::*;

use super::Local;

/// Where a cell lies: whole cells from the local origin.
pub type CellIndex = [i32; 3];

/// The cell of edge `edge` that holds `point`.
pub fn cell_of(point: Local, edge: f64) -> CellIndex {
    // `as` saturates: a coordinate beyond the range lands in the last cell.
    [point.x, point.y, point.z].map(|c| (c / edge).floor() as i32)
}

/// Ranges of points, sorted by cell.
#[derive(Debug, Clone)]
pub struct OccupiedCells {
    base: CellIndex,
    /// Packed cells, sorted, without repeats.
    cells: Vec<u64>,
    /// Points `starts[k]..starts[k + 1]` lie in `cells[k]`.
    starts: Vec<u32>,
    /// Hash table of places in `cells`.
    table: Vec<u32>,
}

const EMPTY: u32 = u32::MAX;

impl OccupiedCells {
    /// Sorts points by cell: the result's second part gives, in sorted order,
    /// the place of each point in the input. Within a cell `tie` decides, then
    /// the order of the input.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points, spanning less than 2²¹ cells on
    /// each axis (a tile does).
    pub fn sort<T: Ord>(
        cells_of_points: impl ExactSizeIterator<Item = CellIndex> + Clone,
        tie: impl Fn(u32) -> T + Sync,
    ) -> (Self, Vec<u32>) {
        let count = u32::try_from(cells_of_points.len()).expect("a tile has under 2^32 points");
        let mut base = [i32::MAX; 3];
        for index in cells_of_points.clone() {
            for axis in 0..3 {
                base[axis] = base[axis].min(index[axis]);
            }
        }
        let mut keyed: Vec<(u64, u32)> = cells_of_points
            .zip(0..count)
            .map(|(index, place)| {
                let key = pack(index, base).expect("a tile spans less than 2^21 cells");
                (key, place)
            })
            .collect();
        keyed.par_sort_unstable_by(|&(a, i), &(b, j)| {
            a.cmp(&b).then_with(|| tie(i).cmp(&tie(j))).then(i.cmp(&j))
        });
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
        let order = keyed.into_iter().map(|(_, place)| place).collect();
        let occupied = Self {
            base,
            cells,
            starts,
            table,
        };
        (occupied, order)
    }

    /// Number of occupied cells.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether there is no point at all.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// The ranges of points of the occupied cells, in their order.
    pub fn ranges(&self) -> impl ExactSizeIterator<Item = std::ops::Range<usize>> + '_ {
        self.starts.windows(2).map(|w| w[0] as usize..w[1] as usize)
    }

    /// The range of points in the cell `index`; empty if there are none.
    pub fn range(&self, index: CellIndex) -> std::ops::Range<usize> {
        self.place(index).map_or(0..0, |place| {
            self.starts[place] as usize..self.starts[place + 1] as usize
        })
    }

    /// The place of the cell `index` among the occupied ones, if it is one.
    pub fn place(&self, index: CellIndex) -> Option<usize> {
        let key = pack(index, self.base)?;
        let mask = self.table.len() - 1;
        let mut slot = spread(key) as usize & mask;
        loop {
            match self.table[slot] {
                EMPTY => return None,
                place if self.cells[place as usize] == key => return Some(place as usize),
                _ => slot = (slot + 1) & mask,
            }
        }
    }

    /// Bytes of memory held per occupied cell, at most.
    pub const BYTES_PER_CELL: usize = 8 + 4 + 16;
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
fn pack(index: CellIndex, base: CellIndex) -> Option<u64> {
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
