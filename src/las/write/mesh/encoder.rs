//! What the formats of meshes have in common.

use std::io::{self, Write};

use super::header::MeshVertex;

/// The bytes of a mesh in one format. The header is written first, then all vertices, then
/// all triangles. Each function fails if `out` does.
pub(super) trait MeshEncoder: Send {
    /// Writes what stands before the vertices.
    fn write_header(&self, out: &mut dyn Write) -> io::Result<()>;

    /// Writes some of the vertices.
    fn write_vertices(&self, vertices: &[MeshVertex], out: &mut dyn Write) -> io::Result<()>;

    /// Writes some of the triangles, whose corners are counted from 0.
    fn write_triangles(&self, triangles: &[[u32; 3]], out: &mut dyn Write) -> io::Result<()>;
}
