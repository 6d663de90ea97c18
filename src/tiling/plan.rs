//! Tiles that fit the budget, from true counts.
//!
//! The plane is cut in two, again and again, along the borders of counting
//! squares, until what a tile sees (core and halo) costs no more than it may. A
//! long street so becomes a row of tiles, a dense junction several small ones. Cuts
//! that make neighbours see the same places twice are costly: of the cuts tried the
//! one that leads to the fewest tiles is taken, and of those the one that makes least be
//! seen, evenly shared.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::geometry::Rect;

/// Cuts tried along each axis.
const CUTS: i64 = 15;
/// A part with less than this share of the cost is a sliver: nearly all that
/// it reads and solves is its neighbours'.
const SLIVER: u64 = 4;

/// What tiles must fit. Lengths are stored units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanOptions {
    /// What a tile sees around its core.
    pub(crate) halo: i64,
    /// Every place this near to a point must be at home in a tile.
    pub(crate) margin: i64,
    /// Edge of square tiles; `None`: by the number of points.
    pub(crate) tile_edge: Option<i64>,
    /// What a tile may cost, in the unit of the squares' costs.
    pub(crate) most_cost: u64,
}

/// An occupied counting square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Square {
    /// Its south-west corner, in units of squares.
    pub(crate) place: [i64; 2],
    /// Points in it.
    pub(crate) points: u64,
    /// What it costs a tile to see it.
    pub(crate) cost: u64,
}

/// A part of the plane that is solved alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Tile {
    /// Its place in the plan.
    pub(crate) id: u32,
    /// What is at home in it (stored units).
    pub(crate) core: Rect,
    /// Points in the core.
    pub(crate) points_core: u64,
    /// Points in core and halo, at most.
    pub(crate) points_seen: u64,
    /// What core and halo cost, at most.
    pub(crate) cost: u64,
}

/// All tiles of a job: every point is at home in exactly one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Plan {
    /// What a tile sees around its core (stored units).
    pub(crate) halo: i64,
    /// The tiles, neighbours in the plane near each other in the list.
    pub(crate) tiles: Vec<Tile>,
}

impl Plan {
    /// Plans tiles over the occupied `squares`, each of edge `square` (stored units).
    ///
    /// A tile of a single square is taken whatever it costs, and so is one of a fixed
    /// size: whether they fit is to be seen by [`most_cost`](Self::most_cost).
    pub(crate) fn make(squares: &[Square], square: i64, options: &PlanOptions) -> Self {
        let points = Sums::new(squares.iter().map(|s| (s.place, s.points)), square);
        let costs = Sums::new(squares.iter().map(|s| (s.place, s.cost)), square);
        let mut cores = Vec::new();
        if let Some(bounds) = points.bounds() {
            match options.tile_edge {
                Some(edge) => cores = equal_tiles(&points, bounds, options, edge),
                None => {
                    let bounds = points.grown(bounds, options.margin);
                    split(&points, &costs, bounds, options, &mut cores);
                }
            }
        }
        let tiles = (0..)
            .zip(cores)
            .map(|(id, core)| Tile {
                id,
                core,
                points_core: points.touching(&core),
                points_seen: points.touching(&core.grown(options.halo)),
                cost: costs.touching(&core.grown(options.halo)),
            })
            .collect();
        Self {
            halo: options.halo,
            tiles,
        }
    }

    /// Plans tiles over the occupied squares `counts`, each of edge `square` (stored units), where the cost of
    /// a tile is the number of points that it sees.
    pub(crate) fn by_points(
        counts: impl Iterator<Item = ([i64; 2], u64)>,
        square: i64,
        options: &PlanOptions,
    ) -> Self {
        let squares: Vec<Square> = counts
            .map(|(place, points)| Square {
                place,
                points,
                cost: points,
            })
            .collect();
        Self::make(&squares, square, options)
    }

    /// What the costliest tile costs.
    pub(crate) fn most_cost(&self) -> u64 {
        self.tiles.iter().map(|t| t.cost).max().unwrap_or(0)
    }
}

/// Numbers by counting square: columns and rows of running sums, so that a rectangle costs
/// two searches a line and an empty city block nothing.
struct Sums {
    square: i64,
    /// The columns, and the rows.
    lines: [Lines; 2],
}

/// All columns or all rows that hold squares.
struct Lines {
    /// The place of each, and where its squares end in `squares`.
    ends: Vec<(i64, usize)>,
    /// Line by line the places of the squares along it, each with the sum up to it.
    squares: Vec<(i64, u64)>,
}

