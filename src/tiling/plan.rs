//! Tiles that fit the memory budget, from true counts.
//!
//! The plane is cut in two, recursively, along the borders of counting squares, until the cost of what a
//! tile sees (core and halo) is within a limit. A long street so becomes a row of tiles, a dense junction
//! several small ones. Cuts that make neighbours see the same squares twice are costly: of the cuts that are
//! tried the one is taken that leads to the fewest tiles, and of those the one with the least sum of what
//! both parts see, evenly shared.

use serde::{Deserialize, Serialize};

use super::square_sums::{SquareSums, sum_between};
use crate::geometry::Rect;

/// Cuts that are tried along each axis.
const MAX_CUTS_PER_AXIS: i64 = 15;
/// A part with less than this share (1 / n) of the cost is a sliver: nearly all that it reads and solves is
/// its neighbours'.
const SLIVER_SHARE: u64 = 4;

/// What tiles must fit. Lengths are stored units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanOptions {
    /// Width of what a tile sees around its core.
    pub(crate) halo: i64,
    /// Every position that is this near to a point is at home in a tile.
    pub(crate) margin: i64,
    /// Edge of square tiles; with `None` tiles are cut by their cost.
    pub(crate) tile_edge: Option<i64>,
    /// Limit of the cost of a tile, in the unit of the squares' costs.
    pub(crate) most_cost: u64,
}

/// An occupied counting square.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Square {
    /// The south-west corner in units of squares, eastwards and northwards.
    pub(crate) index: [i64; 2],
    /// Number of points in the square.
    pub(crate) points: u64,
    /// The cost of a tile for seeing the square.
    pub(crate) cost: u64,
}

/// A part of the plane that is solved alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Tile {
    /// The position of the tile in the plan.
    pub(crate) id: u32,
    /// The rectangle whose points are at home in the tile (stored units).
    pub(crate) core: Rect,
    /// Number of points in the core.
    pub(crate) points_core: u64,
    /// Number of points in core and halo, at most.
    pub(crate) points_seen: u64,
    /// Cost of core and halo, at most.
    pub(crate) cost: u64,
}

/// All tiles of a job: every point is at home in exactly one.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Plan {
    /// Width of what a tile sees around its core (stored units).
    pub(crate) halo: i64,
    /// The tiles; neighbours in the plane are near each other in the list.
    pub(crate) tiles: Vec<Tile>,
}

impl Plan {
    /// Plans tiles over the occupied `squares`, each of edge `square` (stored units).
    ///
    /// A tile that no cut makes fit is taken whatever its cost, and so is a tile of a fixed size: the caller
    /// compares [`most_cost`](Self::most_cost) with the limit.
    pub(crate) fn make(squares: &[Square], square: i64, options: &PlanOptions) -> Self {
        let (points, costs) = rayon::join(
            || SquareSums::new(squares.iter().map(|s| (s.index, s.points)), square),
            || SquareSums::new(squares.iter().map(|s| (s.index, s.cost)), square),
        );
        let mut cores = Vec::new();
        if let Some(bounds) = points.bounds() {
            match options.tile_edge {
                Some(edge) => cores = equal_tiles(&points, bounds, options, edge),
                None => {
                    let bounds = points.dilated(bounds, options.margin);
                    split(&points, &costs, bounds, options, &mut cores);
                }
            }
        }
        let tiles = (0..)
            .zip(cores)
            .map(|(id, core)| tile(id, core, &points, &costs, options))
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
            .map(|(index, points)| Square {
                index,
                points,
                cost: points,
            })
            .collect();
        Self::make(&squares, square, options)
    }

    /// The square that costs most with what is within the halo of it, found by halving the plane towards the
    /// side that sees more; `None` if there is no square. If its cost is beyond the limit, so is some tile's,
    /// and there is no need to make the plan to know.
    pub(crate) fn costliest_place(
        squares: &[Square],
        square: i64,
        options: &PlanOptions,
    ) -> Option<Tile> {
        let points = SquareSums::new(squares.iter().map(|s| (s.index, s.points)), square);
        let costs = SquareSums::new(squares.iter().map(|s| (s.index, s.cost)), square);
        let mut core = points.bounds()?;
        loop {
            let sides = [0, 1].map(|axis| (core.max[axis] - core.min[axis]) / square);
            let axis = usize::from(sides[1] > sides[0]);
            if sides[axis] <= 1 {
                break;
            }
            let mut halves = [core; 2];
            halves[0].max[axis] = core.min[axis] + sides[axis] / 2 * square;
            halves[1].min[axis] = halves[0].max[axis];
            let seen = |half: &Rect| {
                let is_occupied = points.touching(half) > 0;
                (is_occupied, costs.touching(&half.grown(options.halo)))
            };
            core = halves[usize::from(seen(&halves[1]) > seen(&halves[0]))];
        }
        Some(tile(0, core, &points, &costs, options))
    }

