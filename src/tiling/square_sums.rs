//! Sums of counts over rectangles of squares.
//!
//! Prefix sums along every column and every row that has squares: a rectangle costs two binary searches for
//! each line that it touches, along the axis where these are fewer, and empty land costs nothing.

use std::ops::Range;

use rayon::prelude::*;

use crate::geometry::Rect;

/// Numbers by counting square, as prefix sums along columns and rows. Squares are given by their index: the
/// south-west corner in units of squares, eastwards and northwards.
pub(super) struct SquareSums {
    /// Edge of a square in stored units.
    edge: i64,
    /// All columns, and all rows, that have squares.
    lines: [Lines; 2],
}

/// The columns, or the rows, that have squares.
struct Lines {
    /// For each line its index, and the end of its part of `prefix_sums`.
    ends: Vec<(i64, usize)>,
    /// Line by line the index of each square along it, with the sum of the line up to and with that square.
    prefix_sums: Vec<(i64, u64)>,
}

impl Lines {
    fn new(mut squares: Vec<([i64; 2], u64)>, axis: usize) -> Self {
        squares.par_sort_unstable_by_key(|(index, _)| [index[axis], index[1 - axis]]);
        let mut ends: Vec<(i64, usize)> = Vec::new();
        let (mut prefix_sums, mut sum) = (Vec::with_capacity(squares.len()), 0);
        for (index, count) in &squares {
            if ends.last().is_none_or(|last| last.0 != index[axis]) {
                ends.push((index[axis], 0));
                sum = 0;
            }
            sum += count;
            prefix_sums.push((index[1 - axis], sum));
            if let Some(last) = ends.last_mut() {
                last.1 = prefix_sums.len();
            }
        }
        Self { ends, prefix_sums }
    }

    fn index(&self, line: usize) -> i64 {
        self.ends[line].0
    }

    fn prefix_sums(&self, line: usize) -> &[(i64, u64)] {
        let start = if line == 0 { 0 } else { self.ends[line - 1].1 };
        &self.prefix_sums[start..self.ends[line].1]
    }
}

/// The sum over the squares with indices from `low` to `high`, both included, of one line of `prefix_sums`.
pub(super) fn sum_between(prefix_sums: &[(i64, u64)], [low, high]: [i64; 2]) -> u64 {
    let up_to = |index: i64| match prefix_sums.partition_point(|s| s.0 <= index) {
        0 => 0,
        n => prefix_sums[n - 1].1,
    };
    up_to(high) - up_to(low - 1)
}

impl SquareSums {
    /// Sums of `squares`, each with its index and its number, of `edge` stored units.
    pub(super) fn new(squares: impl Iterator<Item = ([i64; 2], u64)>, edge: i64) -> Self {
        let squares: Vec<([i64; 2], u64)> = squares.collect();
        let same = squares.clone();
        let (columns, rows) = rayon::join(|| Lines::new(squares, 0), || Lines::new(same, 1));
        Self {
            edge,
            lines: [columns, rows],
        }
    }

    /// Edge of a square in stored units.
    pub(super) fn edge(&self) -> i64 {
        self.edge
    }

    /// The smallest rectangle of whole squares around all squares; `None` if there is none.
    pub(super) fn bounds(&self) -> Option<Rect> {
        let ends = [0, 1].map(|axis| {
            let ends = &self.lines[axis].ends;
            Some((ends.first()?.0, ends.last()?.0 + 1))
        });
        let [(west, east), (south, north)] = [ends[0]?, ends[1]?];
        Some(Rect {
            min: [west, south].map(|c| c * self.edge),
            max: [east, north].map(|c| c * self.edge),
        })
    }

    /// `rect` dilated by whole squares, by `margin` (stored units) at least.
    pub(super) fn dilated(&self, rect: Rect, margin: i64) -> Rect {
        rect.grown((margin + self.edge - 1) / self.edge * self.edge)
    }

    /// The first and the last index of the squares that the half-open range of stored coordinates from
    /// `from` to `to` touches.
    pub(super) fn touched(&self, from: i64, to: i64) -> [i64; 2] {
        [from, to - 1].map(|c| c.div_euclid(self.edge))
    }

