//! The height of points above the ground.
//!
//! The ground under a point is interpolated between the ground points around it, cell by cell of a grid of the plane:
//!
//! ```text
//!   cell with ground points:   their mean position and median height
//!   ground under a point:      Σ hᵢ / dᵢ²  over  Σ 1 / dᵢ²
//! ```
//!
//! over the cells of the nearest ring around the point's cell that has ground, and of the rings up to the one after it.
//! The median is not misled by a few points of a car that are taken for ground.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use super::sorted_points::SortedPoints;
use crate::geometry::Quantization;

/// The edge of a cell in spacings.
const CELL_IN_SPACINGS: f64 = 2.0;
/// The number of rings of cells in which ground is looked for: up to 14 spacings beyond the cell of the point. Behind a
/// parked car the scan has no ground for some metres.
const RINGS: i64 = 7;
/// How far the search reaches in the plane, in spacings: the rings and the cell of the point itself.
#[cfg(test)]
pub(super) const GROUND_REACH_IN_SPACINGS: f64 = (RINGS + 1) as f64 * CELL_IN_SPACINGS;

/// The index of a cell of the plane: whole cells from the origin of the quantization.
type PlaneCell = [i64; 2];

/// The ground in a cell.
#[derive(Clone, Copy, Debug)]
struct GroundCell {
    /// The mean position of the ground points in the plane (CRS units from the quantization's offset).
    position: [f64; 2],
    /// The median of their heights.
    height: f64,
}

/// The heights of `points` above the ground (CRS units), in their order, by those points for which `is_ground` holds.
/// `None` where no ground is near. `spacing` (CRS units) is the unit of the search.
pub(super) fn heights_above_ground(
    points: &SortedPoints,
    is_ground: impl Fn(usize) -> bool,
    quantization: &Quantization,
    spacing: f64,
) -> Vec<Option<f64>> {
    let edge = quantization.units(CELL_IN_SPACINGS * spacing);
    let cell_of = |index: usize| {
        let point = points.stored[index];
        [point.x, point.y].map(|c| i64::from(c).div_euclid(edge))
    };

    // Gather the ground of each cell, in the order of the points.
    let mut of_cell: HashMap<PlaneCell, Vec<usize>> = HashMap::new();
    for index in (0..points.stored.len()).filter(|&index| is_ground(index)) {
        of_cell.entry(cell_of(index)).or_default().push(index);
    }
    let ground = of_cell.into_par_iter().map(|(cell, members)| {
        let member = |&index: &usize| points.local[index];
        let count = members.len() as f64;
        let mean = |axis: usize| members.iter().map(|i| member(i)[axis]).sum::<f64>() / count;
        let mut heights: Vec<f64> = members.iter().map(|i| member(i).z).collect();
        heights.sort_unstable_by(f64::total_cmp);
        let ground = GroundCell {
            position: [mean(0), mean(1)],
            height: heights[(heights.len() - 1) / 2],
        };
        (cell, ground)
    });
    let ground: HashMap<PlaneCell, GroundCell> = ground.collect();

    // Find the ground around each cell that has points, then interpolate.
    let cells: HashSet<PlaneCell> = (0..points.stored.len()).map(cell_of).collect();
    let around: HashMap<PlaneCell, Vec<GroundCell>> = cells
        .into_par_iter()
        .map(|cell| (cell, ground_around(cell, &ground)))
        .collect();
    (0..points.stored.len())
        .into_par_iter()
        .map(|index| {
            let point = points.local[index];
            let under = interpolated([point.x, point.y], around.get(&cell_of(index))?, spacing)?;
            Some(point.z - under)
        })
        .collect()
}

/// The ground of the cells around `cell`: of the nearest ring that has any, of those within it and of the next one.
fn ground_around([x, y]: PlaneCell, ground: &HashMap<PlaneCell, GroundCell>) -> Vec<GroundCell> {
    let mut found = Vec::new();
    let mut last = RINGS;
    let mut ring = 0;
    while ring <= last {
        for row in -ring..=ring {
            // The rows at the ends of a ring are whole, of the others there are two cells.
            let step = if row.abs() == ring || ring == 0 {
                1
            } else {
                2 * ring
            };
            let mut column = -ring;
            while column <= ring {
                found.extend(ground.get(&[x + column, y + row]));
                column += step;
            }
        }
        if !found.is_empty() && last == RINGS {
            last = RINGS.min(ring + 1);
        }
        ring += 1;
    }
    found
}

/// The height of the ground at a position of the plane, by the squared inverse distances of `cells`.
fn interpolated([x, y]: [f64; 2], cells: &[GroundCell], spacing: f64) -> Option<f64> {
    let mut sums = [0.0; 2];
    for cell in cells {
        let [dx, dy] = [x - cell.position[0], y - cell.position[1]];
        // A quarter of a spacing more keeps the weight finite.
        let weight = 1.0 / (dx * dx + dy * dy + (0.25 * spacing).powi(2));
        sums[0] += weight * cell.height;
        sums[1] += weight;
    }
    (!cells.is_empty()).then(|| sums[0] / sums[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Stored;

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    fn at(x: f64, y: f64, z: f64) -> Stored {
        QUANTIZATION.stored([x, y, z].into()).unwrap()
    }

    /// Ground on a slope of 10 %, and points at a height of 2 above it or beyond its border.
    #[test]
    fn heights_are_those_above_a_slope() {
        let mut points = Vec::new();
        for i in 0..60 {
            for j in 0..60 {
                let (x, y) = (0.1 * f64::from(i), 0.1 * f64::from(j));
                points.push(at(x, y, 0.1 * x));
            }
        }
        let ground: HashSet<Stored> = points.iter().copied().collect();
        points.extend([at(3.0, 3.0, 2.3), at(6.5, 3.0, 2.65), at(30.0, 3.0, 2.0)]);
        let sorted = SortedPoints::new(&points, &QUANTIZATION);
        let is_ground = |index: usize| ground.contains(&sorted.stored[index]);
        let heights = heights_above_ground(&sorted, is_ground, &QUANTIZATION, 0.2);
        for (point, height) in sorted.local.iter().zip(&heights) {
            match point.x {
                x if x > 20.0 => assert_eq!(*height, None),
                x if x > 6.0 => assert!((height.unwrap() - 2.0).abs() < 0.1, "{height:?}"),
                _ if point.z > 1.0 => assert!((height.unwrap() - 2.0).abs() < 0.02, "{height:?}"),
                _ => assert!(height.unwrap().abs() < 0.04, "{height:?}"),
            }
        }
    }

    #[test]
    fn the_rings_around_a_cell_are_complete() {
        let cell = |x: i64, y: i64| GroundCell {
            position: [x as f64, y as f64],
            height: 0.0,
        };
        let all = |beyond: i64| {
            let square = (-9..=9).flat_map(|x| (-9..=9).map(move |y| [x, y]));
            let far = square.filter(|[x, y]: &PlaneCell| x.abs().max(y.abs()) >= beyond);
            far.map(|[x, y]| ([x, y], cell(x, y))).collect()
        };
        for (beyond, count) in [(0, 9), (1, 8 + 16), (3, 24 + 32), (7, 56), (8, 0)] {
            assert_eq!(ground_around([0, 0], &all(beyond)).len(), count, "{beyond}");
        }
    }
}