impl Lines {
    fn place(&self, line: usize) -> i64 {
        self.ends[line].0
    }

    fn squares(&self, line: usize) -> &[(i64, u64)] {
        let start = if line == 0 { 0 } else { self.ends[line - 1].1 };
        &self.squares[start..self.ends[line].1]
    }
}

/// The sum from one place to another, both included, by sums up to places in their order.
fn between(sums: &[(i64, u64)], [low, high]: [i64; 2]) -> u64 {
    let up_to = |place: i64| match sums.partition_point(|s| s.0 <= place) {
        0 => 0,
        n => sums[n - 1].1,
    };
    up_to(high) - up_to(low - 1)
}

impl Sums {
    fn new(squares: impl Iterator<Item = ([i64; 2], u64)>, square: i64) -> Self {
        let mut squares: Vec<([i64; 2], u64)> = squares.collect();
        let lines = [0, 1].map(|axis| {
            squares.sort_unstable_by_key(|(place, _)| [place[axis], place[1 - axis]]);
            let mut ends: Vec<(i64, usize)> = Vec::new();
            let (mut sums, mut sum) = (Vec::with_capacity(squares.len()), 0);
            for (place, count) in &squares {
                if ends.last().is_none_or(|last| last.0 != place[axis]) {
                    ends.push((place[axis], 0));
                    sum = 0;
                }
                sum += count;
                sums.push((place[1 - axis], sum));
                if let Some(last) = ends.last_mut() {
                    last.1 = sums.len();
                }
            }
            Lines {
                ends,
                squares: sums,
            }
        });
        Self { square, lines }
    }

    /// The smallest rectangle of whole squares around all points.
    fn bounds(&self) -> Option<Rect> {
        let ends = [0, 1].map(|axis| {
            let ends = &self.lines[axis].ends;
            Some((ends.first()?.0, ends.last()?.0 + 1))
        });
        let [(west, east), (south, north)] = [ends[0]?, ends[1]?];
        Some(Rect {
            min: [west, south].map(|c| c * self.square),
            max: [east, north].map(|c| c * self.square),
        })
    }

    /// `rect` and the whole squares within `margin` around it.
    fn grown(&self, rect: Rect, margin: i64) -> Rect {
        rect.grown((margin + self.square - 1) / self.square * self.square)
    }

    /// The first and the last square that stored coordinates from `from` on touch that are less
    /// than `to`.
    fn touched(&self, from: i64, to: i64) -> [i64; 2] {
        [from, to - 1].map(|c| c.div_euclid(self.square))
    }

    /// The columns that `rect` touches or, for axis 1, the rows.
    fn touched_lines(&self, rect: &Rect, axis: usize) -> Range<usize> {
        let [low, high] = self.touched(rect.min[axis], rect.max[axis]);
        let ends = &self.lines[axis].ends;
        let first = ends.partition_point(|(place, _)| *place < low);
        first..ends.partition_point(|(place, _)| *place <= high).max(first)
    }

    /// The same, and the first and the last square of each that `rect` touches, for the axis
    /// along which it touches fewer.
    fn fewest_lines(&self, rect: &Rect) -> (usize, Range<usize>, [i64; 2]) {
        let [columns, rows] = [0, 1].map(|axis| self.touched_lines(rect, axis));
        let (axis, lines) = match rows.len() < columns.len() {
            true => (1, rows),
            false => (0, columns),
        };
        let across = self.touched(rect.min[1 - axis], rect.max[1 - axis]);
        (axis, lines, across)
    }

    /// The sum over the squares that `rect` touches.
    fn touching(&self, rect: &Rect) -> u64 {
        let (axis, lines, across) = self.fewest_lines(rect);
        lines
            .map(|line| between(self.lines[axis].squares(line), across))
            .sum()
    }

    /// Sums up to the columns that `rect` touches or, for axis 1, the rows, over the squares
    /// that it touches.
    fn profile(&self, rect: &Rect, axis: usize) -> Vec<(i64, u64)> {
        let rect = self.shrunk(rect);
        let across = self.touched(rect.min[1 - axis], rect.max[1 - axis]);
        let lines = &self.lines[axis];
        let mut sum = 0;
        self.touched_lines(&rect, axis)
            .map(|line| {
                sum += between(lines.squares(line), across);
                (lines.place(line), sum)
            })
            .collect()
    }

