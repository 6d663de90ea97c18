//! A mesh as its writer receives it: what is known before it is written, and its vertices.

use crate::las::format::crs::Crs;

/// The greatest difference from one of the squared length of a normal that is a unit normal.
const UNIT_TOLERANCE: f32 = 0.01;

/// What is known of a mesh before it is written.
#[derive(Clone, Debug)]
pub(crate) struct MeshHeader {
    /// The exact number of vertices.
    pub(crate) vertices: u64,
    /// The exact number of triangles.
    pub(crate) triangles: u64,
    /// The greatest red, green or blue value of the vertices; `None` if they have no colours.
    /// Up to 255 colours are taken as 8 bits that were stored in 16, beyond that as 16 bits.
    /// The tiles of a tileset share the value of the whole mesh.
    pub(crate) brightest_color: Option<u16>,
    /// The least and the greatest world coordinates (CRS units) of all vertices, exactly:
    /// both are attained. Without vertices they have no meaning.
    pub(crate) bounds: [[f64; 3]; 2],
    /// The origin of the coordinates in GLB (CRS units), which the tiles of a tileset share;
    /// `None` for the rounded centre of the bounds. Other formats do not use it.
    pub(crate) origin: Option<[f64; 3]>,
    /// The coordinate reference system.
    pub(crate) crs: Option<Crs>,
}

impl MeshHeader {
    /// Whether there is something to be seen: a mesh of vertices alone has no surface.
    pub(super) fn has_surface(&self) -> bool {
        self.vertices > 0 && self.triangles > 0
    }
}

/// A vertex of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MeshVertex {
    /// The world coordinates (CRS units).
    pub(crate) position: [f64; 3],
    /// The unit normal, pointing outwards; NaN if it is unknown.
    pub(crate) normal: [f32; 3],
    /// Red, green and blue as LAS has them; ignored if the mesh has no colours.
    pub(crate) color: [u16; 3],
}

impl MeshVertex {
    /// The normal; `None` if it is unknown, or not of unit length within half a percent.
    pub(super) fn unit_normal(&self) -> Option<[f32; 3]> {
        let length_squared: f32 = self.normal.iter().map(|n| n * n).sum();
        let is_unit = (length_squared - 1.0).abs() <= UNIT_TOLERANCE;
        is_unit.then_some(self.normal)
    }
}

/// How the colours of a mesh become 8 bits: the rule that pictures of clouds follow, too.
#[derive(Clone, Copy, Debug)]
pub(super) struct ColorDepth {
    shift: u32,
}

impl ColorDepth {
    /// The depth of the colours of a mesh; `None` if it has no colours.
    pub(super) fn of(header: &MeshHeader) -> Option<Self> {
        let brightest = header.brightest_color?;
        let shift = if brightest > u8::MAX.into() { 8 } else { 0 };
        Some(Self { shift })
    }

    /// The upper 8 bits of each value, or all of it where colours have 8 bits.
    pub(super) fn in_bytes(self, color: [u16; 3]) -> [u8; 3] {
        color.map(|c| (c >> self.shift) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_without_unit_length_is_unknown() {
        let of = |normal| {
            MeshVertex {
                position: [0.0; 3],
                normal,
                color: [0; 3],
            }
            .unit_normal()
        };
        assert_eq!(of([0.6, 0.0, -0.8]), Some([0.6, 0.0, -0.8]));
        assert_eq!(of([f32::NAN; 3]), None);
        assert_eq!(of([0.0; 3]), None);
        assert_eq!(of([1.0, 1.0, 0.0]), None);
    }

    #[test]
    fn colours_of_eight_bits_in_sixteen_stay_bright() {
        assert_eq!(
            ColorDepth { shift: 8 }.in_bytes([65_280, 256, 255]),
            [255, 1, 0]
        );
        assert_eq!(ColorDepth { shift: 0 }.in_bytes([255, 1, 0]), [255, 1, 0]);
    }
}
