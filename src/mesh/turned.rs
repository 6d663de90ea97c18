//! The triangles of a part, turned the same way around where they hang together by smooth edges inside of a cell.

use std::collections::HashSet;

use super::{
    Corners, edges::EdgeTable, joined::Joined, point::MeshPoint, triangle::opening_cosine,
};
use crate::geometry::Local;

/// The cosine of the smallest angle between two triangles of a smooth surface. 120°.
const COSINE_OF_SMOOTH_EDGE: f64 = -0.5;

/// The triangle beyond a smooth edge, and whether both run through the edge in the same direction.
type Beyond = Option<(u32, bool)>;

/// Triangles that are turned the same way around, component by component.
pub(super) struct Turned<'a> {
    /// The number of the part.
    pub(super) number: u32,
    pub(super) points: &'a [MeshPoint],
    pub(super) positions: &'a [Local],
    /// The known triangles, each with its corners in ascending order.
    pub(super) triangles: Vec<Corners>,
    /// The edges of these triangles and of those beside them.
    pub(super) edges: EdgeTable,
    /// For each known triangle its component, and whether its corners run backwards.
    pub(super) turns: Vec<(u32, bool)>,
    /// The number of components.
    pub(super) components: u32,
}

impl<'a> Turned<'a> {
    /// Turns the known ones among `triangles`, which are sorted: those with a corner in the part of this `number`.
    pub(super) fn new(
        number: u32,
        points: &'a [MeshPoint],
        positions: &'a [Local],
        triangles: Vec<Corners>,
    ) -> Self {
        let is_own = |&corner: &u32| points[corner as usize].home == number;
        let (mut triangles, others): (Vec<Corners>, Vec<Corners>) = triangles
            .into_iter()
            .partition(|corners| corners.iter().any(is_own));
        let known = triangles.len();
        let mut is_known = vec![false; points.len()];
        for &corner in triangles.iter().flatten() {
            is_known[corner as usize] = true;
        }
        let is_beside = |corners: &Corners| {
            let known = corners.iter().filter(|&&corner| is_known[corner as usize]);
            known.count() > 1
        };
        triangles.extend(others.into_iter().filter(is_beside));
        let edges = EdgeTable::new(&triangles);
        triangles.truncate(known);
        let mut turned = Self {
            number,
            points,
            positions,
            edges,
            turns: vec![(u32::MAX, false); triangles.len()],
            triangles,
            components: 0,
        };
        let neighbors = turned.neighbors();
        for first in 0..turned.triangles.len() {
            if turned.turns[first].0 == u32::MAX {
                turned.turn_component(first, &neighbors);
            }
        }
        turned.turn_by_flattest_edges(&turned.with_conflicts(&neighbors));
        turned
    }

    /// Turns all triangles as `first` lies that hang together with it by smooth edges inside of a cell.
    fn turn_component(&mut self, first: usize, neighbors: &[[Beyond; 3]]) {
        let component = self.components;
        self.components += 1;
        self.turns[first] = (component, false);
        let mut open = vec![first];
        while let Some(triangle) = open.pop() {
            for beyond in neighbors[triangle] {
                if let Some((other, is_alike)) = beyond
                    && self.turns[other as usize].0 == u32::MAX
                {
                    self.turns[other as usize] = (component, self.turns[triangle].1 ^ is_alike);
                    open.push(other as usize);
                }
            }
        }
    }

    /// The components in which a smooth edge joins triangles that cannot both lie as their neighbours do: those around a
    /// loop have no common front.
    fn with_conflicts(&self, neighbors: &[[Beyond; 3]]) -> HashSet<u32> {
        let is_conflict = |triangle: usize, (other, is_alike): (u32, bool)| {
            let turn = |triangle: usize| self.turns[triangle].1;
            turn(triangle) ^ turn(other as usize) != is_alike
        };
        let has_conflict = |&triangle: &usize| {
            let mut beyond = neighbors[triangle].iter().flatten();
            beyond.any(|&beyond| is_conflict(triangle, beyond))
        };
        let triangles = (0..self.triangles.len()).filter(has_conflict);
        triangles.map(|triangle| self.turns[triangle].0).collect()
    }

