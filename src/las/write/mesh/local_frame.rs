//! Coordinates of single precision around an origin.
//!
//! Single precision has 24 bits: of UTM coordinates it keeps half a metre. Positions that are
//! relative to an origin in the middle of the mesh lose less than the 16-millionth part of
//! their distance from it, which is 0.03 mm at half a kilometre.

use super::header::MeshHeader;

/// A frame with its own origin and the axes of the CRS: east, north, up.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalFrame {
    /// The world coordinates of the origin (CRS units).
    pub(super) origin: [f64; 3],
}

impl LocalFrame {
    /// The frame of a mesh: at the origin of its header, or at the centre of its bounds,
    /// rounded to whole units.
    pub(super) fn of(header: &MeshHeader) -> Self {
        let [min, max] = header.bounds;
        let centre = match header.vertices {
            0 => [0.0; 3],
            _ => [0, 1, 2].map(|axis| (0.5 * min[axis] + 0.5 * max[axis]).round()),
        };
        Self {
            origin: header.origin.unwrap_or(centre),
        }
    }

    /// The local coordinates of a position (CRS units). Each grows with the world coordinate
    /// or stays equal, so that the bounds of positions become the bounds of their local
    /// coordinates.
    pub(super) fn local(&self, world: [f64; 3]) -> [f32; 3] {
        [0, 1, 2].map(|axis| (world[axis] - self.origin[axis]) as f32)
    }

    /// The local coordinates of the bounds of positions.
    pub(super) fn local_bounds(&self, bounds: [[f64; 3]; 2]) -> [[f32; 3]; 2] {
        bounds.map(|corner| self.local(corner))
    }
}
