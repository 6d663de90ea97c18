//! Points in the cells of a cubic grid, to find those near a position.
//!
//! A uniform grid serves better than a tree here: the query radius is tied to
//! the spacing, and scans are full of coincident and coplanar points, which
//! cost a k-d tree its balance.
//!
//! The grid is anchored at the local origin, and its cells are
//! visited in a fixed order (that of their bricks; within a cell in the order
//! the points were given). So a sum over neighbours adds in an order that depends
//! on the data alone, and gives the same bits in every tile that sees it.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{LayeredCells, Local, Neighbor};

/// Points by the cell of a cubic grid, or of several grids one upon the other.
#[derive(Debug, Clone)]
pub struct NeighborGrid {
    cells: LayeredCells,
    /// Points, sorted by layer and cell.
    points: Vec<Local>,
    /// For each entry of `points` its index in the input.
    order: Vec<u32>,
}

impl NeighborGrid {
    /// Sorts `points` into cells of edge `edge` (CRS units).
    ///
    /// # Panics
    ///
    /// Unless `edge` is positive; and as [`OccupiedCells::sort`].
    pub fn new(points: &[Local], edge: f64) -> Self {
        Self::of_cells(
            points,
            LayeredCells::one_layer(points, |&point| point, edge),
        )
    }

    /// Sorts `points` into the layers that `layers` gives, one to a point; the cells of layer *k* have the edge
    /// `edges[k]` (CRS units).
    ///
    /// # Panics
    ///
    /// As [`LayeredCells::sort`].
    pub(crate) fn layered(points: &[Local], layers: &[u8], edges: &[f64]) -> Self {
        let cells = LayeredCells::sort(points, |&point| point, layers, edges);
        Self::of_cells(points, cells)
    }

    fn of_cells(points: &[Local], (cells, order): (LayeredCells, Vec<u32>)) -> Self {
        Self {
            cells,
            points: order.par_iter().map(|&i| points[i as usize]).collect(),
            order,
        }
    }

    /// The points, sorted by cell.
    pub(crate) fn points(&self) -> &[Local] {
        &self.points
    }

    /// Calls `visit` with the index in the input and the coordinates of every
    /// point.
    pub(crate) fn visit_all(&self, mut visit: impl FnMut(u32, Local)) {
        for (&index, &point) in self.order.iter().zip(&self.points) {
            visit(index, point);
        }
    }

    /// Calls `visit` with the index in the input and the coordinates of every
    /// point of the cells that a ball touches: all points within `radius` of
    /// `center`, and some beyond.
    pub fn visit_around(&self, center: Local, radius: f64, visit: impl FnMut(u32, Local)) {
        let reach = Local::repeat(radius);
        self.visit_box(center - reach, center + reach, visit);
    }

    /// Fills `neighbors` with the points within `radius` (CRS units) of `site`, nearest first; a point in the same place
    /// is none.
    pub(crate) fn find_neighbors(&self, site: Local, radius: f64, neighbors: &mut Vec<Neighbor>) {
        neighbors.clear();
        self.visit_around(site, radius, |index, point| {
            let neighbor = Neighbor::new(site, index, point);
            if neighbor.distance_squared > 0.0 && neighbor.distance_squared <= radius * radius {
                neighbors.push(neighbor);
            }
        });
        Neighbor::sort(neighbors);
    }

    /// Fills `near` with the points nearer to `center` than `radius` (CRS units).
    pub(crate) fn gather(&self, center: Local, radius: f64, near: &mut Vec<Local>) {
        near.clear();
        self.visit_around(center, radius, |_, point| {
            if (point - center).norm_squared() < radius * radius {
                near.push(point);
            }
        });
    }

    /// Calls `visit` with the index in the input and the coordinates of every point of the cells
    /// that the box from `low` to `high` touches.
    #[inline]
    pub(crate) fn visit_box(&self, low: Local, high: Local, mut visit: impl FnMut(u32, Local)) {
        let _ = self.cells.visit_box(low, high, |points| {
            let order = self.order[points.clone()].iter();
            for (&index, &point) in order.zip(&self.points[points]) {
                visit(index, point);
            }
            ControlFlow::<()>::Continue(())
        });
    }

