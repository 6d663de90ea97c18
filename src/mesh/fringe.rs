//! Triangles at a border that are not of the surface: slivers and loose ears are taken away.
//!
//! ```text
//!       _.b._         A sliver a b c: its edge a–c is open, and its angle at b is wider than a right one. So the centre o
//!     a'_____'c       of the circle through its corners lies beyond the border, where there is no surface: the three
//!                     cells do not meet on it, and the restricted Delaunay triangulation has no such triangle.
//!         o
//!
//!    /\____/\         A loose ear: two of its edges are open, and its tip t belongs to other triangles, with which it
//!      \  /           has no edge in common. It hangs on its base, and only touches what it seems to lead to.
//!   ____\/____
//!    \  /t \  /
//! ```
//!
//! What is taken away leaves the rest as it was: every point keeps a triangle, and what hung together still does.
//! So the corner b of a sliver must be inside of the surface; of several slivers with the same b the one with the widest
//! angle goes. At the tip of an ear other triangles remain, and the one beyond its base has another neighbour that remains.
//! All triangles of a round are chosen by what was there before it.

use super::{
    Corners,
    edges::EdgeTable,
    stars::LARGEST_CIRCUMRADIUS,
    triangle::{angle_cosine, edges, places},
};
use crate::geometry::Local;

/// Number of rounds: behind a sliver there can be another one. A third round would find about one for a hundred of the
/// first.
const ROUNDS: usize = 2;
/// The longest edge of a triangle that is taken away, in spacings. The stars have no longer ones; those that close
/// holes can.
const LONGEST: f64 = 2.0 * LARGEST_CIRCUMRADIUS;
/// How far away triangles can be that decide which ones are taken away, in spacings: in each round they are
/// neighbours of those that touch the triangle.
pub(super) const REACH: f64 = 2.0 * LONGEST * ROUNDS as f64;
/// Open edges of an ear.
const OPEN_EDGES_OF_AN_EAR: u8 = 2;

/// Takes slivers and loose ears away from the borders of `triangles`, which are sorted. Every corner with an open edge is
/// among those that `is_border` says may be at a border.
pub(super) fn trim(
    positions: &[Local],
    spacing: f64,
    mut is_border: Vec<bool>,
    triangles: &mut Vec<Corners>,
) {
    for _ in 0..ROUNDS {
        let fringe = Fringe::of(positions, spacing, &mut is_border, triangles);
        let mut is_taken = vec![false; triangles.len()];
        for near in fringe.slivers(&is_border).chain(fringe.loose_ears()) {
            let (number, corners) = fringe.triangles[near as usize];
            is_taken[number as usize] = true;
            corners.iter().for_each(|&c| is_border[c as usize] = true);
        }
        let mut is_taken = is_taken.into_iter();
        triangles.retain(|_| is_taken.next() != Some(true));
    }
}

/// The triangles around the corners of a border. They are counted from 0 in their order here.
struct Fringe<'a> {
    positions: &'a [Local],
    /// The number of each triangle in the whole mesh, and its corners.
    triangles: Vec<(u32, Corners)>,
    /// The edges of these triangles. Those that meet no border may lack a triangle.
    edges: EdgeTable,
    /// The open edges, each with its triangle and the corner opposite.
    open: Vec<([u32; 2], (u32, u32))>,
    /// The number of open edges of each triangle; that of a triangle which is too large to be taken away is 0.
    open_edges: Vec<u8>,
}

