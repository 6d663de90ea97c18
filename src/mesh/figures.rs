//! The figures of a mesh.

use serde::{Deserialize, Serialize};

/// Width of a class of the histogram of angles, in degrees.
const CLASS: f64 = 0.5;
/// Classes of the histogram: no triangle has a smallest angle of more than 60°.
const CLASSES: usize = 121;

/// A class of the histogram of angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct AngleClass(u8);

impl AngleClass {
    /// The class of the angle with this cosine.
    pub(super) fn of(cosine: f64) -> Self {
        let angle = cosine.clamp(-1.0, 1.0).acos().to_degrees();
        Self(((angle / CLASS) as usize).min(CLASSES - 1) as u8)
    }
}

/// What is counted of a mesh; the counts of its parts add up.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct MeshFigures {
    /// The number of triangles.
    pub(crate) triangles: u64,
    /// The number of points that are corners of triangles.
    pub(crate) corners: u64,
    /// The number of points with a normal that are no corner of any triangle.
    pub(crate) unused: u64,
    /// The number of points without a normal, which have no triangles.
    pub(crate) loose: u64,
    /// The number of edges with two triangles.
    pub(crate) inner_edges: u64,
    /// The number of edges with one triangle.
    pub(crate) border_edges: u64,
    /// The number of components: triangles that hang together by their edges.
    pub(crate) components: u64,
    /// The number of triangles that were cut out, because those around a loop cannot all be turned the same way, as on a
    /// strip of Möbius.
    pub(crate) cut: u64,
    /// The number of triangles that were left out as clutter: they belong to no surface.
    pub(crate) clutter: u64,
    /// The number of triangles whose smallest angle lies within each half degree.
    angles: Vec<u64>,
}

impl Default for MeshFigures {
    fn default() -> Self {
        Self {
            triangles: 0,
            corners: 0,
            unused: 0,
            loose: 0,
            inner_edges: 0,
            border_edges: 0,
            components: 0,
            cut: 0,
            clutter: 0,
            angles: vec![0; CLASSES],
        }
    }
}

impl MeshFigures {
    /// Counts a triangle whose smallest angle has this cosine.
    pub(crate) fn push_triangle(&mut self, cosine: f64) {
        self.triangles += 1;
        self.angles[usize::from(AngleClass::of(cosine).0)] += 1;
    }

    /// Takes off a triangle whose smallest angle is of this class.
    pub(super) fn take_off_triangle(&mut self, angle: AngleClass) {
        self.triangles -= 1;
        self.angles[usize::from(angle.0)] -= 1;
    }

    /// Adds the counts of another part of the mesh.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.triangles += other.triangles;
        self.corners += other.corners;
        self.unused += other.unused;
        self.loose += other.loose;
        self.inner_edges += other.inner_edges;
        self.border_edges += other.border_edges;
        self.components += other.components;
        self.cut += other.cut;
        self.clutter += other.clutter;
        for (count, other) in self.angles.iter_mut().zip(&other.angles) {
            *count += other;
        }
    }

    /// The angle in degrees below which the smallest angles of this `share` of the triangles lie, to half a degree;
    /// NaN without triangles.
    pub(crate) fn angle(&self, share: f64) -> f64 {
        let mut left = share * self.triangles as f64;
        for (class, &count) in self.angles.iter().enumerate() {
            left -= count as f64;
            if left <= 0.0 && count > 0 {
                return (class as f64 + 0.5) * CLASS;
            }
        }
        f64::NAN
    }

    /// The number of triangles by their smallest angle, in classes of half a degree from 0° to 60°.
    pub(crate) fn angles(&self) -> &[u64] {
        &self.angles
    }

    /// Corners − edges + triangles: 2 for a mesh like a sphere, 0 for one like a torus.
    pub(crate) fn euler_characteristic(&self) -> i64 {
        let edges = self.inner_edges + self.border_edges;
        self.corners as i64 - edges as i64 + self.triangles as i64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_triangles_lie_below_their_angles() {
        let mut figures = MeshFigures::default();
        for angle in [30.2_f64, 50.2, 50.3, 60.0] {
            figures.push_triangle(angle.to_radians().cos());
        }
        let mut both = figures.clone();
        both.merge(&figures);
        assert_eq!(both.triangles, 8);
        assert_eq!(both.angle(0.0), 30.25);
        assert_eq!(both.angle(0.5), 50.25);
        assert!((both.angle(1.0) - 60.0).abs() < 0.5);
        assert!(MeshFigures::default().angle(0.5).is_nan());
    }
}
