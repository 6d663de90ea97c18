//! The mesh of a part of a cloud: its own triangles, and how they hang together with those of other parts.
//!
//! A part sees its own points and those around it. A triangle is at home where its first corner is; all
//! triangles with a corner in the part are *known*. Those that are at home in a cell of the part and hang together by smooth
//! edges there are turned the same way around: a component. A known triangle that is at home elsewhere is a component of
//! its own; by the way in which each part that knows a triangle turned it, components are joined.

use rayon::prelude::*;

use super::{
    Corners, MeshRules, MeshedPoints, clutter,
    component::Component,
    diagonals,
    edges::EdgeTriangles,
    estimated_normals,
    figures::{AngleClass, MeshFigures},
    point::MeshPoint,
    triangle::{doubled_area, least_angle_cosine, places},
    triangulate,
    turned::{Turned, runs_alike},
};
use crate::geometry::{Local, Quantization};

/// The mesh of a part.
#[derive(Debug, Default)]
pub(crate) struct MeshedPart {
    /// The triangles that are at home in the part, turned as their components are.
    pub(crate) triangles: Vec<PartTriangle>,
    /// For each own point that is the corner of a triangle: its index, its component, and whether its normal is on the
    /// other side of the component.
    pub(crate) corners: Vec<PartCorner>,
    /// The components, with the sums over the triangles that are at home here.
    pub(crate) components: Vec<Component>,
    /// The triangles that other parts know as well.
    pub(crate) links: Vec<Link>,
    /// The joints that are at home here.
    pub(crate) joints: Vec<Joint>,
    /// The counts of what is at home here; components are not counted.
    pub(crate) figures: MeshFigures,
}

/// A triangle with the indices of its corners in the whole cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct PartTriangle {
    /// The corners, the first one at home in the part.
    pub(crate) corners: Corners,
    /// The index of its component in the part.
    pub(crate) component: u32,
}

/// A corner of triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PartCorner {
    /// The index of the point in the whole cloud.
    pub(crate) index: u32,
    /// The index of its component in the part.
    pub(crate) component: u32,
    /// Whether the normal of the point is on the other side of the component.
    pub(crate) is_behind: bool,
}

/// A triangle that several parts know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Link {
    /// The corners by their indices in the whole cloud, in ascending order.
    pub(crate) corners: Corners,
    /// The index of the component in the part.
    pub(crate) component: u32,
    /// Whether the part turned the triangle so that its corners run backwards.
    pub(crate) is_reversed: bool,
    /// The number of parts that know the triangle: two or three.
    pub(crate) known_by: u8,
}

/// An edge at which components hang together: it is sharp, or leads to another cell; or its triangles could not be turned the
/// same way around.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Joint {
    /// Its corners by their indices in the whole cloud, in ascending order.
    pub(super) edge: [u32; 2],
    /// The triangles on it.
    pub(super) sides: [JointSide; 2],
    /// The cosine of the angle between them.
    pub(super) cosine: f32,
    /// Whether one of the two components must be turned around for the triangles to have the same turn.
    pub(super) is_reversed: bool,
}

/// A triangle at a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointSide {
    /// The index of its component in the part.
    pub(super) component: u32,
    /// The corner opposite to the edge.
    pub(super) opposite: u32,
    /// The number of triangles around that corner.
    pub(super) around_opposite: u8,
    /// The class of the smallest angle of the triangle.
    pub(super) angle: AngleClass,
    /// Whether there is a triangle beyond each of its other edges: that to the first corner of the joint,
    /// and that to the second.
    pub(super) has_beyond: [bool; 2],
}

impl MeshedPart {
    /// The mesh of the part with this `number` among these `points`, which are at home in it or around it, at `spacing`
    /// (CRS units); `rules` say which of them have triangles, and how those are chosen.
    pub(crate) fn new(
        number: u32,
        mut points: Vec<MeshPoint>,
        quantization: &Quantization,
        spacing: f64,
        rules: MeshRules,
    ) -> Self {
        points.par_sort_unstable_by_key(|point| (point.point, point.index));
        let own = points.iter().filter(|point| point.home == number).count() as u64;
        // Of several points in one place the first takes part.
        points.dedup_by_key(|point| point.point);
        let positions: Vec<Local> = points
            .iter()
            .map(|point| quantization.local(point.point))
            .collect();
        let mut normals: Vec<Option<Local>> = points.iter().map(|point| point.normal).collect();
        if rules.points == MeshedPoints::All {
            estimated_normals::estimate(&positions, &mut normals, spacing);
        }
        let is_loose = |(point, normal): &(&MeshPoint, &Option<Local>)| {
            point.home == number && normal.is_none()
        };
        let loose = points.iter().zip(&normals).filter(is_loose).count() as u64;
        let mut triangles = triangulate(&positions, &normals, spacing);
        let clutter = match rules.points {
            MeshedPoints::Surfaces => clutter::take(&positions, &normals, &mut triangles),
            MeshedPoints::All => Vec::new(),
        };
        if rules.keeps_edges {
            // Normals that were estimated are no planes of the scan.
            let scanned: Vec<Option<Local>> = points.iter().map(|point| point.normal).collect();
            diagonals::turn(&positions, &scanned, spacing, &mut triangles);
        }
        let mut around = vec![0_u8; points.len()];
        for &corner in triangles.iter().flatten() {
            let count = &mut around[corner as usize];
            *count = count.saturating_add(1);
        }
        let mut part = Turned::new(number, &points, &positions, triangles).part(&around);
        let is_at_home = |corners: &&Corners| points[corners[0] as usize].home == number;
        part.figures.clutter = clutter.iter().filter(is_at_home).count() as u64;
        part.figures.loose = loose;
        part.figures.corners = part.corners.len() as u64;
        part.figures.unused = own - loose - part.figures.corners;
        part
    }
}

