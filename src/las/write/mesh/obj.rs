//! A mesh as Wavefront OBJ: text, world coordinates.
//!
//! A coordinate has as many digits as it takes to read the same double again. Colours follow
//! the coordinates of their vertex, each between 0 and 1, as is the custom without a
//! standard. Every vertex has the normal of its own number; an unknown one is 0 0 0.

use std::{
    io::{self, Write},
    path::Path,
};

use super::{
    encoder::MeshEncoder,
    header::{ColorDepth, MeshHeader, MeshVertex},
};
use crate::las::{error::LasError, format::crs::Crs};

/// The encoder of OBJ.
pub(super) struct ObjEncoder {
    crs_line: String,
    color_depth: Option<ColorDepth>,
}

impl ObjEncoder {
    /// An encoder for the mesh of `header`, which is to become `path`.
    ///
    /// # Errors
    ///
    /// If 32 bits cannot count the vertices.
    pub(super) fn new(path: &Path, header: &MeshHeader) -> Result<Self, LasError> {
        let most = u64::from(u32::MAX);
        if header.vertices > most {
            let problem = format!(
                "the mesh has {} vertices, but one file can have {most}; write it in tiles",
                header.vertices
            );
            return Err(LasError::new(path, problem));
        }
        let wkt = header.crs.as_ref().and_then(Crs::wkt_in_one_line);
        let crs_line = wkt.map(|wkt| format!("# crs {wkt}\n"));
        Ok(Self {
            crs_line: crs_line.unwrap_or_default(),
            color_depth: ColorDepth::of(header),
        })
    }
}

impl MeshEncoder for ObjEncoder {
    fn write_header(&self, out: &mut dyn Write) -> io::Result<()> {
        write!(out, "# lloydar\n{}", self.crs_line)
    }

    fn write_vertices(&self, vertices: &[MeshVertex], out: &mut dyn Write) -> io::Result<()> {
        for vertex in vertices {
            let [x, y, z] = vertex.position;
            write!(out, "v {x} {y} {z}")?;
            if let Some(depth) = self.color_depth {
                for c in depth.in_bytes(vertex.color) {
                    // Four digits distinguish 256 values.
                    write!(out, " {:.4}", f64::from(c) / f64::from(u8::MAX))?;
                }
            }
            let [x, y, z] = vertex.unit_normal().unwrap_or_default();
            write!(out, "\nvn {x:.5} {y:.5} {z:.5}\n")?;
        }
        Ok(())
    }

    fn write_triangles(&self, triangles: &[[u32; 3]], out: &mut dyn Write) -> io::Result<()> {
        for triangle in triangles {
            let [a, b, c] = triangle.map(|index| u64::from(index) + 1);
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::las::write::mesh::samples::Sample;

    #[test]
    fn coordinates_are_read_again_to_the_bit_and_corners_are_counted_from_one() {
        let sphere = Sample::sphere();
        let text = String::from_utf8(sphere.bytes("obj")).unwrap();
        let lines = |kind: &'static str| {
            let lines = text.lines().map(|line| line.split(' ').collect::<Vec<_>>());
            lines.filter(move |words| words[0] == kind)
        };
        for (words, vertex) in lines("v").zip(&sphere.vertices) {
            let values: Vec<f64> = words[1..]
                .iter()
                .map(|word| word.parse().unwrap())
                .collect();
            assert_eq!(values[..3], vertex.position);
            let bytes = [3, 4, 5].map(|column: usize| (values[column] * 255.0).round() as u16);
            assert_eq!(bytes, vertex.color.map(|c| c >> 8));
        }
        for (words, triangle) in lines("f").zip(&sphere.triangles) {
            let corners = triangle.map(|c| format!("{0}//{0}", c + 1));
            assert_eq!(words[1..], corners);
        }
        let counts = ["v", "vn", "f"].map(|kind| lines(kind).count());
        assert_eq!(counts, [482, 482, 960]);
        assert!(!text.contains("NaN"));
    }
}
