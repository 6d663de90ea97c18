//! A mesh as GLB: binary glTF 2.0, a JSON document and one buffer in a file.
//!
//! ```text
//!   "glTF" 2 length │ length "JSON" document, spaces │ length "BIN\0" vertices, indices
//! ```
//!
//! All lengths are known before the first vertex, so the file is written from front to back.
//! Colours of glTF are linear in light, those of photographs are not: they are converted by
//! the curve of sRGB (IEC 61966-2-1), to single precision: in 8 bits dark ones would become
//! one, and of 16 bits `MeshLab` takes the lower 8. An unknown normal points upwards, because
//! glTF knows unit normals only.

use std::{
    io::{self, Write},
    path::Path,
};

use super::{
    encoder::MeshEncoder,
    glb_document::{BufferLayout, glb_document},
    header::{ColorDepth, MeshHeader, MeshVertex},
    local_frame::LocalFrame,
};
use crate::las::error::LasError;

/// The first number of a GLB file, and the types of its chunks.
const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";
/// The lengths of the header of a file and of a chunk, in bytes.
const FILE_HEADER_BYTES: u64 = 12;
const CHUNK_HEADER_BYTES: u64 = 8;

/// The normal of a vertex whose normal is unknown.
const UPWARDS: [f32; 3] = [0.0, 0.0, 1.0];

/// The encoder of GLB.
pub(super) struct GlbEncoder {
    /// All bytes before the first vertex.
    header_bytes: Vec<u8>,
    frame: LocalFrame,
    has_surface: bool,
    colors: Option<LinearColors>,
}

impl GlbEncoder {
    /// An encoder for the mesh of `header`, which is to become `path`.
    ///
    /// # Errors
    ///
    /// If the file would be longer than its header can say, 4 GiB.
    pub(super) fn new(path: &Path, header: &MeshHeader) -> Result<Self, LasError> {
        let frame = LocalFrame::of(header);
        let mut document = glb_document(header, &frame).to_string().into_bytes();
        document.resize(document.len().next_multiple_of(4), b' ');
        let buffer = header
            .has_surface()
            .then(|| BufferLayout::of(header).bytes());
        let chunks = [Some(document.len() as u64), buffer];
        let chunk_bytes = chunks
            .iter()
            .flatten()
            .map(|&bytes| CHUNK_HEADER_BYTES.saturating_add(bytes));
        let length = chunk_bytes.fold(FILE_HEADER_BYTES, u64::saturating_add);
        let Ok(length) = u32::try_from(length) else {
            let problem = format!(
                "the mesh of {} vertices and {} triangles takes {length} bytes, but a GLB file \
                 is shorter than {}; write it in tiles",
                header.vertices,
                header.triangles,
                1_u64 << 32
            );
            return Err(LasError::new(path, problem));
        };
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        // Chunks are shorter than the file, whose length has 32 bits.
        bytes.extend((document.len() as u32).to_le_bytes());
        bytes.extend(JSON_CHUNK);
        bytes.extend(document);
        if let Some(buffer) = buffer {
            bytes.extend((buffer as u32).to_le_bytes());
            bytes.extend(BINARY_CHUNK);
        }
        Ok(Self {
            header_bytes: bytes,
            frame,
            has_surface: header.has_surface(),
            colors: ColorDepth::of(header).map(LinearColors::new),
        })
    }
}

impl MeshEncoder for GlbEncoder {
    fn write_header(&self, out: &mut dyn Write) -> io::Result<()> {
        out.write_all(&self.header_bytes)
    }

    fn write_vertices(&self, vertices: &[MeshVertex], out: &mut dyn Write) -> io::Result<()> {
        if !self.has_surface {
            return Ok(());
        }
        for vertex in vertices {
            let mut bytes = [0; 36];
            let position = self.frame.local(vertex.position);
            let normal = vertex.unit_normal().unwrap_or(UPWARDS);
            for (number, value) in position.into_iter().chain(normal).enumerate() {
                bytes[4 * number..4 * number + 4].copy_from_slice(&value.to_le_bytes());
            }
            let mut length = 24;
            if let Some(colors) = &self.colors {
                for (channel, value) in colors.of(vertex.color).into_iter().enumerate() {
                    bytes[24 + 4 * channel..28 + 4 * channel].copy_from_slice(&value.to_le_bytes());
                }
                length = 36;
            }
            out.write_all(&bytes[..length])?;
        }
        Ok(())
    }

    fn write_triangles(&self, triangles: &[[u32; 3]], out: &mut dyn Write) -> io::Result<()> {
        for index in triangles.as_flattened() {
            out.write_all(&index.to_le_bytes())?;
        }
        Ok(())
    }
}

/// Colours that are linear in light, from 0 to 1.
struct LinearColors {
    depth: ColorDepth,
    /// The linear value for each 8-bit value of sRGB.
    linear: [f32; 256],
}

