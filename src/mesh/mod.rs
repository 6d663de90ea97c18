//! Triangles between even points: a mesh of the surfaces that the points lie on.
//!
//! ```text
//!   points, normals ─► stars ─► agreement ─► holes ─► fringe ─► holes ─► clutter ─► diagonals ─► sides ─► oriented triangles
//! ```
//!
//! The **star** of a point are the triangles that its Voronoi cell on the surface names: one for each corner
//! of the cell, with the two neighbours that meet there. On a smooth surface the stars of the three points
//! name the same triangle, and together they are the restricted Delaunay triangulation. Where they differ,
//! **agreement** chooses, so that no two triangles overlap and no edge has more than two. **Holes** that
//! are narrower than a few spacings are closed; wider ones are borders. From their **fringe** slivers and loose ears are
//! taken away, and the holes closed that these kept open. **Clutter**, triangles that belong to no surface, is taken out. Where the points were brought onto sharp edges, **diagonals** that cut across one are turned. **Sides** turns
//! the triangles of a component the same way around.
//!
//! Every decision is made from what lies within [`MeshRules::reach_in_spacings`] of it, in an order that the positions
//! give. So the mesh of a part of a cloud is that of the whole cloud, away from the borders of the part.
//! Points without a normal, as those on wires and leaves, have no triangles unless they are asked for, and then clutter stays.

mod agreement;
mod by_corner;
mod clutter;
mod component;
mod diagonals;
mod edges;
mod estimated_normals;
mod figures;
mod fringe;
mod holes;
mod joined;
mod part;
#[cfg(test)]
mod pleats_tests;
mod point;
mod sides;
mod stars;
#[cfg(test)]
mod tests;
mod triangle;
mod turned;

pub(crate) use figures::MeshFigures;
pub(crate) use part::{MeshedPart, PartCorner, PartTriangle};
pub(crate) use point::MeshPoint;
pub(crate) use sides::{SettledSides, Sides};

use serde::{Deserialize, Serialize};

use crate::geometry::{Local, Quantization};

/// A triangle by the indices of its corners.
pub(crate) type Corners = [u32; 3];

/// Whatever is decided before clutter goes and diagonals are turned depends on nothing farther away than this, in spacings.
const REACH_IN_SPACINGS: f64 = estimated_normals::REACH
    + stars::REACH
    + agreement::REACH
    + 2.0 * holes::REACH
    + fringe::REACH
    + 2.0 * stars::LARGEST_CIRCUMRADIUS;

/// Which points of a cloud have triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum MeshedPoints {
    /// Those where the scan describes a surface, which have a normal; clutter is taken out.
    #[default]
    Surfaces,
    /// All points with neighbours around them; clutter stays.
    All,
}

/// How the triangles of a cloud are chosen.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MeshRules {
    /// Which points have triangles.
    pub(crate) points: MeshedPoints,
    /// Whether diagonals that cut across a sharp edge are turned: the points there are on the planes that meet in it.
    pub(crate) keeps_edges: bool,
}

impl MeshRules {
    /// Whatever is decided depends on nothing farther away than this, in spacings.
    pub(crate) fn reach_in_spacings(self) -> f64 {
        let of_clutter = match self.points {
            MeshedPoints::Surfaces => clutter::REACH,
            MeshedPoints::All => 0.0,
        };
        let of_diagonals = match self.keeps_edges {
            true => diagonals::REACH,
            false => 0.0,
        };
        REACH_IN_SPACINGS + of_clutter + of_diagonals
    }
}

/// Triangles between `positions`, each with its corners in ascending order; they are not turned
/// towards a side yet. A point without a normal has no triangle.
///
/// `positions` must be sorted in an order that the positions alone give, and be distinct.
pub(crate) fn triangulate(
    positions: &[Local],
    normals: &[Option<Local>],
    spacing: f64,
) -> Vec<Corners> {
    let candidates = stars::candidates(positions, normals, spacing);
    let mut triangles = agreement::agreed(positions, candidates);
    let may_be_border = holes::close(positions, spacing, &mut triangles);
    fringe::trim(positions, spacing, may_be_border, &mut triangles);
    // An ear that stood in the way of others left a hole open.
    holes::close(positions, spacing, &mut triangles);
    triangles
}

/// The oriented triangles on the surfaces of a cloud that is one part, each with the first of its corners by position
/// first, in ascending order; and the figures of the mesh.
pub(crate) fn mesh_of_whole(
    points: Vec<MeshPoint>,
    quantization: &Quantization,
    spacing: f64,
) -> (Vec<Corners>, MeshFigures) {
    let mut part = MeshedPart::new(0, points, quantization, spacing, MeshRules::default());
    let mut sides = Sides::default();
    sides.add(&mut part);
    let MeshedPart {
        triangles,
        mut figures,
        ..
    } = part;
    let sides = sides.settle(&mut figures);
    let mut turned: Vec<Corners> = triangles
        .into_iter()
        .filter_map(|triangle| sides.turned(triangle.corners, triangle.component))
        .collect();
    turned.sort_unstable();
    (turned, figures)
}