impl Turned<'_> {
    /// The joints that are at home in the part; there are so many triangles `around` each point.
    fn joints(&self, around: &[u8]) -> Vec<Joint> {
        let joint = |(edge, triangles): ([u32; 2], EdgeTriangles<'_>)| {
            let [one, other] = triangles.both().filter(|_| self.is_own(edge[0]))?;
            let tips = [one.1, other.1];
            let turns = [one, other].map(|(triangle, _)| self.turns[triangle as usize]);
            let is_reversed = runs_alike(edge, tips) ^ turns[0].1 ^ turns[1].1;
            if turns[0].0 == turns[1].0 && !is_reversed {
                return None;
            }
            let side = |k: usize| JointSide {
                component: turns[k].0,
                opposite: self.points[tips[k] as usize].index,
                around_opposite: around[tips[k] as usize],
                angle: AngleClass::of(least_angle_cosine(places(
                    self.positions,
                    [edge[0], edge[1], tips[k]],
                ))),
                has_beyond: edge.map(|corner| self.edges.of(corner, tips[k]).len() > 1),
            };
            let mut joint = Joint {
                edge: edge.map(|corner| self.points[corner as usize].index),
                sides: [side(0), side(1)],
                cosine: self.cosine(edge, tips) as f32,
                is_reversed,
            };
            if joint.edge[0] > joint.edge[1] {
                joint.edge.reverse();
                joint
                    .sides
                    .iter_mut()
                    .for_each(|side| side.has_beyond.reverse());
            }
            Some(joint)
        };
        self.edges.all().filter_map(joint).collect()
    }

    /// The part of the whole mesh that these triangles are; there are so many triangles `around` each point.
    fn part(&self, around: &[u8]) -> MeshedPart {
        let mut part = MeshedPart {
            components: vec![Component::default(); self.components as usize],
            joints: self.joints(around),
            ..MeshedPart::default()
        };
        let index = |corner: u32| self.points[corner as usize].index;
        // For each point the triangle around it that is most parallel to its surface: how much it is, its component,
        // and whether the normal of the point is on its other side.
        let mut most_parallel = vec![(-1.0, u32::MAX, false); self.points.len()];
        for (k, &corners) in self.triangles.iter().enumerate() {
            let ((component, is_reversed), turned) = (self.turns[k], self.turned(k));
            let area = doubled_area(places(self.positions, turned));
            for corner in corners {
                let normal = self.points[corner as usize].normal.unwrap_or_default();
                let cosine = normal.dot(&area) / area.norm();
                if cosine.abs() > most_parallel[corner as usize].0 {
                    most_parallel[corner as usize] = (cosine.abs(), component, cosine < 0.0);
                }
            }
            if self.is_own(corners[0]) {
                let figures = &mut part.figures;
                let cosine = least_angle_cosine(places(self.positions, corners));
                figures.push_triangle(cosine);
                let ways = turned.map(|corner| self.points[corner as usize]);
                let seen = self.looks_at_scanner(turned);
                part.components[component as usize].add(ways.map(|point| point.point), seen);
                part.triangles.push(PartTriangle {
                    corners: turned.map(index),
                    component,
                });
            }
            if !corners.iter().all(|&corner| self.is_own(corner)) {
                let mut sorted = corners.map(index);
                // An odd permutation of the corners turns the triangle around.
                let is_odd = is_odd(sorted);
                sorted.sort_unstable();
                part.links.push(Link {
                    corners: sorted,
                    component,
                    is_reversed: is_reversed ^ is_odd,
                    known_by: distinct(corners.map(|corner| self.points[corner as usize].home)),
                });
            }
        }
        for ([first, _], triangles) in self.edges.all() {
            if self.is_own(first) {
                part.figures.inner_edges += u64::from(triangles.len() == 2);
                part.figures.border_edges += u64::from(triangles.len() == 1);
            }
        }
        part.corners = self
            .points
            .iter()
            .zip(most_parallel)
            .filter(|(point, (_, component, _))| {
                point.home == self.number && *component != u32::MAX
            })
            .map(|(point, (_, component, is_behind))| PartCorner {
                index: point.index,
                component,
                is_behind,
            })
            .collect();
        part
    }

    /// Whether a turned triangle looks towards the scanner, if one of its corners knows where that was.
    fn looks_at_scanner(&self, turned: Corners) -> Option<bool> {
        let places = places(self.positions, turned);
        let (corner, place) = turned
            .iter()
            .zip(places)
            .find(|&(&corner, _)| self.points[corner as usize].scanner.is_some())?;
        let scanner = self.points[*corner as usize].scanner?;
        Some(doubled_area(places).dot(&(scanner - place)) > 0.0)
    }
}

/// How many different numbers these are.
fn distinct([a, b, c]: [u32; 3]) -> u8 {
    1 + u8::from(b != a) + u8::from(c != a && c != b)
}

/// Whether sorting three different numbers takes an odd number of exchanges.
fn is_odd([a, b, c]: [u32; 3]) -> bool {
    (a > b) ^ (b > c) ^ (a > c)
}