impl LinearColors {
    fn new(depth: ColorDepth) -> Self {
        let linear = std::array::from_fn(|byte| {
            let c = byte as f64 / 255.0;
            let light = match c <= 0.04045 {
                true => c / 12.92,
                false => ((c + 0.055) / 1.055).powf(2.4),
            };
            light as f32
        });
        Self { depth, linear }
    }

    /// The linear red, green and blue of a colour.
    fn of(&self, color: [u16; 3]) -> [f32; 3] {
        let bytes = self.depth.in_bytes(color);
        bytes.map(|c| self.linear[usize::from(c)])
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::las::write::mesh::samples::{CENTRE, Sample};

    /// The chunks of a GLB file, by their types.
    fn chunks(bytes: &[u8]) -> Vec<(&[u8], &[u8])> {
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
        assert_eq!(&bytes[..4], MAGIC);
        assert_eq!([word(4), word(8)], [VERSION, bytes.len() as u32]);
        let mut chunks = Vec::new();
        let mut at = 12;
        while at < bytes.len() {
            let end = at + 8 + word(at) as usize;
            assert_eq!(end % 4, 0);
            chunks.push((&bytes[at + 4..at + 8], &bytes[at + 8..end]));
            at = end;
        }
        chunks
    }

    fn reals(bytes: &[u8]) -> Vec<f32> {
        let words = bytes.chunks(4).map(|word| word.try_into().unwrap());
        words.map(f32::from_le_bytes).collect()
    }

    #[test]
    fn positions_and_the_origin_are_the_world_coordinates() {
        let sphere = Sample::sphere();
        let bytes = sphere.bytes("glb");
        let chunks = chunks(&bytes);
        assert_eq!([chunks[0].0, chunks[1].0], [JSON_CHUNK, BINARY_CHUNK]);
        let document: Value = serde_json::from_slice(chunks[0].1).unwrap();
        let origin = CENTRE.map(f64::round);
        assert_eq!(document["nodes"][0]["extras"]["origin"], json!(origin));
        let (vertices, indices) = chunks[1].1.split_at(36 * sphere.vertices.len());
        let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for (record, vertex) in vertices.chunks(36).zip(&sphere.vertices) {
            let values = reals(&record[..24]);
            for axis in 0..3 {
                let world = origin[axis] + f64::from(values[axis]);
                assert!((world - vertex.position[axis]).abs() < 1e-6);
                bounds[0][axis] = bounds[0][axis].min(values[axis]);
                bounds[1][axis] = bounds[1][axis].max(values[axis]);
            }
            let length_squared: f32 = values[3..].iter().map(|n| n * n).sum();
            assert!((length_squared - 1.0).abs() < 1e-6);
            let color = reals(&record[24..]);
            assert_eq!(color[2] == 1.0, vertex.color[2] >= 255 << 8);
        }
        let accessors = &document["accessors"];
        assert_eq!(accessors[0]["min"], json!(bounds[0]));
        assert_eq!(accessors[0]["max"], json!(bounds[1]));
        let corners = sphere.triangles.as_flattened().iter();
        let expected: Vec<u8> = corners.flat_map(|corner| corner.to_le_bytes()).collect();
        assert_eq!(indices, expected);
    }

    #[test]
    fn without_a_surface_there_is_a_scene_without_a_mesh() {
        let cloud = Sample {
            triangles: Vec::new(),
            ..Sample::sphere()
        };
        for sample in [cloud, Sample::default()] {
            let bytes = sample.bytes("glb");
            let chunks = chunks(&bytes);
            assert_eq!(chunks.len(), 1);
            let document: Value = serde_json::from_slice(chunks[0].1).unwrap();
            assert_eq!(document["scenes"], json!([{}]));
            assert_eq!(document.get("meshes"), None);
        }
    }

    #[test]
    fn files_of_four_gibibytes_are_refused() {
        let mut header = Sample::sphere().header();
        let of = |header: &MeshHeader| GlbEncoder::new(Path::new("a.glb"), header);
        // 36 bytes a vertex, 12 a triangle; the document takes the rest.
        (header.vertices, header.triangles) = (1 << 26, 156_587_300);
        let error = of(&header).err().unwrap().to_string();
        assert!(error.contains("tiles"), "{error}");
        header.triangles -= 200;
        assert!(of(&header).is_ok());
        (header.vertices, header.triangles) = (u64::MAX, u64::MAX);
        assert!(of(&header).is_err());
    }

    #[test]
    fn colours_follow_the_curve_of_srgb() {
        let colors = LinearColors::new(ColorDepth::of(&Sample::sphere().header()).unwrap());
        assert_eq!(colors.linear[0], 0.0);
        assert_eq!(colors.linear[255], 1.0);
        assert!((colors.linear[128] - 0.215_861).abs() < 1e-6);
        assert!(colors.linear.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
