//! Which cells of a cubic lattice are occupied, and by which points.
//!
//! Points are sorted by cell; an occupied cell is a range of them. Cells come in
//! bricks of 4 × 4 × 4, which know in one word which of theirs are occupied:
//!
//! ```text
//!   brick (hash table) ─► word of 64 bits ─► rank of the bit ─► range of points
//! ```
//!
//! A surface fills few of the cells that a box of space touches. The word finds
//! them without a look at the others.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use super::{Local, Stored};

/// Where a cell lies: whole cells from the local origin.
pub type CellIndex = [i32; 3];

/// The cell of edge `edge` that holds `point`.
pub fn cell_of(point: Local, edge: f64) -> CellIndex {
    let cells_per_unit = 1.0 / edge;
    [point.x, point.y, point.z].map(|c| {
        // The floor, without the call that it is on processors of old. `as`
        // saturates: a coordinate beyond the range lands in the last cell.
        let cells = c * cells_per_unit;
        let towards_zero = cells as i32;
        towards_zero.saturating_sub(i32::from(cells < f64::from(towards_zero)))
    })
}

/// Ranges of points, sorted by cell: brick by brick (z, y, x), and in a brick
/// by z, y, x again.
#[derive(Debug, Clone)]
pub struct OccupiedCells {
    /// The first brick on each axis …
    base: CellIndex,
    /// … and the last.
    top: CellIndex,
    /// Bits of a brick's key for its place on each axis.
    bits: [u32; 3],
    bricks: Vec<Brick>,
    /// Points `starts[k]..starts[k + 1]` lie in the k-th occupied cell.
    starts: Vec<u32>,
    /// Hash table of places in `bricks`.
    table: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Brick {
    key: u64,
    /// Bit x + 4 y + 16 z stands for a cell.
    occupied: u64,
    /// Number of occupied cells before this brick's.
    first: u32,
}

/// Cells along the edge of a brick, as a power of two.
const BRICK_SHIFT: u32 = 2;
/// Bits of the place of a cell in its brick.
const CELL_BITS: u32 = 3 * BRICK_SHIFT;
const CELL_MASK: i32 = (1 << BRICK_SHIFT) - 1;
const EMPTY: u32 = u32::MAX;

impl OccupiedCells {
    /// Sorts `points` by the cell that `cell_of` says: the result's second part gives,
    /// in sorted order, the place of each point in the input. Within a cell the order
    /// of the input stays.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points, in a box of fewer than 2⁵⁸
    /// bricks (a tile's are).
    pub fn sort<P: Sync>(
        points: &[P],
        cell_of: impl Fn(&P) -> CellIndex + Sync,
    ) -> (Self, Vec<u32>) {
        let count = u32::try_from(points.len()).expect("a tile has under 2^32 points");
        let nothing = || ([i32::MAX; 3], [i32::MIN; 3]);
        let wider = |(low, high): (CellIndex, CellIndex), (other_low, other_high)| {
            let pairs = |f: fn(i32, i32) -> i32, a: CellIndex, b: CellIndex| {
                [0, 1, 2].map(|axis| f(a[axis], b[axis]))
            };
            (
                pairs(i32::min, low, other_low),
                pairs(i32::max, high, other_high),
            )
        };
        let brick_of = |point: &P| cell_of(point).map(|c| c >> BRICK_SHIFT);
        let (base, top) = points
            .par_iter()
            .map(|point| (brick_of(point), brick_of(point)))
            .reduce(nothing, wider);
        let bits = [0, 1, 2].map(|axis| {
            let last = i64::from(top[axis]) - i64::from(base[axis]);
            (last.max(0) as u64 + 1)
                .next_power_of_two()
                .trailing_zeros()
        });
        let key_bits = bits.iter().sum::<u32>() + CELL_BITS;
        assert!(key_bits <= u64::BITS, "a tile of 2^{key_bits} cells");
        let keyed = points.par_iter().zip(0..count).map(|(point, place)| {
            let index = cell_of(point);
            let brick = index.map(|c| c >> BRICK_SHIFT);
            let brick = brick_key(brick, base, bits).expect("between the first and the last");
            (brick << CELL_BITS | u64::from(bit_of(index)), place)
        });
        // One word to a point, if there is room for the key and the place, sorts
        // several times as fast.
        let place_bits = u32::BITS - count.leading_zeros();
        let mut occupied = Self {
            base,
            top,
            bits,
            bricks: Vec::new(),
            starts: Vec::new(),
            table: Vec::new(),
        };
        let order = if key_bits + place_bits <= u64::BITS {
            let mut words: Vec<u64> = keyed
                .map(|(key, place)| key << place_bits | u64::from(place))
                .collect();
            words.par_sort_unstable();
            occupied.group(words.iter().map(|word| word >> place_bits));
            let mask = (1 << place_bits) - 1;
            words.par_iter().map(|word| (word & mask) as u32).collect()
        } else {
            let mut pairs: Vec<(u64, u32)> = keyed.collect();
            pairs.par_sort_unstable();
            occupied.group(pairs.iter().map(|&(key, _)| key));
            pairs.into_iter().map(|(_, place)| place).collect()
        };
        (occupied, order)
    }

