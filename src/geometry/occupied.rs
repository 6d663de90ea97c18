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

use super::{Local, Stored, hash::spread};

/// Where a cell lies: whole cells from the local origin.
pub(crate) type CellIndex = [i32; 3];

/// The cell of edge `edge` that holds `point`.
pub(crate) fn cell_of(point: Local, edge: f64) -> CellIndex {
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
pub(crate) struct OccupiedCells {
    /// The first brick on each axis …
    base: CellIndex,
    /// … and the last.
    top: CellIndex,
    bricks: Vec<Brick>,
    /// Points `starts[k]..starts[k + 1]` lie in the k-th occupied cell.
    starts: Vec<u32>,
    /// Hash table of places in `bricks`.
    table: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct Brick {
    /// Where it lies: whole bricks from the local origin.
    index: CellIndex,
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
    /// Unless there are fewer than 2³² points.
    pub(crate) fn sort<P: Sync>(
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
        let mut occupied = Self {
            base,
            top,
            bricks: Vec::new(),
            starts: Vec::new(),
            table: Vec::new(),
        };
        let packing = Packing::of(base, top);
        // One word to a point, if there is room for its cell and its place, sorts
        // several times as fast.
        let place_bits = u32::BITS - count.leading_zeros();
        let order = if packing.cell_bits() + place_bits <= u64::BITS {
            let word = |(point, place): (&P, u32)| {
                (packing.cell(cell_of(point)) as u64) << place_bits | u64::from(place)
            };
            let mut words: Vec<u64> = points.par_iter().zip(0..count).map(word).collect();
            sort_words(&mut words);
            let cells = words.iter().map(|word| u128::from(word >> place_bits));
            occupied.group(cells, &packing);
            let mask = (1 << place_bits) - 1;
            words.par_iter().map(|word| (word & mask) as u32).collect()
        } else {
            let pair = |(point, place): (&P, u32)| (packing.cell(cell_of(point)), place);
            let mut pairs: Vec<(u128, u32)> = points.par_iter().zip(0..count).map(pair).collect();
            pairs.par_sort_unstable();
            occupied.group(pairs.iter().map(|&(cell, _)| cell), &packing);
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
    pub(crate) fn sort_points(
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

    /// Makes bricks and ranges of the sorted `cells` of points.
    fn group(&mut self, cells: impl Iterator<Item = u128>, packing: &Packing) {
        let (bricks, starts) = (&mut self.bricks, &mut self.starts);
        let (mut last, mut last_brick, mut count) = (None, None, 0_u32);
        for cell in cells {
            let start = count;
            count += 1;
            if last == Some(cell) {
                continue;
            }
            last = Some(cell);
            let brick = cell >> CELL_BITS;
            if last_brick != Some(brick) {
                last_brick = Some(brick);
                bricks.push(Brick {
                    index: packing.brick(brick),
                    occupied: 0,
                    first: starts.len() as u32,
                });
            }
            if let Some(brick) = bricks.last_mut() {
                brick.occupied |= 1 << (cell as u32 & ((1 << CELL_BITS) - 1));
            }
            starts.push(start);
        }
        starts.push(count);
        self.table = hash_table(bricks);
    }

    /// Number of occupied cells.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The ranges of points of the occupied cells, in their order.
    pub(crate) fn ranges(&self) -> impl ExactSizeIterator<Item = Range<usize>> + '_ {
        self.starts.windows(2).map(|w| w[0] as usize..w[1] as usize)
    }

    /// The range of points in the cell `index`; empty if there are none.
    pub(crate) fn range(&self, index: CellIndex) -> Range<usize> {
        self.index_of(index)
            .map_or(0..0, |place| self.points_of(place))
    }

    /// The place of the cell `index` among the occupied ones, if it is one.
    pub(crate) fn index_of(&self, index: CellIndex) -> Option<usize> {
        let brick = self.bricks[self.place_of_brick(index.map(|c| c >> BRICK_SHIFT))?];
        let bit = 1 << bit_of(index);
        (brick.occupied & bit != 0).then(|| brick.place(bit))
    }

    /// Calls `visit` with the place of every occupied cell from `low` to `high`,
    /// both included, in their order, until it breaks.
    pub(crate) fn visit_box<B>(
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
                // Bricks of a row stand side by side: only the first is looked up.
                let mut next = None;
                for x in bricks(0) {
                    let place = match next {
                        Some(place) => Some(place).filter(|&place| self.is_at(place, [x, y, z])),
                        None => self.place_of_brick([x, y, z]),
                    };
                    let Some(place) = place else {
                        continue;
                    };
                    next = Some(place + 1);
                    let brick = &self.bricks[place];
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
    pub(crate) fn points_of(&self, place: usize) -> Range<usize> {
        self.starts[place] as usize..self.starts[place + 1] as usize
    }

    /// Whether the brick at `place`, if there is one, lies at `index`.
    fn is_at(&self, place: usize, index: CellIndex) -> bool {
        self.bricks
            .get(place)
            .is_some_and(|brick| brick.index == index)
    }

    fn place_of_brick(&self, index: CellIndex) -> Option<usize> {
        let mask = self.table.len() - 1;
        let mut slot = hash(index) & mask;
        loop {
            match self.table[slot] {
                EMPTY => return None,
                place if self.bricks[place as usize].index == index => return Some(place as usize),
                _ => slot = (slot + 1) & mask,
            }
        }
    }
}

/// Words that one thread sorts.
const ALONE: usize = 1 << 17;

/// Sorts `words` with all threads, in two thirds of the time that rayon's parallel sort takes:
/// that of the standard library is so much faster.
fn sort_words(words: &mut [u64]) {
    if words.len() <= ALONE {
        words.sort_unstable();
        return;
    }
    let (low, _, high) = words.select_nth_unstable(words.len() / 2);
    rayon::join(|| sort_words(low), || sort_words(high));
}

/// Cells of a box of bricks as integers that sort by brick (z, y, x), then by the place
/// in the brick.
struct Packing {
    base: CellIndex,
    /// Bits of a brick's place on each axis.
    bits: [u32; 3],
}

impl Packing {
    fn of(base: CellIndex, top: CellIndex) -> Self {
        let bits = [0, 1, 2].map(|axis| {
            let last = i64::from(top[axis]) - i64::from(base[axis]);
            (last.max(0) as u64 + 1)
                .next_power_of_two()
                .trailing_zeros()
        });
        Self { base, bits }
    }

    /// Bits that a cell takes: 102 at the most.
    fn cell_bits(&self) -> u32 {
        self.bits.iter().sum::<u32>() + CELL_BITS
    }

    fn cell(&self, index: CellIndex) -> u128 {
        let mut packed = 0;
        for axis in [2, 1, 0] {
            let brick = i64::from(index[axis] >> BRICK_SHIFT) - i64::from(self.base[axis]);
            packed = packed << self.bits[axis] | brick as u128;
        }
        packed << CELL_BITS | u128::from(bit_of(index))
    }

    /// Where the brick lies whose cells begin with `packed`.
    fn brick(&self, mut packed: u128) -> CellIndex {
        [0, 1, 2].map(|axis| {
            let place = packed & ((1 << self.bits[axis]) - 1);
            packed >>= self.bits[axis];
            (i64::from(self.base[axis]) + place as i64) as i32
        })
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
        let mut slot = hash(brick.index) & mask;
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

/// Where to look for a brick in the table.
fn hash([x, y, z]: CellIndex) -> usize {
    let [x, y, z] = [x, y, z].map(|c| u64::from(c as u32));
    // An odd factor keeps layers apart.
    spread((x << 32 | y) ^ z.wrapping_mul(0x9e37_79b9_7f4a_7c15)) as usize
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

    #[test]
    fn words_are_sorted_by_parts_as_at_once() {
        let words = || (0..5 * ALONE as u64).map(|k| spread(k) % 100_003);
        let mut sorted: Vec<u64> = words().collect();
        sort_words(&mut sorted);
        let mut truth: Vec<u64> = words().collect();
        truth.sort();
        assert_eq!(sorted, truth);
    }

    /// As a stray return, or damage, scatters them: too far apart for one word.
    #[test]
    fn cells_at_the_ends_of_the_range_are_found() {
        let ends = [i32::MIN, -1_000_000_007, -1, 0, 77, 2_000_000_011, i32::MAX];
        let cells: Vec<CellIndex> = (0..343_usize)
            .map(|i| [ends[i % 7], ends[i / 7 % 7], ends[i / 49]])
            .collect();
        let (occupied, order) = OccupiedCells::sort(&cells, |&cell| cell);
        assert_eq!(occupied.len(), 343);
        for (i, &cell) in cells.iter().enumerate() {
            let range = occupied.range(cell);
            assert!(
                range.len() == 1 && order[range.start] as usize == i,
                "{cell:?}"
            );
        }
        assert!(occupied.range([1, 1, 1]).is_empty());
        let sorted = order
            .iter()
            .map(|&i| cells[i as usize].map(|c| c >> BRICK_SHIFT));
        let bricks: Vec<[i32; 3]> = sorted.map(|[x, y, z]| [z, y, x]).collect();
        assert!(bricks.is_sorted());
    }
}
