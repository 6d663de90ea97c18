//! Holes that are narrower than a few spacings are closed.
//!
//! ```text
//!     ______            The border of a hole is a loop of edges with one triangle each. Where borders
//!    /\    /\           touch in a corner, the loop takes the edge that is next around the hole.
//!   /__\__/__\          The loop is filled with the triangles whose circles are the smallest together,
//!      hole             as a Delaunay triangulation would; all of them look the same way.
//! ```

use std::collections::HashSet;

use rayon::prelude::*;

use super::{
    Corners,
    edges::EdgeTable,
    stars::LARGEST_CIRCUMRADIUS,
    triangle::{circumradius_squared, doubled_area, edges, is_fold},
};
use crate::geometry::Local;

/// The most edges around a hole that is closed.
const MOST_EDGES: usize = 14;
/// The largest distance between two corners of a hole that is closed, in spacings.
pub(super) const WIDEST: f64 = 4.5;
/// How far away triangles can be that decide on the closing of a hole, in spacings.
pub(super) const REACH: f64 = WIDEST + 2.0 * LARGEST_CIRCUMRADIUS;

/// Adds to `triangles` those that close the narrow holes between them, and takes away those that have no edge in
/// common with another one; they are sorted then. Returns for each of `positions` whether it may be at a border: it was before holes were
/// closed.
pub(super) fn close(positions: &[Local], spacing: f64, triangles: &mut Vec<Corners>) -> Vec<bool> {
    let borders = Borders::of(positions, triangles);
    let widest = WIDEST * spacing;
    let mut fillings: Vec<Filling> = borders
        .starts()
        .into_par_iter()
        .filter_map(|start| borders.loop_from(start, widest))
        .filter_map(|around| borders.filling(&around))
        .collect();
    fillings.sort_unstable_by(|a, b| a.triangles.cmp(&b.triangles));
    fillings.dedup_by(|a, b| a.triangles == b.triangles);
    let mut taken: HashSet<[u32; 2]> = HashSet::new();
    let mut added = Vec::new();
    for filling in fillings {
        if filling.edges.iter().all(|edge| !taken.contains(edge)) {
            taken.extend(filling.edges);
            added.extend(filling.triangles);
        }
    }
    let has_neighbor = borders.have_neighbors(triangles.len(), &taken);
    let mut has_neighbor = has_neighbor.into_iter();
    triangles.retain(|_| has_neighbor.next().unwrap_or(true));
    triangles.extend(added);
    triangles.sort_unstable();
    let mut may_be_border = vec![false; positions.len()];
    for edge in &borders.around {
        may_be_border[edge.from as usize] = true;
    }
    may_be_border
}

/// The triangles that close a hole.
struct Filling {
    triangles: Vec<Corners>,
    /// Their edges, each once.
    edges: Vec<[u32; 2]>,
}

/// A border edge with the hole to its right and the corner of its triangle to its left.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BorderEdge {
    from: u32,
    to: u32,
    opposite: u32,
}

/// The edges with one triangle.
struct Borders<'a> {
    positions: &'a [Local],
    edges: EdgeTable,
    /// Every border edge in both directions, sorted by its beginning.
    around: Vec<BorderEdge>,
}

impl<'a> Borders<'a> {
    fn of(positions: &'a [Local], triangles: &[Corners]) -> Self {
        let edges = EdgeTable::new(triangles);
        let mut around: Vec<BorderEdge> = edges
            .all()
            .filter_map(|(edge, triangles)| Some((edge, triangles.only()?)))
            .flat_map(|([a, b], (_, opposite))| {
                [(a, b), (b, a)].map(|(from, to)| BorderEdge { from, to, opposite })
            })
            .collect();
        around.par_sort_unstable_by_key(|edge| (edge.from, edge.to));
        Self {
            positions,
            edges,
            around,
        }
    }

    fn place(&self, corner: u32) -> Local {
        self.positions[corner as usize]
    }

    /// Whether each of `count` triangles has an edge in common with another one, or one that was `taken` by a
    /// filling.
    fn have_neighbors(&self, count: usize, taken: &HashSet<[u32; 2]>) -> Vec<bool> {
        let mut have = vec![false; count];
        for (edge, triangles) in self.edges.all() {
            if triangles.len() > 1 || taken.contains(&edge) {
                triangles.iter().for_each(|&(k, _)| have[k as usize] = true);
            }
        }
        have
    }

    /// The border edges from which loops are followed: those that lead away from a smaller corner.
    fn starts(&self) -> Vec<BorderEdge> {
        let leads_up = |edge: &&BorderEdge| edge.from < edge.to;
        self.around.iter().filter(leads_up).copied().collect()
    }

