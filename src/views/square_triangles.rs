//! The triangles within the square of the 3-D viewer, collected while the mesh is written.
//!
//! A mesh refers to its points by their numbers, and the viewer sample has an order of its own: between the two a
//! triangle is known by the positions of its corners, as stored.

use crate::geometry::{Rect, Stored};

/// The square that the viewer shows, with the triangles of the mesh in it.
///
/// An edge of a mesh has at most two triangles, so a square has about two triangles for each point of the output; the
/// expected number of those is limited when the square is chosen.
#[derive(Debug)]
pub(crate) struct SquareTriangles {
    /// The square; `None` if there is nothing to show.
    pub(crate) square: Option<Rect>,
    /// The points in the square by their numbers in the mesh, in ascending order.
    points: Vec<(u32, Stored)>,
    /// The triangles whose corners are all in the square; the corners run counterclockwise, seen from the front.
    pub(super) triangles: Vec<[Stored; 3]>,
}

impl SquareTriangles {
    /// No triangles yet, in `square`.
    pub(super) fn new(square: Option<Rect>) -> Self {
        Self {
            square,
            points: Vec::new(),
            triangles: Vec::new(),
        }
    }

    /// Adds those of `points` that are in the square; the first one has the number `first` in the mesh. Numbers
    /// must grow from call to call.
    pub(crate) fn add_points(&mut self, first: u32, points: impl Iterator<Item = Stored>) {
        if let Some(square) = self.square {
            let numbered = (first..).zip(points);
            self.points
                .extend(numbered.filter(|(_, point)| square.contains(*point)));
        }
    }

    /// Adds those of `triangles` whose corners are all in the square. Their points must have been added.
    pub(crate) fn add_triangles(&mut self, triangles: &[[u32; 3]]) {
        // The numbers of the points of a cell are near each other, and most cells are outside of the square.
        let firsts = || triangles.iter().map(|corners| corners[0]);
        let (Some(low), Some(high)) = (firsts().min(), firsts().max()) else {
            return;
        };
        let next = self.points.partition_point(|&(number, _)| number < low);
        if self
            .points
            .get(next)
            .is_none_or(|&(number, _)| number > high)
        {
            return;
        }
        for &[a, b, c] in triangles {
            if let (Some(a), Some(b), Some(c)) = (self.point(a), self.point(b), self.point(c)) {
                self.triangles.push([a, b, c]);
            }
        }
    }

    /// The point with this number in the mesh, if it is in the square.
    fn point(&self, number: u32) -> Option<Stored> {
        let found = self.points.binary_search_by_key(&number, |point| point.0);
        found.ok().map(|index| self.points[index].1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_is_shown_if_its_three_corners_are_in_the_square() {
        let mut seen = SquareTriangles::new(Some(Rect {
            min: [0, 0],
            max: [10, 10],
        }));
        let point = |x: i32| Stored { x, y: 5, z: 0 };
        seen.add_points(0, [20, 1, 2].map(point).into_iter());
        seen.add_points(3, [10, 3, 4].map(point).into_iter());
        seen.add_triangles(&[[0, 1, 2]]);
        seen.add_triangles(&[[1, 4, 2], [2, 3, 4], [2, 4, 5]]);
        seen.add_triangles(&[]);
        let shown = [[1, 3, 2], [2, 3, 4]].map(|xs| xs.map(point));
        assert_eq!(seen.triangles, shown);
        let mut nothing = SquareTriangles::new(None);
        nothing.add_points(0, [1, 2, 3].map(point).into_iter());
        nothing.add_triangles(&[[0, 1, 2]]);
        assert!(nothing.triangles.is_empty());
    }
}
