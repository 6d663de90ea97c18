//! The meshes of the cells of a cloud, in a temporary file, before it is known which side they look to.
//!
//! ```text
//!   triangles, corners   2 × u64
//!   triangles            16 bytes each: three corners, component
//!   corners              8 bytes each: index, twice the component and whether the normal is behind
//! ```

use std::path::Path;

use crate::{
    mesh::{PartCorner, PartTriangle},
    tile::{BlockFile, TileError},
};

const TRIANGLE_BYTES: usize = 16;
const CORNER_BYTES: usize = 8;
const HEADER_BYTES: usize = 16;

/// The mesh of a cell: the triangles whose first corners are in it, and its points that are corners. Components have
/// their numbers among those of all parts.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct CellMesh {
    pub(super) triangles: Vec<PartTriangle>,
    pub(super) corners: Vec<PartCorner>,
}

/// The meshes of cells in a file.
#[derive(Debug)]
pub(super) struct CellMeshes(BlockFile);

impl CellMeshes {
    /// Makes an empty file at `path`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be made.
    pub(super) fn create(path: &Path) -> Result<Self, TileError> {
        BlockFile::create(path).map(Self)
    }

    /// Adds the mesh of the cell with this index.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be written.
    pub(super) fn add(&mut self, cell: usize, mesh: &CellMesh) -> Result<(), TileError> {
        self.0.append(&[(cell as u64, &mesh.to_bytes())])
    }

    /// Reads the mesh of the cell with this index.
    ///
    /// # Errors
    ///
    /// [`TileError`] if it cannot be read, or is not what was written.
    pub(super) fn read(&self, cell: usize) -> Result<CellMesh, TileError> {
        Ok(CellMesh::from_bytes(&self.0.read(cell as u64)?))
    }
}

impl CellMesh {
    fn to_bytes(&self) -> Vec<u8> {
        let bytes = TRIANGLE_BYTES * self.triangles.len() + CORNER_BYTES * self.corners.len();
        let mut all = Vec::with_capacity(HEADER_BYTES + bytes);
        all.extend((self.triangles.len() as u64).to_le_bytes());
        all.extend((self.corners.len() as u64).to_le_bytes());
        for PartTriangle {
            corners: [a, b, c],
            component,
        } in &self.triangles
        {
            all.extend(
                [a, b, c, component]
                    .into_iter()
                    .flat_map(|number| number.to_le_bytes()),
            );
        }
        for corner in &self.corners {
            let component = corner.component << 1 | u32::from(corner.is_behind);
            all.extend(
                [corner.index, component]
                    .into_iter()
                    .flat_map(|number| number.to_le_bytes()),
            );
        }
        all
    }

    /// The mesh that `bytes` encode; their checksum was checked.
    fn from_bytes(bytes: &[u8]) -> Self {
        let mut words = bytes
            .chunks_exact(4)
            .map(|word| u32::from_le_bytes(word.try_into().expect("a word has four bytes")));
        let mut next = || words.next().unwrap_or(0);
        let [triangles, _, corners, _] = [next(), next(), next(), next()];
        let triangle = |_| PartTriangle {
            corners: [next(), next(), next()],
            component: next(),
        };
        let triangles = (0..triangles).map(triangle).collect();
        let corner = |_| {
            let (index, component) = (next(), next());
            PartCorner {
                index,
                component: component >> 1,
                is_behind: component & 1 == 1,
            }
        };
        let corners = (0..corners).map(corner).collect();
        Self { triangles, corners }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_of_a_cell_is_read_as_it_was_written() {
        let mesh = CellMesh {
            triangles: vec![
                PartTriangle {
                    corners: [7, 9, 8],
                    component: 3,
                },
                PartTriangle {
                    corners: [7, 11, 9],
                    component: u32::MAX >> 1,
                },
            ],
            corners: vec![PartCorner {
                index: 7,
                component: 3,
                is_behind: true,
            }],
        };
        assert_eq!(CellMesh::from_bytes(&mesh.to_bytes()), mesh);
        let empty = CellMesh::default();
        assert_eq!(CellMesh::from_bytes(&empty.to_bytes()), empty);
    }
}