impl<'a> Fringe<'a> {
    /// The triangles around the corners that may be at a border; `is_border` is corrected to those that are.
    fn of(
        positions: &'a [Local],
        spacing: f64,
        is_border: &mut [bool],
        triangles: &[Corners],
    ) -> Self {
        let is_near =
            |(_, corners): &(u32, Corners)| corners.iter().any(|&c| is_border[c as usize]);
        let triangles: Vec<(u32, Corners)> = (0..)
            .zip(triangles.iter().copied())
            .filter(is_near)
            .collect();
        let corners: Vec<Corners> = triangles.iter().map(|&(_, corners)| corners).collect();
        let edges = EdgeTable::new(&corners);
        let open: Vec<([u32; 2], (u32, u32))> = edges
            .all()
            .filter(|(edge, _)| edge.iter().all(|&corner| is_border[corner as usize]))
            .filter_map(|(edge, triangles)| Some((edge, triangles.only()?)))
            .collect();
        is_border.fill(false);
        let mut open_edges = vec![0; triangles.len()];
        for &([from, to], (triangle, _)) in &open {
            is_border[from as usize] = true;
            is_border[to as usize] = true;
            open_edges[triangle as usize] += 1;
        }
        let mut fringe = Self {
            positions,
            triangles,
            edges,
            open,
            open_edges,
        };
        for triangle in 0..fringe.triangles.len() {
            if fringe.longest_edge(triangle) > LONGEST * spacing {
                fringe.open_edges[triangle] = 0;
            }
        }
        fringe
    }

    /// The length of the longest edge of a triangle.
    fn longest_edge(&self, triangle: usize) -> f64 {
        let lengths = edges(self.triangles[triangle].1).map(|([from, to], _)| {
            (self.positions[to as usize] - self.positions[from as usize]).norm()
        });
        lengths.into_iter().fold(0.0, f64::max)
    }

    /// Whether a triangle has two open edges.
    fn is_ear(&self, triangle: u32) -> bool {
        self.open_edges[triangle as usize] == OPEN_EDGES_OF_AN_EAR
    }

    /// The slivers, one to each corner inside of the surface.
    fn slivers(&self, is_border: &[bool]) -> impl Iterator<Item = u32> + use<> {
        let sliver = |&([from, to], (triangle, tip)): &([u32; 2], (u32, u32))| {
            let [place, from, to] = places(self.positions, [tip, from, to]);
            let cosine = angle_cosine(place, from, to);
            let is_sliver =
                self.open_edges[triangle as usize] == 1 && !is_border[tip as usize] && cosine < 0.0;
            is_sliver.then_some((tip, cosine, triangle))
        };
        let mut slivers: Vec<(u32, f64, u32)> = self.open.iter().filter_map(sliver).collect();
        // The order of the triangles, which the positions give, decides between equals.
        slivers
            .sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
        slivers.dedup_by_key(|&mut (tip, _, _)| tip);
        slivers.into_iter().map(|(_, _, triangle)| triangle)
    }

    /// The ears whose tips belong to other triangles.
    fn loose_ears(&self) -> impl Iterator<Item = u32> + use<> {
        // Each ear, its tip, and the triangle beyond its base; and for each triangle its neighbours that are no ears.
        let mut ears: Vec<(u32, u32, u32)> = Vec::new();
        let mut steady_neighbors = vec![0_u8; self.triangles.len()];
        for (_, triangles) in self.edges.all() {
            if let Some([one, other]) = triangles.both() {
                for ((triangle, tip), (beyond, _)) in [(one, other), (other, one)] {
                    match self.is_ear(triangle) {
                        true => ears.push((triangle, tip, beyond)),
                        false => steady_neighbors[beyond as usize] += 1,
                    }
                }
            }
        }
        // At each corner the triangles other than ears with their tips there.
        let mut holding = vec![0_u32; self.positions.len()];
        for &corner in self.triangles.iter().flat_map(|(_, corners)| corners) {
            holding[corner as usize] += 1;
        }
        for &(_, tip, _) in &ears {
            holding[tip as usize] -= 1;
        }
        ears.retain(|&(_, tip, beyond)| {
            holding[tip as usize] > 0
                && !self.is_ear(beyond)
                && steady_neighbors[beyond as usize] > 0
        });
        ears.into_iter().map(|(triangle, _, _)| triangle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> Local {
        Local::new(x, y, 0.0)
    }

    /// What is left of `triangles` when every corner may be at a border.
    fn trimmed(positions: &[Local], triangles: &[Corners]) -> Vec<Corners> {
        let mut left = triangles.to_vec();
        left.sort_unstable();
        trim(positions, 1.0, vec![true; positions.len()], &mut left);
        left
    }

    /// Five triangles around the point 0, and the triangles beyond their edges except for the last one.
    fn fan(last: f64) -> (Vec<Local>, Vec<Corners>) {
        let ways = [-last, last, 115.0, 180.0, 245.0].map(f64::to_radians);
        let mut positions = vec![at(0.0, 0.0)];
        positions.extend(ways.map(|way| at(way.cos(), way.sin())));
        let mut triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 1, 5]];
        for [from, to] in [[2, 3], [3, 4], [4, 5], [1, 5]] {
            let tip = positions.len() as u32;
            positions.push((positions[from as usize] + positions[to as usize]) * 0.9);
            triangles.push([from, to, tip]);
        }
        (positions, triangles)
    }