    /// The columns that `rect` touches or, for axis 1, the rows, by their position in `lines`.
    fn touched_lines(&self, rect: &Rect, axis: usize) -> Range<usize> {
        let [low, high] = self.touched(rect.min[axis], rect.max[axis]);
        let ends = &self.lines[axis].ends;
        let first = ends.partition_point(|(index, _)| *index < low);
        first..ends.partition_point(|(index, _)| *index <= high).max(first)
    }

    /// The axis along which `rect` touches fewer lines, those lines, and the first and the last index of the
    /// squares that it touches across them.
    fn shorter_axis_span(&self, rect: &Rect) -> (usize, Range<usize>, [i64; 2]) {
        let [columns, rows] = [0, 1].map(|axis| self.touched_lines(rect, axis));
        let (axis, lines) = match rows.len() < columns.len() {
            true => (1, rows),
            false => (0, columns),
        };
        let across = self.touched(rect.min[1 - axis], rect.max[1 - axis]);
        (axis, lines, across)
    }

    /// The sum over the squares that `rect` touches.
    pub(super) fn touching(&self, rect: &Rect) -> u64 {
        let (axis, lines, across) = self.shorter_axis_span(rect);
        lines
            .map(|line| sum_between(self.lines[axis].prefix_sums(line), across))
            .sum()
    }

    /// Prefix sums of the columns that `rect` touches or, for axis 1, of the rows, over the squares that it
    /// touches.
    pub(super) fn profile(&self, rect: &Rect, axis: usize) -> Vec<(i64, u64)> {
        let rect = self.shrunk(rect);
        let across = self.touched(rect.min[1 - axis], rect.max[1 - axis]);
        let lines = &self.lines[axis];
        let mut sum = 0;
        self.touched_lines(&rect, axis)
            .map(|line| {
                sum += sum_between(lines.prefix_sums(line), across);
                (lines.index(line), sum)
            })
            .collect()
    }

    /// `rect` without the empty parts before and behind its squares: a tile of a street that runs at an
    /// angle may be a few squares wide and thousands long.
    fn shrunk(&self, rect: &Rect) -> Rect {
        let (axis, lines, [low, high]) = self.shorter_axis_span(rect);
        let ends = lines.filter_map(|line| {
            let squares = self.lines[axis].prefix_sums(line);
            let first = squares.partition_point(|s| s.0 < low);
            let end = squares.partition_point(|s| s.0 <= high);
            (first < end).then(|| [squares[first].0, squares[end - 1].0])
        });
        let ends = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let mut shrunk = *rect;
        if let Some([first, last]) = ends {
            shrunk.min[1 - axis] = rect.min[1 - axis].max(first * self.edge);
            shrunk.max[1 - axis] = rect.max[1 - axis].min((last + 1) * self.edge);
        }
        shrunk
    }
}

#[cfg(test)]
pub(super) mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Sums of `squares`, those of equal index added.
    pub(in crate::tiling) fn counts(squares: &[([i64; 2], u64)], square: i64) -> SquareSums {
        let mut merged = std::collections::BTreeMap::new();
        for &(index, count) in squares {
            *merged.entry(index).or_insert(0) += count;
        }
        SquareSums::new(merged.into_iter(), square)
    }

    proptest! {
        #[test]
        fn counts_match_a_sum_over_all_squares(
            squares in prop::collection::vec(((-20i64..20, -20i64..20), 1u64..100), 1..100),
            west in -300i64..300, south in -300i64..300, width in 1i64..300, height in 1i64..300,
        ) {
            let squares: Vec<_> = squares.into_iter().map(|((x, y), n)| ([x, y], n)).collect();
            let rect = Rect { min: [west, south], max: [west + width, south + height] };
            let truth: u64 = squares
                .iter()
                .filter(|([x, y], _)| {
                    let square = Rect { min: [x * 10, y * 10], max: [x * 10 + 10, y * 10 + 10] };
                    square.intersects(&rect)
                })
                .map(|s| s.1)
                .sum();
            let counts = counts(&squares, 10);
            prop_assert_eq!(counts.touching(&rect), truth);
            for axis in 0..2 {
                let along = counts.touched(rect.min[axis], rect.max[axis]);
                let wide = Rect {
                    min: std::array::from_fn(|a| rect.min[a] - if a == axis { 95 } else { 0 }),
                    max: std::array::from_fn(|a| rect.max[a] + if a == axis { 95 } else { 0 }),
                };
                prop_assert_eq!(sum_between(&counts.profile(&wide, axis), along), truth);
            }
        }
    }
}
