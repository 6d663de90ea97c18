//! The components of a mesh over all of its parts, each turned to one side.
//!
//! Triangles hang together by the smooth edges inside of a cell first, then by all others, the flattest first. Where two
//! triangles that hang together another way would have to be turned in opposite directions, as on a strip of Möbius,
//! one of them is *cut* out of the mesh. Cells have fixed places, and parts consist of whole cells, so that parts do not
//! show.

use std::collections::{HashMap, HashSet};

use super::{
    Corners, MeshFigures,
    component::Component,
    joined::{Joined, Joining},
    part::{Joint, MeshedPart},
};

/// The components of a mesh, as they are joined while its parts come in.
#[derive(Debug, Default)]
pub(crate) struct Sides {
    /// The components of all parts.
    joined: Joined,
    components: Vec<Component>,
    /// The triangles that another part will know as well.
    open: HashMap<Corners, OpenLink>,
    /// The joints, with the components of their sides among all.
    joints: Vec<Joint>,
}

/// A triangle that another part will know as well.
#[derive(Clone, Copy, Debug)]
struct OpenLink {
    /// Its component in the first part that knew it.
    component: u32,
    /// Whether that part reversed it.
    is_reversed: bool,
    /// The number of parts that are still to come.
    expected: u8,
}

impl Sides {
    /// Takes the components, links and joints of a part, and joins what links name. Returns the number of the first
    /// one among all.
    pub(crate) fn add(&mut self, part: &mut MeshedPart) -> u32 {
        let first = self.joined.push(part.components.len());
        self.components.append(&mut part.components);
        for mut edge in part.joints.drain(..) {
            edge.sides
                .iter_mut()
                .for_each(|side| side.component += first);
            self.joints.push(edge);
        }
        for link in part.links.drain(..) {
            let component = first + link.component;
            let open = self.open.entry(link.corners).or_insert(OpenLink {
                component,
                is_reversed: link.is_reversed,
                expected: link.known_by,
            });
            open.expected -= 1;
            let OpenLink {
                component: other,
                is_reversed,
                expected,
            } = *open;
            if expected == 0 {
                self.open.remove(&link.corners);
            }
            // One of the two components is nothing but this triangle, so that it cannot be joined in the other way.
            self.join(component, other, link.is_reversed ^ is_reversed);
        }
        first
    }

    /// Joins two components, one of which is turned around if `is_reversed`; `false` if they are joined in
    /// the other way already.
    fn join(&mut self, one: u32, other: u32, is_reversed: bool) -> bool {
        let joining = self.joined.join(one, other, is_reversed);
        if let Joining::New {
            root,
            joined,
            is_reversed,
        } = joining
        {
            let component = std::mem::take(&mut self.components[joined as usize]);
            self.components[root as usize].merge(&component, is_reversed);
        }
        joining != Joining::Conflict
    }

    /// Joins components at their joints, and settles the side of each. The counts of what is cut out are
    /// taken off the `figures`.
    pub(crate) fn settle(mut self, figures: &mut MeshFigures) -> SettledSides {
        let mut joints = std::mem::take(&mut self.joints);
        joints.sort_unstable_by(|a, b| a.cosine.total_cmp(&b.cosine).then(a.edge.cmp(&b.edge)));
        let mut cuts = Cuts::default();
        for edge in joints {
            let [one, other] = edge.sides.map(|side| side.component);
            if !self.join(one, other, edge.is_reversed) {
                cuts.cut(&edge, figures);
            }
        }
        let roots: Vec<(u32, bool)> = (0..self.joined.len())
            .map(|k| self.joined.root(k))
            .collect();
        let is_reversed = roots
            .iter()
            .map(|&(root, turn)| turn ^ self.components[root as usize].looks_away())
            .collect();
        let is_whole = |&(k, &(root, _)): &(u32, &(u32, bool))| {
            root == k && self.components[k as usize].triangles > 0
        };
        figures.components = (0..).zip(&roots).filter(is_whole).count() as u64;
        figures.cut = cuts.triangles.len() as u64;
        SettledSides {
            is_reversed,
            cut: cuts.triangles,
        }
    }
}

/// Triangles that are cut out of a mesh.
#[derive(Debug, Default)]
struct Cuts {
    triangles: HashSet<Corners>,
    /// The number of triangles that are left on each edge of those.
    on_edges: HashMap<[u32; 2], u8>,
    /// The number of triangles that are left around corners of those.
    around: HashMap<u32, u8>,
}

impl Cuts {
    /// Cuts one of the triangles on `edge` out of the mesh, unless one is already, and takes it off the `figures`.
    fn cut(&mut self, edge: &Joint, figures: &mut MeshFigures) {
        let [from, to] = edge.edge;
        let corners = edge.sides.map(|side| {
            let mut corners = [from, to, side.opposite];
            corners.sort_unstable();
            corners
        });
        if corners
            .iter()
            .any(|corners| self.triangles.contains(corners))
        {
            return;
        }
        // The one with fewer neighbours, which leaves the smaller hole.
        let neighbors = edge
            .sides
            .map(|side| side.has_beyond.iter().filter(|&&has| has).count());
        let k = usize::from(neighbors[1] < neighbors[0]);
        let (side, corners) = (edge.sides[k], corners[k]);
        self.triangles.insert(corners);
        figures.take_off_triangle(side.angle);
        let first = [from.min(side.opposite), from.max(side.opposite)];
        let second = [to.min(side.opposite), to.max(side.opposite)];
        let counts = [true, side.has_beyond[0], side.has_beyond[1]];
        for (edge, has_beyond) in [edge.edge, first, second].into_iter().zip(counts) {
            let left = self
                .on_edges
                .entry(edge)
                .or_insert(1 + u8::from(has_beyond));
            *left -= 1;
            match left {
                0 => figures.border_edges -= 1,
                _ => {
                    figures.inner_edges -= 1;
                    figures.border_edges += 1;
                }
            }
        }
        let around = self
            .around
            .entry(side.opposite)
            .or_insert(side.around_opposite);
        *around = around.saturating_sub(1);
        if *around == 0 {
            figures.corners -= 1;
            figures.unused += 1;
        }
    }
}

/// The sides of a whole mesh.
#[derive(Debug)]
pub(crate) struct SettledSides {
    is_reversed: Vec<bool>,
    /// The triangles that are cut out, each with its corners in ascending order.
    cut: HashSet<Corners>,
}

impl SettledSides {
    /// Whether the triangles of a component of a part, by its number among all, must be turned around.
    pub(crate) fn is_reversed(&self, component: u32) -> bool {
        self.is_reversed[component as usize]
    }

    /// The triangle with these `corners` and the component of this number among all, turned to its side; `None`
    /// if it is cut out of the mesh.
    pub(crate) fn turned(&self, corners: Corners, component: u32) -> Option<Corners> {
        if !self.cut.is_empty() {
            let mut sorted = corners;
            sorted.sort_unstable();
            if self.cut.contains(&sorted) {
                return None;
            }
        }
        let [a, b, c] = corners;
        Some(match self.is_reversed(component) {
            true => [a, c, b],
            false => [a, b, c],
        })
    }
}