    /// Turns the triangles of these `components` anew, over the flattest edges first, so that those that remain in
    /// conflict are the least flat.
    fn turn_by_flattest_edges(&mut self, components: &HashSet<u32>) {
        if components.is_empty() {
            return;
        }
        let component = |triangle: u32| self.turns.get(triangle as usize).map(|turn| turn.0);
        let is_among = |component: u32| components.contains(&component);
        let mut smooth: Vec<(f64, [u32; 2], [u32; 2], bool)> = Vec::new();
        for (edge, triangles) in self.edges.all() {
            if let Some([(one, tip), (other, other_tip)]) = triangles.both()
                && component(one) == component(other)
                && component(one).is_some_and(is_among)
            {
                let tips = [tip, other_tip];
                let cosine = self.cosine(edge, tips);
                smooth.push((cosine, edge, [one, other], runs_alike(edge, tips)));
            }
        }
        smooth.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut joined = Joined::new(self.triangles.len());
        for (_, _, [one, other], is_alike) in smooth {
            joined.join(one, other, is_alike);
        }
        for triangle in 0..self.triangles.len() as u32 {
            let (component, turn) = &mut self.turns[triangle as usize];
            if components.contains(component) {
                *turn = joined.root(triangle).1;
            }
        }
    }

    /// The cell in which a triangle is at home, if that is in the part. Triangles of a part beside are not all known, so
    /// that what hangs together there is not, either.
    fn cell(&self, triangle: u32) -> Option<[i32; 2]> {
        let first = self.triangles.get(triangle as usize)?[0];
        self.is_own(first).then(|| self.points[first as usize].cell)
    }

    /// For each triangle those of the same cell beyond its smooth edges.
    fn neighbors(&self) -> Vec<[Beyond; 3]> {
        let mut neighbors = vec![[None; 3]; self.triangles.len()];
        for (edge, triangles) in self.edges.all() {
            if let Some([(one, tip), (other, other_tip)]) = triangles.both()
                && self.cell(one).is_some()
                && self.cell(one) == self.cell(other)
                && self.cosine(edge, [tip, other_tip]) <= COSINE_OF_SMOOTH_EDGE
            {
                let is_alike = runs_alike(edge, [tip, other_tip]);
                for (from, to) in [(one, other), (other, one)] {
                    let free = neighbors[from as usize]
                        .iter_mut()
                        .find(|beyond| beyond.is_none());
                    if let Some(free) = free {
                        *free = Some((to, is_alike));
                    }
                }
            }
        }
        neighbors
    }

    /// The cosine of the angle between the triangles from an edge to two corners.
    pub(super) fn cosine(&self, edge: [u32; 2], tips: [u32; 2]) -> f64 {
        let [from, to, one, other] =
            [edge[0], edge[1], tips[0], tips[1]].map(|corner| self.positions[corner as usize]);
        opening_cosine(from, to, one, other)
    }

    /// Whether a point is at home in the part.
    pub(super) fn is_own(&self, corner: u32) -> bool {
        self.points[corner as usize].home == self.number
    }

    /// The corners of a triangle in the direction in which it was turned, the first one first.
    pub(super) fn turned(&self, triangle: usize) -> Corners {
        let [a, b, c] = self.triangles[triangle];
        match self.turns[triangle].1 {
            true => [a, c, b],
            false => [a, b, c],
        }
    }
}

/// Whether the triangles from an edge to two corners, all corners in ascending order, run through the edge in the same
/// direction, so that one of them must be turned around.
pub(super) fn runs_alike(edge: [u32; 2], tips: [u32; 2]) -> bool {
    let [one, other] = tips.map(|tip| edge[0] < tip && tip < edge[1]);
    one == other
}