    /// Sorts `points` by the cell that `cell_of` says, and within a cell by their
    /// coordinates, whatever order they came in.
    ///
    /// # Panics
    ///
    /// As [`sort`](Self::sort).
    pub fn sort_points(
        points: &[Stored],
        cell_of: impl Fn(Stored) -> CellIndex + Sync,
    ) -> (Self, Vec<Stored>) {
        let (occupied, order) = Self::sort(points, |&point| cell_of(point));
        let mut sorted: Vec<Stored> = order.par_iter().map(|&i| points[i as usize]).collect();
        drop(order);
        sorted
            .par_chunk_by_mut(|&a, &b| cell_of(a) == cell_of(b))
            .for_each(<[Stored]>::sort_unstable);
        (occupied, sorted)
    }

    /// Makes bricks and ranges of the sorted `keys` of points.
    fn group(&mut self, keys: impl Iterator<Item = u64>) {
        let (bricks, starts) = (&mut self.bricks, &mut self.starts);
        let (mut last, mut count) = (None, 0_u32);
        for key in keys {
            let start = count;
            count += 1;
            if last == Some(key) {
                continue;
            }
            last = Some(key);
            let (brick, bit) = (key >> CELL_BITS, 1 << (key & ((1 << CELL_BITS) - 1)));
            match bricks.last_mut() {
                Some(current) if current.key == brick => current.occupied |= bit,
                _ => bricks.push(Brick {
                    key: brick,
                    occupied: bit,
                    first: starts.len() as u32,
                }),
            }
            starts.push(start);
        }
        starts.push(count);
        self.table = hash_table(bricks);
    }

    /// Number of occupied cells.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Whether there is no point at all.
    pub fn is_empty(&self) -> bool {
        self.bricks.is_empty()
    }

    /// The ranges of points of the occupied cells, in their order.
    pub fn ranges(&self) -> impl ExactSizeIterator<Item = Range<usize>> + '_ {
        self.starts.windows(2).map(|w| w[0] as usize..w[1] as usize)
    }

    /// The range of points in the cell `index`; empty if there are none.
    pub fn range(&self, index: CellIndex) -> Range<usize> {
        self.place(index)
            .map_or(0..0, |place| self.points_of(place))
    }

    /// The place of the cell `index` among the occupied ones, if it is one.
    pub fn place(&self, index: CellIndex) -> Option<usize> {
        let brick = self.brick(index.map(|c| c >> BRICK_SHIFT))?;
        let bit = 1 << bit_of(index);
        (brick.occupied & bit != 0).then(|| brick.place(bit))
    }