    /// Whether any point lies within `radius` of `center`.
    pub(crate) fn any_within(&self, center: Local, radius: f64) -> bool {
        let radius_squared = radius * radius;
        let reach = Local::repeat(radius);
        let (low, high) = (center - reach, center + reach);
        let search = self.cells.visit_box(low, high, |points| {
            let mut points = self.points[points].iter();
            if points.any(|p| (p - center).norm_squared() <= radius_squared) {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        search.is_break()
    }

    /// Squared distance from `center` to the nearest point other than those for which
    /// `skip` is true, if one lies within `radius`, with its index in the input.
    /// Of equally near points the first visited wins.
    pub fn nearest(
        &self,
        center: Local,
        radius: f64,
        skip: impl Fn(u32) -> bool,
    ) -> Option<(u32, f64)> {
        let search = |reach: f64, limit: f64| {
            let mut best: Option<(u32, f64)> = None;
            self.visit_around(center, reach, |index, point| {
                let squared = (point - center).norm_squared();
                if squared <= limit && best.is_none_or(|(_, b)| squared < b) && !skip(index) {
                    best = Some((index, squared));
                }
            });
            best
        };
        // Rings of growing reach: near points end the search early.
        let limit = radius * radius;
        let mut reach = self.cells.finest_edge().min(radius);
        loop {
            match search(reach, limit) {
                Some((index, squared)) if squared <= reach * reach => {
                    return Some((index, squared));
                }
                // Found in a corner of the cells: nothing lies nearer than the
                // ball through it contains.
                Some((_, squared)) => return search(squared.sqrt(), squared),
                None if reach >= radius => return None,
                None => reach = (2.0 * reach).min(radius),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    fn cloud(n: u64, extent: f64) -> Vec<Local> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64 - 0.5;
        (0..n)
            .map(|i| Local::new(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)) * extent)
            .collect()
    }

    #[test]
    fn nearest_neighbours_match_brute_force() {
        let points = cloud(500, 10.0);
        let grid = NeighborGrid::new(&points, 0.7);
        for (i, &center) in points.iter().enumerate() {
            for radius in [0.3, 1.0, 4.0] {
                let found = grid.nearest(center, radius, |j| j as usize == i);
                let truth = points
                    .iter()
                    .enumerate()
                    .filter(|&(j, p)| j != i && (p - center).norm() <= radius)
                    .map(|(_, p)| (p - center).norm_squared())
                    .min_by(f64::total_cmp);
                assert_eq!(found.map(|(_, d)| d), truth);
                let any = points.iter().any(|p| (p - center * 1.3).norm() <= radius);
                assert_eq!(grid.any_within(center * 1.3, radius), any);
            }
        }
    }

    #[test]
    fn every_point_within_the_radius_is_visited_once() {
        let points = cloud(400, 6.0);
        let grid = NeighborGrid::new(&points, 0.9);
        for &center in &points {
            let mut seen = vec![0; points.len()];
            grid.visit_around(center, 1.5, |i, p| {
                assert_eq!(points[i as usize], p);
                seen[i as usize] += 1;
            });
            for (count, p) in seen.iter().zip(&points) {
                assert!(*count <= 1);
                assert!(*count == 1 || (p - center).norm() > 1.5);
            }
        }
    }

    #[test]
    fn the_order_of_a_visit_does_not_depend_on_points_far_away() {
        let near = cloud(200, 4.0);
        let mut both = cloud(50, 3.0);
        for p in &mut both {
            p.x -= 500.0;
        }
        both.extend(&near);
        let visit = |points: &[Local]| {
            let mut seen = Vec::new();
            NeighborGrid::new(points, 0.8).visit_around(Local::zeros(), 1.6, |_, p| seen.push(p));
            seen
        };
        assert_eq!(visit(&near), visit(&both));
    }

    #[test]
    fn an_empty_grid_finds_nothing() {
        let grid = NeighborGrid::new(&[], 1.0);
        assert!(!grid.any_within(Local::zeros(), 5.0));
        assert!(grid.nearest(Local::zeros(), 5.0, |_| false).is_none());
    }
}
