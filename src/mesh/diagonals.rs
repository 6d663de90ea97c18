//! Diagonals that cut across a sharp edge are turned, so that they run along it.
//!
//! ```text
//!      a        Two triangles with the common edge a–b are a quadrilateral a c b d, and a–b is its diagonal. Where a and b
//!     /|\       stand on either side of a sharp edge, and c and d at the edge, both triangles cut the corner; with the
//!    / | \      diagonal c–d each lies on its side.
//!   c  |  d
//!    \ | /      Which is better the normals of the corners say: each corner has a plane, and a place of a triangle that is
//!     \|/       on the surface is on the plane of one of its corners.
//!      b
//! ```
//!
//! In each round the quadrilaterals that would gain are compared with those that have a triangle in common with them or
//! with the triangles around them, and the diagonals of those are turned that gain the most. So no two that are turned at
//! once have to do with each other. Borders stay as they are, every point keeps a triangle, and what hangs together still
//! does.

use std::collections::HashMap;

use rayon::prelude::*;

use super::{
    Corners,
    edges::EdgeTable,
    triangle::{is_fold, least_angle_cosine, places},
};
use crate::geometry::{ITEMS_PER_TASK, Local};

/// Number of rounds: of the diagonals along a sharp edge those beside each other are turned in different ones. A fifth would
/// turn about one for a hundred of the first.
const ROUNDS: usize = 4;
/// The longest edge of a quadrilateral whose diagonal is turned, and the longest diagonal, in spacings.
const LONGEST: f64 = 2.5;
/// How far away triangles can be that decide on a diagonal, in spacings: in each round they have a corner in common with a
/// quadrilateral that has one in common with its own, and those are no wider than their longest edge.
pub(super) const REACH: f64 = 2.0 * LONGEST * ROUNDS as f64;
/// The cosine of the least angle between the normals of two corners of a triangle that may lie across a sharp edge. 26°.
const COSINE_OF_BEND: f64 = 0.9;
/// What two triangles must come nearer to the planes of their corners, together, for their diagonal to be turned, in
/// spacings.
const LEAST_GAIN: f64 = 0.02;
/// What they must come nearer beyond that, in spacings, as a multiple of what the cosines of their smallest angles grow by, together. At 30° that is
/// 0.07 spacings for each degree. On a simulated street the 1st percentile of the angles is 38.1° with it, and the centres of triangles
/// are 0.79 mm from the truth; with 5.0 that is 38.0° and 0.78 mm, with 12.0 38.1° and 0.80 mm.
const GAIN_FOR_COSINE: f64 = 8.0;
/// The cosine of the angle from which on angles may become smaller for nothing. 38°.
const COSINE_OF_LARGE_ANGLE: f64 = 0.788;
/// The cosine of the smallest angle of a triangle that a turned diagonal makes. 15°.
const COSINE_OF_LEAST_ANGLE: f64 = 0.966;
/// The weights of the corners at the places of a triangle that are compared with planes: its centre, and two rings of
/// three places around it.
const PLACES: [[f64; 3]; 7] = {
    const NEAR: f64 = 1.0 / 9.0;
    const FAR: f64 = 1.0 / 6.0;
    [
        [3.0 * NEAR, 3.0 * NEAR, 3.0 * NEAR],
        [4.0 * FAR, FAR, FAR],
        [FAR, 4.0 * FAR, FAR],
        [FAR, FAR, 4.0 * FAR],
        [NEAR, 4.0 * NEAR, 4.0 * NEAR],
        [4.0 * NEAR, NEAR, 4.0 * NEAR],
        [4.0 * NEAR, 4.0 * NEAR, NEAR],
    ]
};

/// Turns the diagonals of `triangles`, which are sorted, that cut across a sharp edge; the `normals` are those of the surface
/// at the `positions`. Where a corner has none, nothing is turned.
pub(super) fn turn(
    positions: &[Local],
    normals: &[Option<Local>],
    spacing: f64,
    triangles: &mut [Corners],
) {
    // At first wherever there may be a sharp edge, then where a diagonal would have gained in the round before: elsewhere
    // everything is as it was.
    let mut is_open = vec![true; positions.len()];
    let mut is_near = corners_of(triangles, positions.len(), |it| is_bent(normals, it));
    for _ in 0..ROUNDS {
        let bent = Bent::of(positions, normals, spacing, triangles, &is_near);
        let gaining = bent.gaining(&is_open);
        for (number, corners) in bent.turned(&gaining) {
            triangles[number as usize] = corners;
        }
        is_open.fill(false);
        for corner in gaining.iter().flat_map(Quadrilateral::corners) {
            is_open[corner as usize] = true;
        }
        let has_open = |corners: Corners| corners.iter().any(|&c| is_open[c as usize]);
        is_near = corners_of(triangles, positions.len(), has_open);
    }
    triangles.sort_unstable();
}

