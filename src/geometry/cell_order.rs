//! The order of a few points by cell, for one thread.

use std::ops::Range;

use super::cell_index::CellIndex;

/// Indices of items sorted by cell. [`OccupiedCells`](super::OccupiedCells) sorts many points by all
/// threads, and finds cells again; this serves the points of one cell of a spill.
pub(crate) struct CellOrder {
    /// The indices, those of a cell next to each other in ascending order.
    order: Vec<u32>,
    /// The range of `order` for each cell.
    cells: Vec<Range<usize>>,
}

impl CellOrder {
    /// Sorts the items whose cells are `cells`.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² items.
    pub(crate) fn new(cells: &[CellIndex]) -> Self {
        let count = u32::try_from(cells.len()).expect("a part has under 2^32 points");
        let axis = |axis: usize| cells.iter().map(move |cell| i64::from(cell[axis]));
        let low = [0, 1, 2].map(|k| axis(k).min().unwrap_or(0));
        let bits = [0, 1, 2].map(|k| {
            let extent = axis(k).max().unwrap_or(0) - low[k];
            u64::BITS - (extent as u64).leading_zeros()
        });
        let index_bits = u32::BITS - count.leading_zeros();
        // One word each is sorted several times as fast, if it has room for cell and index.
        let order: Vec<u32> = if bits.iter().sum::<u32>() + index_bits <= u64::BITS {
            let word = |(cell, index): (&CellIndex, u32)| {
                let packed = (0..3).fold(0, |packed, k| {
                    packed << bits[k] | (i64::from(cell[k]) - low[k]) as u64
                });
                packed << index_bits | u64::from(index)
            };
            let mut words: Vec<u64> = cells.iter().zip(0..count).map(word).collect();
            words.sort_unstable();
            let mask = (1_u64 << index_bits) - 1;
            words.into_iter().map(|word| (word & mask) as u32).collect()
        } else {
            let mut order: Vec<u32> = (0..count).collect();
            order.sort_unstable_by_key(|&index| (cells[index as usize], index));
            order
        };
        let mut ranges: Vec<Range<usize>> = Vec::new();
        for (at, &index) in order.iter().enumerate() {
            let cell = cells[index as usize];
            match ranges.last_mut() {
                Some(range) if cells[order[range.start] as usize] == cell => range.end = at + 1,
                _ => ranges.push(at..at + 1),
            }
        }
        Self {
            order,
            cells: ranges,
        }
    }

    /// The indices of the items of each cell, in ascending order.
    pub(crate) fn cells(&self) -> impl Iterator<Item = &[u32]> {
        self.cells.iter().map(|range| &self.order[range.clone()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    #[test]
    fn items_of_a_cell_stand_together_in_their_order() {
        for wide in [5, i32::MAX] {
            let c = |k: u64| (spread(k) % 5) as i32 * (wide / 5) - wide / 2;
            let cells: Vec<CellIndex> = (0..900)
                .map(|i| [c(3 * i), c(3 * i + 1), c(3 * i + 2)])
                .collect();
            let order = CellOrder::new(&cells);
            let mut seen = std::collections::HashSet::new();
            let mut count = 0;
            for items in order.cells() {
                let cell = cells[items[0] as usize];
                assert!(seen.insert(cell));
                assert!(items.iter().all(|&item| cells[item as usize] == cell));
                assert!(items.is_sorted());
                count += items.len();
            }
            assert_eq!(count, 900);
        }
        assert_eq!(CellOrder::new(&[]).cells().count(), 0);
    }
}
