//! Mesh: the cloud once more, in the order of its mesh, with the triangles between its points.
//!
//! ```text
//!   settled records ─► in order, cell by cell ─► triangles, part by part ─► sides ─► cloud, mesh
//! ```
//!
//! A part is as large as the memory allows; it sees the points around it, so that parts agree on the triangles at
//! their borders. When all parts are done, it is known which components hang together and which side they look to; then
//! points and triangles are written, with normals on the side of their triangles.

use std::path::Path;

use super::{
    mesh_cells::{CellMesh, CellMeshes},
    mesh_parts::Part,
    mesh_source::{Extent, MeshSource, Triangulated},
    mesh_tiles::MeshTiles,
    ordered_points::OrderedCell,
};
use crate::{
    geometry::{Local, Stored},
    job::{
        error::JobError,
        progress::{Progress, Unit},
    },
    las::{CompleteMesh, LasError, MeshFormat, MeshHeader, MeshWriter, RecordView},
    mesh::{MeshFigures, MeshPoint, MeshedPart, Sides},
    tile::TileError,
    views::SquareTriangles,
};

/// Takes records of the cloud in the order of its mesh.
type WriteRecords<'a> = dyn FnMut(&[u8]) -> Result<(), JobError> + 'a;

impl MeshSource<'_> {
    /// Passes the points in order to `write`, and writes their mesh as the next level of `tiles` or, without tiles, to its file,
    /// complete but not yet under its name. Temporary files are made in `scratch`. The triangles that are `seen` in the
    /// viewer are collected.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(super) fn write(
        &self,
        scratch: &Path,
        write: &mut WriteRecords<'_>,
        tiles: Option<&mut MeshTiles>,
        seen: &mut SquareTriangles,
    ) -> Result<(MeshFigures, Option<CompleteMesh>), JobError> {
        let triangulated = self.triangulate(scratch)?;
        let mesh = self.write_both(&triangulated, write, tiles, seen)?;
        self.run.clock.end_stage("mesh");
        Ok((triangulated.figures, mesh))
    }

    /// Finds the triangles of all parts.
    fn triangulate(&self, scratch: &Path) -> Result<Triangulated, JobError> {
        let parts = self.parts();
        self.run
            .progress
            .begin("mesh", parts.len() as u64, 0, Unit::Tiles);
        let mut cells = CellMeshes::create(&scratch.join("mesh.triangles"))?;
        let mut homes = vec![0; self.points.cells().len()];
        for (number, part) in (0..).zip(&parts) {
            part.cells.iter().for_each(|&cell| homes[cell] = number);
        }
        let (mut sides, mut figures) = (Sides::default(), MeshFigures::default());
        let mut extent = Extent::empty();
        for (number, part) in (0..).zip(&parts) {
            self.run.check_cancelled()?;
            let points = self.gather(number, part, &homes, &mut extent)?;
            let mut meshed =
                MeshedPart::new(number, points, &self.quantization, self.spacing, self.rules);
            let first = sides.add(&mut meshed);
            figures.merge(&meshed.figures);
            self.add_cells(part, meshed, first, &mut cells)?;
            self.run.progress.advance(1);
        }
        let sides = sides.settle(&mut figures);
        self.run.progress.end();
        Ok(Triangulated {
            cells,
            sides,
            figures,
            extent,
        })
    }

    /// The points that the part with this `number` sees; `homes` are the parts of all cells. Its own points are added
    /// to the `extent`.
    fn gather(
        &self,
        number: u32,
        part: &Part,
        homes: &[u32],
        extent: &mut Extent,
    ) -> Result<Vec<MeshPoint>, TileError> {
        let wide = part.core.grown(self.reach());
        let mut points = Vec::new();
        for &cell in part.cells.iter().chain(&part.around) {
            let OrderedCell { key, first, .. } = self.points.cells()[cell];
            let first = first as u32;
            let records = self.points.records(cell)?;
            let length = self.record.record_length();
            for (index, bytes) in (first..).zip(records.chunks_exact(length)) {
                let record = RecordView::new(bytes);
                let point = record.position();
                if homes[cell] == number {
                    extent.add(&record, self.record.has_color());
                } else if !wide.contains(point) {
                    continue;
                }
                let normal = Local::from(self.normal.map(|k| f64::from(record.real(k))));
                points.push(MeshPoint {
                    point,
                    normal: (normal.norm_squared() > 0.5).then_some(normal),
                    scanner: self
                        .viewpoints
                        .of(self.quantization.local(point), record.gps_time()),
                    index,
                    home: homes[cell],
                    cell: [key.row, key.column],
                });
            }
        }
        Ok(points)
    }

    /// Adds the mesh of a part to those of its cells; `first` is the number of its first component among all.
    fn add_cells(
        &self,
        part: &Part,
        meshed: MeshedPart,
        first: u32,
        cells: &mut CellMeshes,
    ) -> Result<(), TileError> {
        let MeshedPart {
            mut triangles,
            mut corners,
            ..
        } = meshed;
        triangles.sort_unstable();
        corners.sort_unstable_by_key(|corner| corner.index);
        let (mut triangles, mut corners) = (triangles.as_slice(), corners.as_slice());
        // Numbers of points grow from cell to cell.
        for &cell in &part.cells {
            let OrderedCell {
                first: start,
                count,
                ..
            } = self.points.cells()[cell];
            let end = start + count;
            let of_cell = triangles.partition_point(|t| u64::from(t.corners[0]) < end);
            let (own_triangles, others) = triangles.split_at(of_cell);
            triangles = others;
            let of_cell = corners.partition_point(|corner| u64::from(corner.index) < end);
            let (own_corners, others) = corners.split_at(of_cell);
            corners = others;
            let mut mesh = CellMesh {
                triangles: own_triangles.to_vec(),
                corners: own_corners.to_vec(),
            };
            mesh.triangles
                .iter_mut()
                .for_each(|triangle| triangle.component += first);
            mesh.corners
                .iter_mut()
                .for_each(|corner| corner.component += first);
            cells.add(cell, &mesh)?;
        }
        Ok(())
    }

    /// Passes the points to `write`, and writes the mesh to `tiles` or to its file; what the viewer shows of it is `seen`.
    fn write_both(
        &self,
        triangulated: &Triangulated,
        write: &mut WriteRecords<'_>,
        tiles: Option<&mut MeshTiles>,
        seen: &mut SquareTriangles,
    ) -> Result<Option<CompleteMesh>, JobError> {
        let Triangulated { cells, sides, .. } = triangulated;
        let mut file = match tiles {
            Some(_) => None,
            None => Some(self.create_file(triangulated)?),
        };
        for cell in 0..self.points.cells().len() {
            self.run.check_cancelled()?;
            let records = self.turned_records(cell, &cells.read(cell)?, sides)?;
            write(&records)?;
            if let Some(file) = &mut file {
                file.vertices(&self.vertices(&records))?;
            }
            let points = records.chunks_exact(self.record.record_length());
            let first = self.points.cells()[cell].first as u32;
            seen.add_points(first, points.map(Stored::of_record));
        }
        for cell in 0..self.points.cells().len() {
            let of_cell = cells.read(cell)?.triangles.into_iter();
            let mut turned: Vec<[u32; 3]> = of_cell
                .filter_map(|triangle| sides.turned(triangle.corners, triangle.component))
                .collect();
            turned.sort_unstable();
            if let Some(file) = &mut file {
                file.triangles(&turned)?;
            }
            seen.add_triangles(&turned);
        }
        if let Some(tiles) = tiles {
            self.write_tiles(triangulated, tiles)?;
        }
        Ok(file.map(MeshWriter::complete).transpose()?)
    }

    /// Begins the file of the mesh.
    fn create_file(&self, triangulated: &Triangulated) -> Result<MeshWriter, LasError> {
        let header = MeshHeader {
            vertices: self.points.points(),
            triangles: triangulated.figures.triangles,
            bounds: triangulated.extent.world(&self.quantization),
            ..self.header(&triangulated.extent)
        };
        MeshWriter::create(self.path, MeshFormat::of_path(self.path)?, &header)
    }
}