/// Two triangles with a common edge, whose diagonal is to be turned.
#[derive(Clone, Copy)]
struct Quadrilateral {
    /// How much nearer the triangles come to the planes of their corners, less the price of their angles (CRS units).
    gain: f64,
    /// The corners of the common edge.
    edge: [u32; 2],
    /// The two triangles, counted as in [`Bent`], each with its corner opposite to the edge.
    sides: [(u32, u32); 2],
}

impl Quadrilateral {
    /// The corners opposite to the diagonal.
    fn tips(&self) -> [u32; 2] {
        self.sides.map(|(_, tip)| tip)
    }

    fn corners(&self) -> [u32; 4] {
        let ([a, b], [c, d]) = (self.edge, self.tips());
        [a, b, c, d]
    }

    /// The two triangles with the other diagonal.
    fn turned(&self) -> [Corners; 2] {
        let [c, d] = self.tips();
        self.edge.map(|corner| {
            let mut corners = [corner, c, d];
            corners.sort_unstable();
            corners
        })
    }
}

/// The triangles around those whose diagonals may be turned. They are counted from 0 in their order here.
struct Bent<'a> {
    positions: &'a [Local],
    normals: &'a [Option<Local>],
    spacing: f64,
    /// The number of each triangle in the whole mesh, and its corners.
    triangles: Vec<(u32, Corners)>,
    /// Their edges. At the margin they may lack a triangle.
    edges: EdgeTable,
}

impl<'a> Bent<'a> {
    /// The ones among `triangles` with a corner that `is_near`, and their edges.
    fn of(
        positions: &'a [Local],
        normals: &'a [Option<Local>],
        spacing: f64,
        triangles: &[Corners],
        is_near: &[bool],
    ) -> Self {
        let triangles: Vec<(u32, Corners)> = (0..)
            .zip(triangles.iter().copied())
            .filter(|(_, corners)| corners.iter().any(|&c| is_near[c as usize]))
            .collect();
        let corners: Vec<Corners> = triangles.iter().map(|&(_, corners)| corners).collect();
        Self {
            positions,
            normals,
            spacing,
            edges: EdgeTable::new(&corners),
            triangles,
        }
    }

    /// The triangles that are changed, of those that are `gaining`, the ones that gain the most first: the number of each in the whole mesh, and its corners from now on.
    fn turned(&self, gaining: &[Quadrilateral]) -> Vec<(u32, Corners)> {
        // The best quadrilateral that each triangle belongs to, and the best one with each pair of tips.
        let mut best = vec![u32::MAX; self.triangles.len()];
        let mut best_of_tips: HashMap<[u32; 2], u32> = HashMap::new();
        for (rank, quadrilateral) in (0..).zip(gaining) {
            for (side, _) in quadrilateral.sides {
                best[side as usize] = rank.min(best[side as usize]);
            }
            best_of_tips
                .entry(sorted(quadrilateral.tips()))
                .or_insert(rank);
        }
        let is_best = |rank: u32, quadrilateral: &Quadrilateral| {
            let own = quadrilateral.sides.map(|(side, _)| side);
            let beyond = self.beyond(quadrilateral).map(|(triangle, _)| triangle);
            own.into_iter()
                .chain(beyond)
                .all(|triangle| rank <= best[triangle as usize])
                && best_of_tips[&sorted(quadrilateral.tips())] == rank
        };
        let winners = (0..)
            .zip(gaining)
            .filter(|&(rank, quadrilateral)| is_best(rank, quadrilateral));
        winners
            .flat_map(|(_, quadrilateral)| {
                let [one, other] = quadrilateral
                    .sides
                    .map(|(side, _)| self.triangles[side as usize].0);
                let [first, second] = quadrilateral.turned();
                [(one, first), (other, second)]
            })
            .collect()
    }

