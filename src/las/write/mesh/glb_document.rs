//! The JSON of a GLB file (glTF 2.0 specification, chapter 5): one node, one mesh, one buffer.
//!
//! ```text
//!   buffer   vertices: POSITION 3 × f32, NORMAL 3 × f32, [COLOR_0 3 × f32], each vertex in one piece
//!            indices:  3 × u32 for each triangle
//! ```

use serde_json::{Value, json};

use super::{header::MeshHeader, local_frame::LocalFrame};
use crate::las::format::crs::Crs;

/// The numbers that glTF gives to types and targets.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34_962;
const ELEMENT_ARRAY_BUFFER: u32 = 34_963;
const TRIANGLES: u32 = 4;

/// The offsets in a vertex, in bytes.
const NORMAL_OFFSET: u64 = 12;
const COLOR_OFFSET: u64 = 24;
/// The length of a vertex without and with a colour, in bytes: multiples of 4, as is required.
const PLAIN_STRIDE: u64 = 24;
const COLORED_STRIDE: u64 = 36;
/// The length of a triangle, in bytes.
const TRIANGLE_BYTES: u64 = 12;

/// The lengths of the parts of the buffer, in bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct BufferLayout {
    /// The length of a vertex.
    stride: u64,
    vertex_bytes: u64,
    triangle_bytes: u64,
}

impl BufferLayout {
    /// The layout of the buffer of a mesh. What is too long for any file saturates.
    pub(super) fn of(header: &MeshHeader) -> Self {
        let stride = match header.brightest_color {
            Some(_) => COLORED_STRIDE,
            None => PLAIN_STRIDE,
        };
        Self {
            stride,
            vertex_bytes: stride.saturating_mul(header.vertices),
            triangle_bytes: TRIANGLE_BYTES.saturating_mul(header.triangles),
        }
    }

    /// The length of the buffer, a multiple of 4 unless it saturates.
    pub(super) fn bytes(&self) -> u64 {
        self.vertex_bytes.saturating_add(self.triangle_bytes)
    }
}

/// The document of the mesh of `header`. Without a surface it is a scene without a mesh.
pub(super) fn glb_document(header: &MeshHeader, frame: &LocalFrame) -> Value {
    let asset = json!({
        "version": "2.0",
        "generator": concat!("lloydar ", env!("CARGO_PKG_VERSION")),
    });
    if !header.has_surface() {
        return json!({ "asset": asset, "scene": 0, "scenes": [{}] });
    }
    let layout = BufferLayout::of(header);
    let mut attributes = json!({ "POSITION": 0, "NORMAL": 1 });
    if header.brightest_color.is_some() {
        attributes["COLOR_0"] = json!(3);
    }
    json!({
        "asset": asset,
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{
            "mesh": 0,
            "matrix": y_up(metres_per_unit(header.crs.as_ref())),
            "extras": extras(header, frame),
        }],
        "meshes": [{
            "primitives": [{
                "attributes": attributes, "indices": 2, "material": 0, "mode": TRIANGLES,
            }],
        }],
        "materials": [{
            "doubleSided": true,
            "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        }],
        "buffers": [{ "byteLength": layout.bytes() }],
        "bufferViews": [
            {
                "buffer": 0, "byteOffset": 0, "byteLength": layout.vertex_bytes,
                "byteStride": layout.stride, "target": ARRAY_BUFFER,
            },
            {
                "buffer": 0, "byteOffset": layout.vertex_bytes,
                "byteLength": layout.triangle_bytes, "target": ELEMENT_ARRAY_BUFFER,
            },
        ],
        "accessors": accessors(header, frame),
    })
}

/// Metres to a unit of the coordinates; 1 if the CRS does not say.
pub(super) fn metres_per_unit(crs: Option<&Crs>) -> f64 {
    crs.and_then(Crs::metres_per_unit).unwrap_or(1.0)
}

/// The matrix, column by column, that turns the z axis up into the y axis up, and units into
/// metres: (x, y, z) becomes (x, z, −y).
fn y_up(metres: f64) -> [f64; 16] {
    let mut matrix = [0.0; 16];
    matrix[0] = metres;
    matrix[6] = -metres;
    matrix[9] = metres;
    matrix[15] = 1.0;
    matrix
}

/// Where the coordinates are in the world: the origin (CRS units), and the CRS as WKT.
fn extras(header: &MeshHeader, frame: &LocalFrame) -> Value {
    let mut extras = json!({ "origin": frame.origin });
    if let Some(wkt) = header.crs.as_ref().and_then(Crs::wkt) {
        extras["crs"] = json!(wkt);
    }
    extras
}

fn accessors(header: &MeshHeader, frame: &LocalFrame) -> Vec<Value> {
    let [min, max] = frame.local_bounds(header.bounds);
    let mut accessors = vec![
        json!({
            "bufferView": 0, "byteOffset": 0, "componentType": FLOAT, "type": "VEC3",
            "count": header.vertices, "min": min, "max": max,
        }),
        json!({
            "bufferView": 0, "byteOffset": NORMAL_OFFSET, "componentType": FLOAT,
            "type": "VEC3", "count": header.vertices,
        }),
        json!({
            "bufferView": 1, "byteOffset": 0, "componentType": UNSIGNED_INT, "type": "SCALAR",
            "count": header.triangles.saturating_mul(3),
        }),
    ];
    if header.brightest_color.is_some() {
        accessors.push(json!({
            "bufferView": 0, "byteOffset": COLOR_OFFSET, "componentType": FLOAT,
            "type": "VEC3", "count": header.vertices,
        }));
    }
    accessors
}