    /// `rect` without what is empty before and behind its squares: a tile of a street that
    /// runs at an angle may be a few squares wide and thousands long.
    fn shrunk(&self, rect: &Rect) -> Rect {
        let (axis, lines, [low, high]) = self.fewest_lines(rect);
        let ends = lines.filter_map(|line| {
            let squares = self.lines[axis].squares(line);
            let first = squares.partition_point(|s| s.0 < low);
            let end = squares.partition_point(|s| s.0 <= high);
            (first < end).then(|| [squares[first].0, squares[end - 1].0])
        });
        let ends = ends.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
        let mut shrunk = *rect;
        if let Some([first, last]) = ends {
            shrunk.min[1 - axis] = rect.min[1 - axis].max(first * self.square);
            shrunk.max[1 - axis] = rect.max[1 - axis].min((last + 1) * self.square);
        }
        shrunk
    }
}

fn equal_tiles(counts: &Sums, bounds: Rect, options: &PlanOptions, edge: i64) -> Vec<Rect> {
    let bounds = counts.grown(bounds, options.margin);
    let is_wanted = |rect: &Rect| counts.touching(&rect.grown(options.margin)) > 0;
    // Whole counting squares, so that counts are exact; anchored at the origin,
    // so that the tiling does not depend on the extent.
    let edge = (edge + counts.square - 1) / counts.square * counts.square;
    let first = bounds.min.map(|c| c.div_euclid(edge));
    let last = bounds.max.map(|c| (c - 1).div_euclid(edge));
    let mut cores = Vec::new();
    for row in first[1]..=last[1] {
        let strip = Rect {
            min: [bounds.min[0], row * edge],
            max: [bounds.max[0], (row + 1) * edge],
        };
        if !is_wanted(&strip) {
            continue;
        }
        for column in first[0]..=last[0] {
            let core = Rect {
                min: [column * edge, row * edge],
                max: [(column + 1) * edge, (row + 1) * edge],
            };
            if is_wanted(&core) {
                cores.push(core);
            }
        }
    }
    cores
}

fn split(points: &Sums, costs: &Sums, core: Rect, options: &PlanOptions, cores: &mut Vec<Rect>) {
    if points.touching(&core.grown(options.margin)) == 0 {
        return;
    }
    let fits = costs.touching(&core.grown(options.halo)) <= options.most_cost;
    let cut = if fits {
        None
    } else {
        best_cut(costs, core, options)
    };
    match cut {
        Some(parts) => {
            for part in parts {
                split(points, costs, part, options, cores);
            }
        }
        None => cores.push(core),
    }
}

/// Of cuts along both axes the one that leads to the fewest tiles, and whose parts cost
/// least, evenly, and neither of which is a sliver if that can be; none of a single square.
fn best_cut(costs: &Sums, core: Rect, options: &PlanOptions) -> Option<[Rect; 2]> {
    let halo = options.halo;
    let mut best: Option<((bool, u64, u64), [Rect; 2])> = None;
    let sliver = costs.touching(&core) / SLIVER;
    let whole = costs.touching(&core.grown(halo));
    for axis in 0..2 {
        // Parts and what they see differ along this axis alone.
        let own = costs.profile(&core, axis);
        let seen = costs.profile(&core.grown(halo), axis);
        let squares = (core.max[axis] - core.min[axis]) / costs.square;
        let cuts = CUTS.min(squares - 1);
        for cut in 1..=cuts {
            let at = core.min[axis] + squares * cut / (cuts + 1) * costs.square;
            if at <= core.min[axis] || at >= core.max[axis] {
                continue;
            }
            let mut parts = [core; 2];
            parts[0].max[axis] = at;
            parts[1].min[axis] = at;
            let within = |part: Rect, margin| {
                costs.touched(part.min[axis] - margin, part.max[axis] + margin)
            };
            let costs_of = parts.map(|part| between(&own, within(part, 0)));
            let is_sliver = costs_of.iter().any(|&cost| cost < sliver);
            let [near, far] = [0, 1].map(|side| match costs_of[side] {
                0 => 0,
                _ => between(&seen, within(parts[side], halo)),
            });
            let twice = (near + far).saturating_sub(whole);
            let tiles = [near, far].map(|seen| tiles_of(seen, twice, options.most_cost));
            let cost = (
                is_sliver,
                tiles[0] + tiles[1],
                near + far + near.abs_diff(far) / 2,
            );
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, parts));
            }
        }
    }
    best.map(|(_, parts)| parts)
}