    /// The quadrilaterals with a corner that `is_open` whose other diagonal is better, those that gain the most first.
    fn gaining(&self, is_open: &[bool]) -> Vec<Quadrilateral> {
        let all: Vec<Quadrilateral> = self
            .edges
            .all()
            .filter_map(|(edge, triangles)| {
                let sides = triangles.both()?;
                let corners = sides.map(|(side, _)| self.triangles[side as usize].1);
                let has_plane = |&corner: &u32| self.normals[corner as usize].is_some();
                let is_candidate = corners.iter().any(|&it| is_bent(self.normals, it))
                    && corners.iter().flatten().all(has_plane)
                    && corners.iter().flatten().any(|&c| is_open[c as usize]);
                is_candidate.then_some(Quadrilateral {
                    gain: 0.0,
                    edge,
                    sides,
                })
            })
            .collect();
        let mut gaining: Vec<Quadrilateral> = all
            .into_par_iter()
            .with_max_len(ITEMS_PER_TASK)
            .filter_map(|quadrilateral| {
                let gain = self.gain(&quadrilateral) - self.price(&quadrilateral);
                let is_better =
                    gain > LEAST_GAIN * self.spacing && self.is_possible(&quadrilateral);
                is_better.then_some(Quadrilateral {
                    gain,
                    ..quadrilateral
                })
            })
            .collect();
        // The order of the edges, which the positions give, decides between equals.
        gaining.par_sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.edge.cmp(&b.edge)));
        gaining
    }

    /// How much nearer the triangles of a quadrilateral come to the planes of their corners if its diagonal is turned (CRS
    /// units).
    fn gain(&self, quadrilateral: &Quadrilateral) -> f64 {
        let before = quadrilateral
            .sides
            .map(|(side, _)| self.distance(self.triangles[side as usize].1));
        let after = quadrilateral.turned().map(|corners| self.distance(corners));
        before[0] + before[1] - after[0] - after[1]
    }

    /// What a diagonal must gain because the smallest angles of its triangles become smaller if it is turned (CRS units).
    fn price(&self, quadrilateral: &Quadrilateral) -> f64 {
        let cosine = |corners: Corners| {
            least_angle_cosine(places(self.positions, corners)).max(COSINE_OF_LARGE_ANGLE)
        };
        let before = quadrilateral
            .sides
            .map(|(side, _)| cosine(self.triangles[side as usize].1));
        let after = quadrilateral.turned().map(cosine);
        GAIN_FOR_COSINE * (after[0] + after[1] - before[0] - before[1]) * self.spacing
    }

    /// How far a triangle is from the planes of its corners: in the mean over its places, from the nearest one (CRS units).
    fn distance(&self, corners: Corners) -> f64 {
        let places = places(self.positions, corners);
        // For each corner the heights of all three above its plane.
        let heights = [0, 1, 2].map(|k| {
            let normal = self.normals[corners[k] as usize].unwrap_or_default();
            places.map(|place| normal.dot(&(place - places[k])))
        });
        let distance = |[u, v, w]: [f64; 3]| {
            let heights = heights.map(|[a, b, c]| (u * a + v * b + w * c).abs());
            heights[0].min(heights[1]).min(heights[2])
        };
        PLACES.into_iter().map(distance).sum::<f64>() / PLACES.len() as f64
    }

    /// Whether a diagonal can be turned: there are no such triangles yet, they are not too large or thin, and they do not
    /// lie on top of each other or of those around them.
    fn is_possible(&self, quadrilateral: &Quadrilateral) -> bool {
        let ([a, b], [c, d]) = (quadrilateral.edge, quadrilateral.tips());
        let is_short = |(one, other): (u32, u32)| {
            let way = self.place(other) - self.place(one);
            way.norm() <= LONGEST * self.spacing
        };
        let is_round = |corners: Corners| {
            let cosine = least_angle_cosine(places(self.positions, corners));
            cosine <= COSINE_OF_LEAST_ANGLE
        };
        self.edges.of(c, d).len() == 0
            && [(a, b), (c, d), (a, c), (c, b), (b, d), (d, a)]
                .into_iter()
                .all(is_short)
            && quadrilateral.turned().into_iter().all(is_round)
            && !self.is_fold([c, d], a, b)
            && self
                .beyond(quadrilateral)
                .all(|(_, [from, to, tip, opposite])| !self.is_fold([from, to], tip, opposite))
    }

    /// The triangles beyond the outer edges of a quadrilateral, each with the corners of the edge, the corner that is
    /// opposite to it on this side once the diagonal is turned, and the one on the other side.
    fn beyond(&self, quadrilateral: &Quadrilateral) -> impl Iterator<Item = (u32, [u32; 4])> {
        let ([a, b], [c, d]) = (quadrilateral.edge, quadrilateral.tips());
        let [own, other] = quadrilateral.sides.map(|(side, _)| side);
        [(a, c, d), (b, c, d), (a, d, c), (b, d, c)]
            .into_iter()
            .flat_map(move |(from, to, tip)| {
                let on_edge = self.edges.of(from, to);
                on_edge
                    .iter()
                    .filter(move |&&(triangle, _)| triangle != own && triangle != other)
                    .map(move |&(triangle, opposite)| (triangle, [from, to, tip, opposite]))
            })
    }

    /// Whether the triangles from an edge to two corners lie on top of each other.
    fn is_fold(&self, edge: [u32; 2], one: u32, other: u32) -> bool {
        // In the order of the positions, so that every part of a cloud has the same bits.
        let [from, to] = sorted(edge);
        let [from, to, one, other] = [from, to, one, other].map(|corner| self.place(corner));
        is_fold(from, to, one, other)
    }

    fn place(&self, corner: u32) -> Local {
        self.positions[corner as usize]
    }
}

