//! What the mesh of a cloud is made from: the points in order, and how their records are read.

use std::path::Path;

use super::{
    mesh_cells::{CellMesh, CellMeshes},
    ordered_points::{OrderedPoints, OrderingGrids},
};
use crate::{
    geometry::{Quantization, Stored, Viewpoints},
    job::context::RunContext,
    las::{Crs, MeshHeader, MeshVertex, RealAttribute, RecordFormat, RecordView},
    mesh::{MeshFigures, MeshRules, SettledSides},
    tile::TileError,
    tiling::Bounds,
};

/// What the mesh of a cloud is made from.
pub(super) struct MeshSource<'a> {
    pub(super) run: &'a RunContext<'a>,
    /// The file of the mesh, if it is not written as tiles.
    pub(super) path: &'a Path,
    pub(super) points: OrderedPoints,
    pub(super) grids: OrderingGrids,
    pub(super) record: &'a RecordFormat,
    /// The components of the normal in the records.
    pub(super) normal: [RealAttribute; 3],
    pub(super) viewpoints: Viewpoints,
    /// Which points have triangles, and how those are chosen.
    pub(super) rules: MeshRules,
    pub(super) quantization: Quantization,
    pub(super) spacing: f64,
    pub(super) crs: Option<Crs>,
}

/// The mesh of a cloud before it is written.
pub(super) struct Triangulated {
    pub(super) cells: CellMeshes,
    pub(super) sides: SettledSides,
    pub(super) figures: MeshFigures,
    pub(super) extent: Extent,
}

/// What the header of a mesh says of its points.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    /// The bounding box.
    bounds: Bounds,
    /// The largest component of a colour.
    brightest: u16,
}

impl MeshSource<'_> {
    /// How far a part sees beyond its core, in stored units.
    pub(super) fn reach(&self) -> i64 {
        let reach = self.rules.reach_in_spacings() * self.spacing;
        self.quantization.units(reach)
    }

    /// The header of a mesh without vertices in this cloud.
    pub(super) fn header(&self, extent: &Extent) -> MeshHeader {
        MeshHeader {
            vertices: 0,
            triangles: 0,
            brightest_color: self.record.has_color().then_some(extent.brightest),
            bounds: [[0.0; 3]; 2],
            origin: None,
            crs: self.crs.clone(),
        }
    }

    /// The records of a cell, with normals on the sides of their triangles.
    pub(super) fn turned_records(
        &self,
        cell: usize,
        mesh: &CellMesh,
        sides: &SettledSides,
    ) -> Result<Vec<u8>, TileError> {
        let mut records = self.points.records(cell)?;
        self.turn_normals(cell, mesh, sides, &mut records);
        Ok(records)
    }

    /// Turns the normals in the `records` of a cell to the sides of their triangles.
    fn turn_normals(&self, cell: usize, mesh: &CellMesh, sides: &SettledSides, records: &mut [u8]) {
        let (first, length) = (self.points.cells()[cell].first, self.record.record_length());
        for corner in &mesh.corners {
            if sides.is_reversed(corner.component) != corner.is_behind {
                let start = (u64::from(corner.index) - first) as usize * length;
                let mut record = RecordView::new(&mut records[start..start + length]);
                for component in self.normal {
                    let turned = -record.real(component);
                    record.set_real(component, turned.into());
                }
            }
        }
    }

    /// The corners of a mesh that `records` describe.
    pub(super) fn vertices(&self, records: &[u8]) -> Vec<MeshVertex> {
        let has_color = self.record.has_color();
        let vertex = |bytes: &[u8]| {
            let record = RecordView::new(bytes);
            MeshVertex {
                position: self.quantization.world(record.position()),
                normal: self.normal.map(|component| record.real(component)),
                color: if has_color { record.color() } else { [0; 3] },
            }
        };
        records
            .chunks_exact(self.record.record_length())
            .map(vertex)
            .collect()
    }
}

impl Extent {
    /// The extent of no point.
    pub(super) fn empty() -> Self {
        Self {
            bounds: Bounds::empty(),
            brightest: 0,
        }
    }

    /// Adds a point.
    pub(super) fn add(&mut self, record: &RecordView<&[u8]>, has_color: bool) {
        self.bounds.grow(record.position());
        if has_color {
            self.brightest = record.color().into_iter().fold(self.brightest, u16::max);
        }
    }

    /// The least and the largest world coordinates.
    pub(super) fn world(&self, quantization: &Quantization) -> [[f64; 3]; 2] {
        [self.bounds.min, self.bounds.max].map(|[x, y, z]| quantization.world(Stored { x, y, z }))
    }
}