    /// The cost of the costliest tile.
    pub(crate) fn most_cost(&self) -> u64 {
        self.tiles.iter().map(|t| t.cost).max().unwrap_or(0)
    }
}

/// The tile `core` with its counts.
fn tile(
    id: u32,
    core: Rect,
    points: &SquareSums,
    costs: &SquareSums,
    options: &PlanOptions,
) -> Tile {
    let seen = core.grown(options.halo);
    Tile {
        id,
        core,
        points_core: points.touching(&core),
        points_seen: points.touching(&seen),
        cost: costs.touching(&seen),
    }
}

/// The cores of equal square tiles of `edge` (stored units) that have points within the margin.
fn equal_tiles(counts: &SquareSums, bounds: Rect, options: &PlanOptions, edge: i64) -> Vec<Rect> {
    let bounds = counts.dilated(bounds, options.margin);
    let is_wanted = |rect: &Rect| counts.touching(&rect.grown(options.margin)) > 0;
    // Whole counting squares, so that counts are exact; anchored at the origin,
    // so that the tiling does not depend on the extent.
    let edge = (edge + counts.edge() - 1) / counts.edge() * counts.edge();
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

/// Cuts `core` in two, recursively, until the cost of each part with its halo is within the limit, and appends
/// the parts that have points within the margin to `cores`.
fn split(
    points: &SquareSums,
    costs: &SquareSums,
    core: Rect,
    options: &PlanOptions,
    cores: &mut Vec<Rect>,
) {
    if points.touching(&core.grown(options.margin)) == 0 {
        return;
    }
    let fits = costs.touching(&core.grown(options.halo)) <= options.most_cost;
    let cut = if fits || is_beyond_cuts(costs, core, options) {
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

/// Whether no part of `core` fits, however it is cut: what each of its squares sees within the halo costs too
/// much already. Cuts would go on down to single squares, each of which sees what all the others do.
fn is_beyond_cuts(costs: &SquareSums, core: Rect, options: &PlanOptions) -> bool {
    let reach = costs.edge() + options.halo;
    let seen_by_all = Rect {
        min: core.max.map(|c| c - reach),
        max: core.min.map(|c| c + reach),
    };
    let is_empty = (0..2).any(|axis| seen_by_all.min[axis] >= seen_by_all.max[axis]);
    !is_empty && costs.touching(&seen_by_all) > options.most_cost
}

/// The best cut of `core` along either axis, by three criteria in this order: neither part is a sliver, the
/// parts lead to the fewest tiles, the cost of what both see is least and evenly shared. A single square is
/// not cut.
fn best_cut(costs: &SquareSums, core: Rect, options: &PlanOptions) -> Option<[Rect; 2]> {
    let halo = options.halo;
    let mut best: Option<((bool, u64, u64), [Rect; 2])> = None;
    let sliver = costs.touching(&core) / SLIVER_SHARE;
    let whole = costs.touching(&core.grown(halo));
    for axis in 0..2 {
        // The parts, and what they see, differ along this axis alone.
        let own = costs.profile(&core, axis);
        let seen = costs.profile(&core.grown(halo), axis);
        let squares = (core.max[axis] - core.min[axis]) / costs.edge();
        let cuts = MAX_CUTS_PER_AXIS.min(squares - 1);
        for cut in 1..=cuts {
            let at = core.min[axis] + squares * cut / (cuts + 1) * costs.edge();
            if at <= core.min[axis] || at >= core.max[axis] {
                continue;
            }
            let mut parts = [core; 2];
            parts[0].max[axis] = at;
            parts[1].min[axis] = at;
            let within = |part: Rect, margin| {
                costs.touched(part.min[axis] - margin, part.max[axis] + margin)
            };
            let costs_of = parts.map(|part| sum_between(&own, within(part, 0)));
            let is_sliver = costs_of.iter().any(|&cost| cost < sliver);
            let [near, far] = [0, 1].map(|side| match costs_of[side] {
                0 => 0,
                _ => sum_between(&seen, within(parts[side], halo)),
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

/// Approximate number of tiles that a part of cost `seen` is cut into, where each cut makes both sides see
/// squares of cost `twice`.
fn tiles_of(seen: u64, twice: u64, most: u64) -> u64 {
    // Where a tile sees hardly more than its halo, cuts hardly help, and all are alike.
    let twice = twice.min(most / 2);
    seen.saturating_sub(twice)
        .div_ceil((most - twice).max(1))
        .max(1)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::tiling::square_sums::tests::counts;

    const MARGIN: i64 = 7;

    fn options(halo: i64, most_cost: u64) -> PlanOptions {
        PlanOptions {
            halo,
            margin: MARGIN,
            tile_edge: None,
            most_cost,
        }
    }

    /// The squares of edge 10 that make up `core`.
    fn squares_of(core: &Rect) -> impl Iterator<Item = Rect> {
        let Rect { min, max } = *core;
        let corners = (min[0]..max[0])
            .step_by(10)
            .flat_map(move |x| (min[1]..max[1]).step_by(10).map(move |y| [x, y]));
        corners.map(|corner| Rect {
            min: corner,
            max: corner.map(|c| c + 10),
        })
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
                    let bounds = counts.dilated(bounds, MARGIN);
                    split(&counts, &counts, bounds, &options(halo, most), &mut cores);
                    for core in &cores {
                        let seen = |rect: &Rect| counts.touching(&rect.grown(halo));
                        let fits_nowhere = squares_of(core).all(|square| seen(&square) > most);
                        prop_assert!(fits_nowhere || seen(core) <= most);
                    }
                }
            }
            // Every position near a square has a home, too.
            for &([x, y], _) in &squares {
                for [dx, dy] in [[-MARGIN, 0], [MARGIN, 0], [0, -MARGIN], [0, MARGIN]] {
                    let corner = [x * 10 + dx, y * 10 + dy];
                    let position = Rect { min: corner, max: corner.map(|c| c + 1) };
                    prop_assert_eq!(cores.iter().filter(|c| c.covers(&position)).count(), 1);
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
    }

    #[test]
    fn a_place_that_does_not_fit_tells_its_cost() {
        let square = |x, cost| Square {
            index: [x, 0],
            points: 1,
            cost,
        };
        let plan = Plan::make(&[square(0, 900), square(1, 5)], 10, &options(3, 500));
        assert_eq!(plan.most_cost(), 905);
    }

    #[test]
    fn what_sees_everything_wherever_it_is_cut_is_not_cut() {
        let squares: Vec<Square> = (0..10_000)
            .map(|i| Square {
                index: [i % 100, i / 100],
                points: 1,
                cost: 1,
            })
            .collect();
        // A halo as wide as the cloud; then one half as wide, so that corners fit and the middle does not.
        let tiles = |halo, most| {
            let plan = Plan::make(&squares, 10, &options(halo, most));
            assert_eq!(
                plan.tiles.iter().map(|t| t.points_core).sum::<u64>(),
                10_000
            );
            plan.tiles.len()
        };
        assert_eq!(tiles(1000, 2000), 1);
        assert!(tiles(500, 2000) < 64, "{}", tiles(500, 2000));
    }

    #[test]
    fn the_costliest_place_is_where_the_costly_squares_are() {
        let squares: Vec<Square> = (0..2_500)
            .map(|i| Square {
                index: [i % 50, i / 50],
                points: 1,
                cost: 1 + 9 * u64::from((i % 50 - 31).abs() < 3 && (i / 50 - 12).abs() < 3),
            })
            .collect();
        let place = Plan::costliest_place(&squares, 10, &options(15, 100)).unwrap();
        // It sees 5 × 5 squares, which can all be costly.
        assert_eq!(place.cost, 250);
        assert!(Plan::costliest_place(&[], 10, &options(15, 100)).is_none());
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