/// For each of `count` points whether it is a corner of one of the `triangles` that are `chosen`.
fn corners_of(triangles: &[Corners], count: usize, chosen: impl Fn(Corners) -> bool) -> Vec<bool> {
    let mut are = vec![false; count];
    for corners in triangles.iter().filter(|&&corners| chosen(corners)) {
        corners.iter().for_each(|&c| are[c as usize] = true);
    }
    are
}

/// Whether a triangle may lie across a sharp edge: the `normals` of two of its corners differ as much.
fn is_bent(normals: &[Option<Local>], corners: Corners) -> bool {
    let [a, b, c] = corners.map(|corner| normals[corner as usize].unwrap_or_default());
    let cosines = [a.dot(&b), b.dot(&c), c.dot(&a)];
    // The normals are of either side.
    cosines
        .into_iter()
        .any(|cosine| cosine.abs() < COSINE_OF_BEND)
}

/// Two corners in ascending order.
fn sorted([one, other]: [u32; 2]) -> [u32; 2] {
    [one.min(other), one.max(other)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What becomes of two triangles that cut the edge in which the plane z = 0 meets one that falls by this `slope` beyond
    /// it; the corners beside the edge are as far from it as this `width`.
    fn across_edge(slope: f64, width: f64) -> Vec<Corners> {
        let beyond = Local::new(1.0, 0.0, -slope).normalize();
        let positions = [
            Local::new(-width, 0.0, 0.0),
            Local::new(0.0, -0.5, 0.0),
            Local::new(0.0, 0.5, 0.0),
            beyond * width,
        ];
        let normal = Local::new(slope, 0.0, 1.0).normalize();
        let edge = (Local::z() + normal).normalize();
        // Of either side.
        let normals = [Local::z(), -edge, edge, -normal].map(Some);
        let mut triangles = vec![[0, 1, 3], [0, 2, 3]];
        turn(&positions, &normals, 1.0, &mut triangles);
        triangles
    }

    #[test]
    fn a_diagonal_across_a_sharp_edge_is_turned_and_others_are_not() {
        let across = [[0, 1, 3], [0, 2, 3]];
        let along = [[0, 1, 2], [1, 2, 3]];
        assert_eq!(across_edge(1.0, 0.8), along);
        assert_eq!(across_edge(0.0, 0.8), across, "a plane");
        assert_eq!(across_edge(0.1, 0.8), across, "nearly a plane");
        assert_eq!(across_edge(1.0, 0.1), across, "triangles would be thin");
        assert_eq!(across_edge(1.0, 2.6), across, "triangles are large");
    }

    #[test]
    fn a_corner_without_a_normal_leaves_a_diagonal_as_it_is() {
        let positions = [
            Local::new(-0.8, 0.0, 0.0),
            Local::new(0.0, -0.5, 0.0),
            Local::new(0.0, 0.5, 0.0),
            Local::new(0.0, 0.0, -0.8),
        ];
        let edge = Local::new(1.0, 0.0, 1.0).normalize();
        let mut normals = [Local::z(), edge, edge, Local::x()].map(Some);
        let across = vec![[0, 1, 3], [0, 2, 3]];
        let mut triangles = across.clone();
        turn(&positions, &normals, 1.0, &mut triangles);
        assert_ne!(triangles, across);
        normals[2] = None;
        triangles.clone_from(&across);
        turn(&positions, &normals, 1.0, &mut triangles);
        assert_eq!(triangles, across);
    }
}
