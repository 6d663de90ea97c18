//! The occupied cells of a cubic grid, and their points.
//!
//! Points are sorted by cell; an occupied cell is a range of them. Cells come in bricks of
//! 4 × 4 × 4, and one word a brick says which of its cells are occupied:
//!
//! ```text
//!   brick (hash table) ─► word of 64 bits ─► rank of the bit ─► range of points
//! ```
//!
//! A surface fills few of the cells that a box of space touches. The word finds
//! them without a test of the others.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use super::{
    Stored,
    brick_table::BrickTable,
    cell_index::{BRICK_SHIFT, CELL_BITS, CELL_MASK, CellIndex, bit_of, bits},
    packing::Packing,
    word_sorting::sort_words,
};

/// Ranges of points, sorted by cell: brick by brick (z, y, x), and in a brick
/// by z, y, x again.
#[derive(Debug, Clone)]
pub(crate) struct OccupiedCells {
    /// The index of the first brick on each axis.
    base: CellIndex,
    /// The index of the last brick on each axis.
    top: CellIndex,
    bricks: Vec<Brick>,
    /// Points `starts[k]..starts[k + 1]` lie in the k-th occupied cell.
    starts: Vec<u32>,
    table: BrickTable,
}

#[derive(Debug, Clone, Copy)]
struct Brick {
    /// The index of the brick: whole bricks from the local origin.
    index: CellIndex,
    /// Bit x + 4 y + 16 z says whether the cell (x, y, z) is occupied.
    occupied: u64,
    /// Number of occupied cells in the bricks before this one.
    first: u32,
}