    /// Calls `visit` with the place of every occupied cell from `low` to `high`,
    /// both included, in their order, until it breaks.
    pub fn visit_box<B>(
        &self,
        low: CellIndex,
        high: CellIndex,
        mut visit: impl FnMut(usize) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        // What of the box a brick has on one axis: from and up to which cell.
        let part = |axis: usize, brick: i32| {
            let start = brick << BRICK_SHIFT;
            [
                low[axis].saturating_sub(start).max(0) as u32,
                high[axis].saturating_sub(start).min(CELL_MASK) as u32,
            ]
        };
        let bricks = |axis: usize| {
            let first = (low[axis] >> BRICK_SHIFT).max(self.base[axis]);
            first..=(high[axis] >> BRICK_SHIFT).min(self.top[axis])
        };
        for z in bricks(2) {
            // Whole layers of 16 cells, then rows of 4, then cells.
            let layers = bits(part(2, z), 16);
            for y in bricks(1) {
                let rows = layers & (bits(part(1, y), 4) * 0x0001_0001_0001_0001);
                for x in bricks(0) {
                    let Some(brick) = self.brick([x, y, z]) else {
                        continue;
                    };
                    let cells = rows & (bits(part(0, x), 1) * 0x1111_1111_1111_1111);
                    let mut left = brick.occupied & cells;
                    while left != 0 {
                        let bit = left & left.wrapping_neg();
                        left ^= bit;
                        visit(brick.place(bit))?;
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// The range of points in the occupied cell at `place`.
    pub fn points_of(&self, place: usize) -> Range<usize> {
        self.starts[place] as usize..self.starts[place + 1] as usize
    }

    fn brick(&self, brick: CellIndex) -> Option<&Brick> {
        let key = brick_key(brick, self.base, self.bits)?;
        let mask = self.table.len() - 1;
        let mut slot = spread(key) as usize & mask;
        loop {
            match self.table[slot] {
                EMPTY => return None,
                place => {
                    let brick = &self.bricks[place as usize];
                    if brick.key == key {
                        return Some(brick);
                    }
                }
            }
            slot = (slot + 1) & mask;
        }
    }
}

impl Brick {
    /// The place of the cell with this one `bit` among the occupied cells.
    fn place(&self, bit: u64) -> usize {
        self.first as usize + (self.occupied & (bit - 1)).count_ones() as usize
    }
}

/// A word with the groups of `size` bits from the first to the last of `part`
/// set, of the four that there are.
fn bits([first, last]: [u32; 2], size: u32) -> u64 {
    let up_to = |groups: u32| u64::MAX.checked_shr(64 - groups * size).unwrap_or(0);
    up_to(last + 1) & !up_to(first)
}

/// Twice as many slots as bricks keep the probes short.
fn hash_table(bricks: &[Brick]) -> Vec<u32> {
    let mut table = vec![EMPTY; (2 * bricks.len()).next_power_of_two().max(2)];
    let mask = table.len() - 1;
    for (place, brick) in (0u32..).zip(bricks) {
        let mut slot = spread(brick.key) as usize & mask;
        while table[slot] != EMPTY {
            slot = (slot + 1) & mask;
        }
        table[slot] = place;
    }
    table
}

/// The bit of a cell in the word of its brick.
fn bit_of(index: CellIndex) -> u32 {
    let [x, y, z] = index.map(|c| (c & CELL_MASK) as u32);
    x | y << BRICK_SHIFT | z << (2 * BRICK_SHIFT)
}

/// Three brick indices in one integer that sorts by z, y, x; `None` if the
/// brick is out of range of `base`.
fn brick_key(brick: CellIndex, base: CellIndex, bits: [u32; 3]) -> Option<u64> {
    let mut key = 0u64;
    for axis in [2, 1, 0] {
        let from_base = i64::from(brick[axis]) - i64::from(base[axis]);
        if !(0..1 << bits[axis]).contains(&from_base) {
            return None;
        }
        key = key << bits[axis] | from_base as u64;
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

    /// The naive twin looks at every cell.
    #[test]
    fn a_box_holds_the_cells_that_lie_in_it() {
        let cells: Vec<CellIndex> = (0..900)
            .map(|i| [0, 1, 2].map(|axis| (spread(3 * i + axis) % 23) as i32 - 11))
            .collect();
        let (occupied, order) = OccupiedCells::sort(&cells, |&cell| cell);
        for k in 0..200 {
            let corner = |salt: u64| {
                [0, 1, 2].map(|axis| (spread(1000 * salt + 3 * k + axis) % 29) as i32 - 14)
            };
            let (low, size) = (corner(1), corner(2));
            let high = [0, 1, 2].map(|axis| low[axis] + size[axis].abs());
            let mut found = Vec::new();
            let _ = occupied.visit_box(low, high, |cell| {
                let points = occupied.points_of(cell);
                found.extend(order[points].iter().map(|&i| i as usize));
                ControlFlow::<()>::Continue(())
            });
            found.sort_unstable();
            let truth: Vec<usize> = (0..cells.len())
                .filter(|&i| (0..3).all(|a| (low[a]..=high[a]).contains(&cells[i][a])))
                .collect();
            assert_eq!(found, truth);
        }
        for (i, &cell) in cells.iter().enumerate() {
            let mut range = occupied.range(cell);
            assert!(range.any(|place| order[place] as usize == i));
        }
        assert!(occupied.range([100, 0, 0]).is_empty());
    }
}