    #[test]
    fn a_wide_triangle_at_a_border_is_taken_away_and_an_even_one_stays() {
        // The angle at the point 0 is twice the one given.
        for (angle, is_sliver) in [(50.0, true), (46.0, true), (44.0, false), (30.0, false)] {
            let (positions, mut triangles) = fan(angle);
            let left = trimmed(&positions, &triangles);
            triangles.retain(|corners| !is_sliver || *corners != [0, 1, 2]);
            triangles.sort_unstable();
            assert_eq!(left, triangles, "{angle}");
        }
    }

    #[test]
    fn a_wide_triangle_between_two_borders_stays() {
        // Without another one of the five its tip is at a border, too, and only it holds the sides together.
        let (positions, mut triangles) = fan(50.0);
        triangles.retain(|corners| *corners != [0, 3, 4]);
        assert!(trimmed(&positions, &triangles).contains(&[0, 1, 2]));
    }

    #[test]
    fn of_two_slivers_with_one_tip_the_wider_goes() {
        let ways = [-48.0_f64, 48.0, 95.0, 198.0, 250.0].map(f64::to_radians);
        let mut positions = vec![at(0.0, 0.0)];
        positions.extend(ways.map(|way| at(way.cos(), way.sin())));
        let triangles = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [0, 1, 5]];
        // Beyond 1–2 (96°) and 3–4 (103°) there is nothing.
        let mut all = triangles.to_vec();
        for [from, to] in [[2, 3], [4, 5], [1, 5]] {
            all.push([from, to, positions.len() as u32]);
            positions.push((positions[from as usize] + positions[to as usize]) * 0.9);
        }
        let left = trimmed(&positions, &all);
        assert_eq!(left.len(), all.len() - 1);
        assert!(left.contains(&[0, 1, 2]) && !left.contains(&[0, 3, 4]));
    }

    #[test]
    fn an_ear_that_touches_other_triangles_is_taken_away() {
        // A strip of four triangles, and an ear on its first that touches another strip at its tip.
        let strip = |from: u32| (from..from + 3).map(|k| [k, k + 1, k + 2]);
        let place = |k: u32| at(0.5 * f64::from(k), 0.8 * f64::from(k % 2));
        let mut positions: Vec<Local> = (0..5).map(place).collect();
        positions.extend((0..5).map(|k| place(k) - Local::new(0.0, 1.6, 0.0)));
        let apart: Vec<Corners> = strip(0).chain(strip(5)).collect();
        let ear = [2, 4, 8];
        let mut with_ear = apart.clone();
        with_ear.push(ear);
        assert_eq!(trimmed(&positions, &with_ear), apart);
        // A tip of its own holds an ear.
        positions.push(at(1.5, -0.7));
        with_ear.pop();
        with_ear.push([2, 4, 10]);
        with_ear.sort_unstable();
        assert_eq!(trimmed(&positions, &with_ear), with_ear);
    }
}