impl OccupiedCells {
    /// Sorts `points` by the cell that `cell_of` gives; the second part of the result is, in
    /// sorted order, the index of each point in the input. Within a cell the order of the input
    /// stays.
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
            table: BrickTable::default(),
        };
        let packing = Packing::of(base, top);
        // Points are sorted several times as fast by one word each, if there is room for the cell
        // and the index.
        let index_bits = u32::BITS - count.leading_zeros();
        let order = if packing.cell_bits() + index_bits <= u64::BITS {
            let word = |(point, index): (&P, u32)| {
                (packing.cell(cell_of(point)) as u64) << index_bits | u64::from(index)
            };
            let mut words: Vec<u64> = points.par_iter().zip(0..count).map(word).collect();
            sort_words(&mut words);
            let cells = words.iter().map(|word| u128::from(word >> index_bits));
            occupied.group(cells, &packing);
            let mask = (1 << index_bits) - 1;
            words.par_iter().map(|word| (word & mask) as u32).collect()
        } else {
            let pair = |(point, index): (&P, u32)| (packing.cell(cell_of(point)), index);
            let mut pairs: Vec<(u128, u32)> = points.par_iter().zip(0..count).map(pair).collect();
            pairs.par_sort_unstable();
            occupied.group(pairs.iter().map(|&(cell, _)| cell), &packing);
            pairs.into_iter().map(|(_, index)| index).collect()
        };
        (occupied, order)
    }

    /// Sorts `points` by the cell that `cell_of` gives, and within a cell by their coordinates,
    /// whatever the order of the input.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points.
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
        self.table = BrickTable::new(bricks.iter().map(|brick| brick.index));
    }

    /// Changes the numbers of points in the occupied cells to `counts`, all of which are positive.
    pub(crate) fn set_counts(&mut self, counts: &[u32]) {
        let mut end = 0;
        for (start, count) in self.starts[1..].iter_mut().zip(counts) {
            end += count;
            *start = end;
        }
    }

    /// Moves the ranges of points behind as many as `points` others.
    pub(super) fn shift(&mut self, points: u32) {
        self.starts.iter_mut().for_each(|start| *start += points);
    }

    /// Number of occupied cells.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of occupied cells of the grid whose cells are twice as wide.
    pub(crate) fn doubled_len(&self) -> usize {
        /// The cells of a brick of which all indices are even.
        const EVEN: u64 = 0x0000_0505_0000_0505;
        let doubled = |brick: &Brick| {
            let along_x = brick.occupied | brick.occupied >> 1;
            let along_y = along_x | along_x >> 4;
            let along_z = along_y | along_y >> 16;
            (along_z & EVEN).count_ones() as usize
        };
        self.bricks.iter().map(doubled).sum()
    }

    /// The ranges of points of the occupied cells, in their order.
    pub(crate) fn ranges(&self) -> impl ExactSizeIterator<Item = Range<usize>> + '_ {
        self.starts.windows(2).map(|w| w[0] as usize..w[1] as usize)
    }

    /// The `points`, which are sorted by cell, in parts: those of each occupied cell.
    pub(crate) fn split<'a, P>(&self, mut points: &'a mut [P]) -> Vec<&'a mut [P]> {
        let mut parts = Vec::with_capacity(self.len());
        for range in self.ranges() {
            let (part, rest) = points.split_at_mut(range.len());
            parts.push(part);
            points = rest;
        }
        parts
    }

    /// The range of points in the cell `index`; empty if there are none.
    pub(crate) fn range(&self, index: CellIndex) -> Range<usize> {
        self.index_of(index)
            .map_or(0..0, |index| self.points_of(index))
    }

    /// The index of the cell `cell` among the occupied ones, if it is one.
    pub(crate) fn index_of(&self, cell: CellIndex) -> Option<usize> {
        let brick = self.bricks[self.find_brick(cell.map(|c| c >> BRICK_SHIFT))?];
        let bit = 1 << bit_of(cell);
        (brick.occupied & bit != 0).then(|| brick.index_of(bit))
    }

    /// Calls `visit` with the index of every occupied cell from `low` to `high`,
    /// both included, in their order, until it breaks.
    pub(crate) fn visit_box<B>(
        &self,
        low: CellIndex,
        high: CellIndex,
        mut visit: impl FnMut(usize) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        // The first and the last cell of a brick on one axis that lie in the box.
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
                    let entry = match next {
                        Some(entry) => Some(entry).filter(|&entry| self.is_at(entry, [x, y, z])),
                        None => self.find_brick([x, y, z]),
                    };
                    let Some(entry) = entry else {
                        continue;
                    };
                    next = Some(entry + 1);
                    let brick = &self.bricks[entry];
                    let cells = rows & (bits(part(0, x), 1) * 0x1111_1111_1111_1111);
                    let mut left = brick.occupied & cells;
                    // Occupied cells that are not yet counted, and the number of those that are:
                    // most cells of a box follow one another.
                    let (mut rest, mut index) = (brick.occupied, brick.first as usize);
                    while left != 0 {
                        let bit = left & left.wrapping_neg();
                        left ^= bit;
                        let between = rest & (bit - 1);
                        if between != 0 {
                            index += between.count_ones() as usize;
                        }
                        rest ^= between | bit;
                        visit(index)?;
                        index += 1;
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// The range of points in the occupied cell with this `index`.
    pub(crate) fn points_of(&self, index: usize) -> Range<usize> {
        self.starts[index] as usize..self.starts[index + 1] as usize
    }

    /// Whether `bricks[entry]` exists and has the index `index`.
    fn is_at(&self, entry: usize, index: CellIndex) -> bool {
        self.bricks
            .get(entry)
            .is_some_and(|brick| brick.index == index)
    }

    /// The index in `bricks` of the brick with the index `index`, if it has points.
    fn find_brick(&self, index: CellIndex) -> Option<usize> {
        self.table
            .find(index, |entry| self.bricks[entry].index == index)
    }
}

impl Brick {
    /// The index of the cell with this one `bit` among the occupied cells.
    fn index_of(&self, bit: u64) -> usize {
        self.first as usize + (self.occupied & (bit - 1)).count_ones() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// The slow twin tests every cell.
    #[test]
    fn a_box_contains_the_cells_that_lie_in_it() {
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
            assert!(range.any(|index| order[index] as usize == i));
        }
        assert!(occupied.range([100, 0, 0]).is_empty());
    }

    #[test]
    fn cells_twice_as_wide_are_counted_as_if_the_points_were_sorted_into_them() {
        let doubled = |cell: &CellIndex| cell.map(|c| c.div_euclid(2));
        for count in [0, 1, 40, 900] {
            let cells: Vec<CellIndex> = (0..count)
                .map(|i| [0, 1, 2].map(|axis| (spread(3 * i + axis) % 13) as i32 - 6))
                .collect();
            let (occupied, _) = OccupiedCells::sort(&cells, |&cell| cell);
            let (wider, _) = OccupiedCells::sort(&cells, doubled);
            assert_eq!(occupied.doubled_len(), wider.len());
        }
    }

    /// Stray returns or damage scatter cells too far apart for one word.
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
