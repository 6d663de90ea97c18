//! The distinct cells of many points, without the points.

use super::{cell_index::CellIndex, hash::spread};

/// Number of cells that are remembered to be there already.
const REMEMBERED: usize = 256;
/// Number of cells beyond which those that are there twice are looked for.
const LEAST_LIMIT: usize = 1 << 16;

/// Cells, most of them once. Scanners sweep: most points lie in a cell that was added shortly before, so a small table of
/// such cells takes most of the work off the sort.
pub(crate) struct DistinctCells {
    cells: Vec<CellIndex>,
    /// Cells that were added, each at the place of its hash.
    remembered: Vec<Option<CellIndex>>,
    limit: usize,
}

impl Default for DistinctCells {
    fn default() -> Self {
        Self {
            cells: Vec::new(),
            remembered: vec![None; REMEMBERED],
            limit: LEAST_LIMIT,
        }
    }
}

impl DistinctCells {
    /// Adds `cell`.
    #[inline]
    pub(crate) fn add(&mut self, cell: CellIndex) {
        let [x, y, z] = cell.map(|c| u64::from(c as u32));
        let place = spread((x << 32 | y) ^ z.rotate_left(48)) as usize % REMEMBERED;
        if self.remembered[place] != Some(cell) {
            self.remembered[place] = Some(cell);
            self.cells.push(cell);
            self.keep_to_limit();
        }
    }

    /// Adds all cells of `other`.
    pub(crate) fn join(&mut self, other: Self) {
        self.cells.extend(other.cells);
        self.keep_to_limit();
    }

    /// The cells, each once, in order.
    pub(crate) fn into_sorted(mut self) -> Vec<CellIndex> {
        self.sort();
        self.cells
    }

    /// Sorts the cells, and drops what is there twice.
    fn sort(&mut self) {
        self.cells.sort_unstable();
        self.cells.dedup();
    }

    /// Drops what is there twice if the cells are more than the limit, which from then on is at least twice the number
    /// of those that stay.
    fn keep_to_limit(&mut self) {
        if self.cells.len() > self.limit {
            self.sort();
            self.limit = self.limit.max(2 * self.cells.len());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn cells_that_come_again_count_once() {
        for [cells, kinds] in [[1000, 10], [400_000, 90_000], [200_000, 200_000]] {
            let cell = |k: u64| {
                let hash = spread(k % kinds);
                [
                    hash as i32 % 60,
                    (hash >> 16) as i32 % 60,
                    -((hash >> 40) as i32 % 60),
                ]
            };
            let truth: BTreeSet<CellIndex> = (0..cells).map(cell).collect();
            let mut found = DistinctCells::default();
            let mut others = DistinctCells::default();
            (0..cells / 2).for_each(|k| found.add(cell(k)));
            (cells / 2..cells).for_each(|k| others.add(cell(k)));
            found.join(others);
            assert!(found.into_sorted().into_iter().eq(truth));
        }
        assert!(DistinctCells::default().into_sorted().is_empty());
    }
}
