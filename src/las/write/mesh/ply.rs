//! A mesh as PLY: binary, little endian, world coordinates as doubles.
//!
//! An unknown normal is 0 0 0, because readers stop at NaN or spread it. Colours have 8 bits,
//! as programs for meshes expect them. Our own reader reads the vertices as a cloud: faces
//! stand behind them.

use std::{
    io::{self, Write},
    path::Path,
};

use super::{
    encoder::MeshEncoder,
    header::{ColorDepth, MeshHeader, MeshVertex},
};
use crate::las::{error::LasError, format::ply::first_lines};

/// The most vertices that the signed indices of PLY can count.
const MAX_VERTICES: u64 = i32::MAX as u64;
/// The corners of a face.
const CORNERS: u8 = 3;

/// The encoder of PLY.
pub(super) struct PlyEncoder {
    header_text: String,
    color_depth: Option<ColorDepth>,
}

impl PlyEncoder {
    /// An encoder for the mesh of `header`, which is to become `path`.
    ///
    /// # Errors
    ///
    /// If indices cannot count the vertices.
    pub(super) fn new(path: &Path, header: &MeshHeader) -> Result<Self, LasError> {
        if header.vertices > MAX_VERTICES {
            let problem = format!(
                "the mesh has {} vertices, but PLY can count {MAX_VERTICES}; write it in tiles",
                header.vertices
            );
            return Err(LasError::new(path, problem));
        }
        Ok(Self {
            header_text: header_text(header),
            color_depth: ColorDepth::of(header),
        })
    }
}

fn header_text(header: &MeshHeader) -> String {
    let mut text = first_lines(header.crs.as_ref());
    text += &format!("element vertex {}\n", header.vertices);
    for name in ["x", "y", "z"] {
        text += &format!("property double {name}\n");
    }
    for name in ["nx", "ny", "nz"] {
        text += &format!("property float {name}\n");
    }
    if header.brightest_color.is_some() {
        for name in ["red", "green", "blue"] {
            text += &format!("property uchar {name}\n");
        }
    }
    text += &format!("element face {}\n", header.triangles);
    text += "property list uchar int vertex_indices\nend_header\n";
    text
}

impl MeshEncoder for PlyEncoder {
    fn write_header(&self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(self.header_text.as_bytes())
    }

    fn write_vertices(&self, vertices: &[MeshVertex], out: &mut dyn Write) -> io::Result<()> {
        for vertex in vertices {
            let mut bytes = [0; 39];
            for (axis, c) in vertex.position.iter().enumerate() {
                bytes[8 * axis..8 * axis + 8].copy_from_slice(&c.to_le_bytes());
            }
            let normal = vertex.unit_normal().unwrap_or_default();
            for (axis, n) in normal.iter().enumerate() {
                bytes[24 + 4 * axis..28 + 4 * axis].copy_from_slice(&n.to_le_bytes());
            }
            let mut length = 36;
            if let Some(depth) = self.color_depth {
                bytes[36..39].copy_from_slice(&depth.in_bytes(vertex.color));
                length = 39;
            }
            out.write_all(&bytes[..length])?;
        }
        Ok(())
    }

    fn write_triangles(&self, triangles: &[[u32; 3]], out: &mut dyn Write) -> io::Result<()> {
        for triangle in triangles {
            let mut bytes = [CORNERS; 13];
            for (corner, index) in triangle.iter().enumerate() {
                bytes[1 + 4 * corner..5 + 4 * corner].copy_from_slice(&index.to_le_bytes());
            }
            out.write_all(&bytes)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::{PlyFile, format::crs::Crs, write::mesh::samples::Sample};

    #[test]
    fn our_own_reader_reads_the_vertices_as_a_cloud() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("sphere.ply");
        let sphere = Sample::sphere();
        sphere.write(&path).unwrap();
        let mut stream = PlyFile::survey(&path).unwrap().open().unwrap();
        for vertex in &sphere.vertices {
            assert_eq!(stream.next_position().unwrap(), Some(vertex.position));
        }
        assert_eq!(stream.next_position().unwrap(), None);
    }

    #[test]
    fn vertices_and_faces_are_records_of_known_length() {
        let sphere = Sample::sphere();
        let bytes = sphere.bytes("ply");
        let end = bytes.windows(11).position(|line| line == b"end_header\n");
        let body = &bytes[end.unwrap() + 11..];
        let (vertices, faces) = body.split_at(39 * sphere.vertices.len());
        for (record, vertex) in vertices.chunks(39).zip(&sphere.vertices) {
            assert_eq!(record[8..16], vertex.position[1].to_le_bytes());
            assert_eq!(record[36..39], vertex.color.map(|c| (c >> 8) as u8));
        }
        assert_eq!(vertices[24..36], [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 128, 63]);
        // The last vertex has no normal.
        assert_eq!(vertices[vertices.len() - 15..][..12], [0; 12]);
        assert_eq!(faces.len(), 13 * sphere.triangles.len());
        for (record, triangle) in faces.chunks(13).zip(&sphere.triangles) {
            assert_eq!(record[0], 3);
            assert_eq!(record[9..13], triangle[2].to_le_bytes());
        }
    }

    #[test]
    fn more_vertices_than_indices_can_count_are_refused() {
        let mut header = Sample::sphere().header();
        header.vertices = 1 << 31;
        let error = PlyEncoder::new(Path::new("a.ply"), &header).err().unwrap();
        assert!(error.to_string().contains("tiles"), "{error}");
        header.vertices -= 1;
        assert!(PlyEncoder::new(Path::new("a.ply"), &header).is_ok());
    }

    #[test]
    fn the_crs_is_a_comment_that_our_own_reader_knows() {
        let mut header = Sample::sphere().header();
        header.crs = Some(Crs::Wkt("PROJCS[\"a\",\n UNIT[\"m\",1]]".to_owned()));
        let text = header_text(&header);
        assert!(
            text.contains("\ncomment crs PROJCS[\"a\", UNIT[\"m\",1]]\n"),
            "{text}"
        );
    }
}