/// Tiles, about, that a part is cut into which costs `seen`, where each cut makes `twice` be
/// seen by both sides.
fn tiles_of(seen: u64, twice: u64, most: u64) -> u64 {
    // Where halos are all that is seen, cuts hardly help, and all are alike.
    let twice = twice.min(most / 2);
    seen.saturating_sub(twice)
        .div_ceil((most - twice).max(1))
        .max(1)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn counts(squares: &[([i64; 2], u64)], square: i64) -> Sums {
        let mut merged = std::collections::BTreeMap::new();
        for &(place, count) in squares {
            *merged.entry(place).or_insert(0) += count;
        }
        Sums::new(merged.into_iter(), square)
    }

    const MARGIN: i64 = 7;

    fn options(halo: i64, most_cost: u64) -> PlanOptions {
        PlanOptions {
            halo,
            margin: MARGIN,
            tile_edge: None,
            most_cost,
        }
    }

    proptest! {
        #[test]
        fn every_square_is_at_home_in_one_tile_that_fits(
            squares in prop::collection::vec(((-50i64..50, -50i64..50), 1u64..100), 1..200),
            halo in 0i64..80,
            edge in prop::option::of(1i64..400),
        ) {
            let squares: Vec<_> = squares.into_iter().map(|((x, y), n)| ([x, y], n)).collect();
            let counts = counts(&squares, 10);
            let bounds = counts.bounds().unwrap();
            let most = 2000;
            let mut cores = Vec::new();
            match edge {
                Some(edge) => cores = equal_tiles(&counts, bounds, &options(halo, most), edge),
                None => {
                    let bounds = counts.grown(bounds, MARGIN);
                    split(&counts, &counts, bounds, &options(halo, most), &mut cores);
                    for core in &cores {
                        let is_single = (0..2).all(|axis| core.max[axis] - core.min[axis] == 10);
                        prop_assert!(is_single || counts.touching(&core.grown(halo)) <= most);
                    }
                }
            }
            // Nor is there a place near a square without a home.
            for &([x, y], _) in &squares {
                for [dx, dy] in [[-MARGIN, 0], [MARGIN, 0], [0, -MARGIN], [0, MARGIN]] {
                    let corner = [x * 10 + dx, y * 10 + dy];
                    let place = Rect { min: corner, max: corner.map(|c| c + 1) };
                    prop_assert_eq!(cores.iter().filter(|c| c.covers(&place)).count(), 1);
                }
            }
            for &([x, y], _) in &squares {
                let square = Rect { min: [x * 10, y * 10], max: [x * 10 + 10, y * 10 + 10] };
                prop_assert_eq!(cores.iter().filter(|c| c.covers(&square)).count(), 1);
                prop_assert_eq!(cores.iter().filter(|c| c.intersects(&square)).count(), 1);
            }
            let total: u64 = squares.iter().map(|s| s.1).sum();
            let sum: u64 = cores.iter().map(|c| counts.touching(c)).sum();
            prop_assert_eq!(sum, total);
            prop_assert!(cores.iter().all(|c| counts.touching(&c.grown(MARGIN)) > 0));
        }

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
                prop_assert_eq!(between(&counts.profile(&wide, axis), along), truth);
            }
        }
    }

    #[test]
    fn a_square_that_does_not_fit_stands_alone_and_tells_its_cost() {
        let square = |x, cost| Square {
            place: [x, 0],
            points: 1,
            cost,
        };
        let plan = Plan::make(&[square(0, 900), square(1, 5)], 10, &options(3, 500));
        assert!(
            plan.tiles
                .iter()
                .any(|t| t.core.max[0] - t.core.min[0] == 10)
        );
        assert_eq!(plan.most_cost(), 905);
    }

    #[test]
    fn a_long_street_becomes_a_row_of_tiles() {
        let street: Vec<([i64; 2], u64)> = (0..400).map(|x| ([x, x % 2], 10)).collect();
        let counts = counts(&street, 10);
        let mut cores = Vec::new();
        let bounds = counts.bounds().unwrap();
        split(&counts, &counts, bounds, &options(50, 600), &mut cores);
        // Eight could do.
        assert!((8..=9).contains(&cores.len()), "{}", cores.len());
        assert!(cores.iter().all(|c| c.max[1] - c.min[1] == 20));
    }
}
