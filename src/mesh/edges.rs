//! The edges of triangles, and the triangles on each.

use super::{Corners, by_corner::sorted_by_corner, triangle::edges};

/// The edges of triangles: every edge with the triangles on it.
pub(super) struct EdgeTable {
    /// The edge, its smaller corner first; the index of a triangle on it, and the corner opposite.
    /// Sorted.
    entries: Vec<([u32; 2], (u32, u32))>,
}

impl EdgeTable {
    /// The edges of `triangles`.
    pub(super) fn new(triangles: &[Corners]) -> Self {
        let of_triangle = |(k, &corners): (usize, &Corners)| {
            edges(corners).map(|(edge, opposite)| (edge, (k as u32, opposite)))
        };
        let entries = triangles.iter().enumerate().flat_map(of_triangle).collect();
        Self {
            entries: sorted_by_corner(entries, |(edge, _)| edge[0]),
        }
    }

    /// All edges in their order, each with its triangles as their indices and the corners opposite to the edge.
    pub(super) fn all(&self) -> impl Iterator<Item = ([u32; 2], EdgeTriangles<'_>)> {
        self.entries
            .chunk_by(|a, b| a.0 == b.0)
            .map(|same| (same[0].0, EdgeTriangles(same)))
    }

    /// The triangles on the edge between two corners.
    pub(super) fn of(&self, one: u32, other: u32) -> EdgeTriangles<'_> {
        let edge = if one < other {
            [one, other]
        } else {
            [other, one]
        };
        let from = self.entries.partition_point(|entry| entry.0 < edge);
        let count = self.entries[from..]
            .iter()
            .take_while(|entry| entry.0 == edge)
            .count();
        EdgeTriangles(&self.entries[from..from + count])
    }
}

/// The triangles on an edge.
#[derive(Clone, Copy)]
pub(super) struct EdgeTriangles<'a>(&'a [([u32; 2], (u32, u32))]);

impl<'a> EdgeTriangles<'a> {
    /// Their number.
    pub(super) fn len(self) -> usize {
        self.0.len()
    }

    /// The index of each, and its corner opposite to the edge.
    pub(super) fn iter(self) -> impl Iterator<Item = &'a (u32, u32)> {
        self.0.iter().map(|(_, triangle)| triangle)
    }

    /// The index and the opposite corner of each of the two triangles of an inner edge.
    pub(super) fn both(self) -> Option<[(u32, u32); 2]> {
        match self.0 {
            [(_, one), (_, other)] => Some([*one, *other]),
            _ => None,
        }
    }

    /// The index and the opposite corner of the only triangle of a border edge.
    pub(super) fn only(self) -> Option<(u32, u32)> {
        match self.0 {
            [(_, triangle)] => Some(*triangle),
            _ => None,
        }
    }
}