    /// The corners around the hole beside `start`, if it is the smallest of them, and the
    /// hole is no wider than `widest` (CRS units).
    fn loop_from(&self, start: BorderEdge, widest: f64) -> Option<Vec<u32>> {
        let mut around = vec![start.from];
        let mut edge = start;
        loop {
            if edge.to == start.from {
                let is_closed = self.next(edge)? == start && around.len() >= 3;
                return is_closed.then_some(around);
            }
            let place = self.place(edge.to);
            let is_near = |&corner: &u32| (self.place(corner) - place).norm() <= widest;
            if edge.to < start.from
                || around.len() == MOST_EDGES
                || around.contains(&edge.to)
                || !around.iter().all(is_near)
            {
                return None;
            }
            around.push(edge.to);
            edge = self.next(edge)?;
        }
    }

    /// The border edge that follows `edge` around the hole to its right.
    fn next(&self, edge: BorderEdge) -> Option<BorderEdge> {
        let from = self.around.partition_point(|other| other.from < edge.to);
        let leaving = self.around[from..]
            .iter()
            .take_while(|other| other.from == edge.to);
        let leaving = leaving.filter(|other| other.to != edge.from);
        let [start, tip, left] = [edge.from, edge.to, edge.opposite].map(|c| self.place(c));
        let up = doubled_area([start, tip, left]).normalize();
        let back = start - tip;
        let back = (back - up * up.dot(&back)).normalize();
        let side = up.cross(&back);
        leaving
            .map(|other| {
                let way = self.place(other.to) - tip;
                (turn(back.dot(&way), side.dot(&way)), other)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, other)| *other)
    }

    /// The triangles that fill the loop `around` a hole best, if they fit between those
    /// at its border.
    fn filling(&self, around: &[u32]) -> Option<Filling> {
        let count = around.len();
        let places: Vec<Local> = around.iter().map(|&corner| self.place(corner)).collect();
        let ends = (0..count).map(|k| (places[k], places[(k + 1) % count]));
        let up: Local = ends
            .map(|(from, to)| (from - places[0]).cross(&(to - places[0])))
            .sum();
        // The least sum over the corners from i to j, and the corner of its triangle on the diagonal.
        let mut best = vec![(f64::INFINITY, 0); count * count];
        for k in 0..count - 1 {
            best[k * count + k + 1].0 = 0.0;
        }
        for width in 2..count {
            for i in 0..count - width {
                let j = i + width;
                if width < count - 1 && self.edges.of(around[i], around[j]).len() > 0 {
                    continue;
                }
                for k in i + 1..j {
                    let corners = [places[i], places[k], places[j]];
                    let sum = best[i * count + k].0 + best[k * count + j].0;
                    if sum.is_finite()
                        && doubled_area(corners).dot(&up) > 0.0
                        && self.fits(around, [i, k, j])
                    {
                        let sum = sum + circumradius_squared(corners);
                        if sum < best[i * count + j].0 {
                            best[i * count + j] = (sum, k);
                        }
                    }
                }
            }
        }
        best[count - 1]
            .0
            .is_finite()
            .then(|| collect(around, &best))
    }

    /// Whether the triangle of the corners `i` < `k` < `j` of a loop does not lie on top of the
    /// triangles beyond the edges that it has in common with the loop.
    fn fits(&self, around: &[u32], [i, k, j]: [usize; 3]) -> bool {
        let count = around.len();
        [(i, k, j), (k, j, i), (j, i, k)]
            .into_iter()
            .all(|(from, to, tip)| {
                if (from + 1) % count != to {
                    return true;
                }
                let (from, to, tip) = (around[from], around[to], around[tip]);
                let beyond = self.edges.of(from, to).only();
                beyond.is_some_and(|(_, opposite)| {
                    let [from, to] = if from < to { [from, to] } else { [to, from] };
                    let [from, to, tip, opposite] =
                        [from, to, tip, opposite].map(|c| self.place(c));
                    !is_fold(from, to, tip, opposite)
                })
            })
    }
}

/// The triangles of the best filling of the loop `around`.
fn collect(around: &[u32], best: &[(f64, usize)]) -> Filling {
    let count = around.len();
    let mut triangles = Vec::new();
    let mut open = vec![(0, count - 1)];
    while let Some((i, j)) = open.pop() {
        if j - i >= 2 {
            let k = best[i * count + j].1;
            let mut corners = [around[i], around[k], around[j]];
            corners.sort_unstable();
            triangles.push(corners);
            open.extend([(i, k), (k, j)]);
        }
    }
    triangles.sort_unstable();
    let of_triangle = |&corners: &Corners| edges(corners).map(|(edge, _)| edge);
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(of_triangle).collect();
    edges.sort_unstable();
    edges.dedup();
    Filling { triangles, edges }
}

/// A number that grows with the angle of the direction `(x, y)`, counter-clockwise from the x axis.
fn turn(x: f64, y: f64) -> f64 {
    let cosine = x / (x * x + y * y).sqrt();
    match y >= 0.0 {
        true => 1.0 - cosine,
        false => 3.0 + cosine,
    }
}
