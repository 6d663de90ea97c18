//! The mesh as tiles: a GLB file for each square of the plane, and the index by which viewers load them.
//!
//! A triangle is in the tile that contains its first corner. Points that triangles of two tiles have in common
//! are in both, in the same place to the bit, so that no gap can be seen.

use std::collections::{BTreeMap, HashMap, hash_map::Entry};

use super::mesh_source::{MeshSource, Triangulated};
use crate::{
    geometry::Stored,
    job::error::JobError,
    las::{
        CompleteMesh, MeshFormat, MeshHeader, MeshTile, MeshTileDirectory, MeshVertex, MeshWriter,
        Squares, Tileset, mesh_tile_name,
    },
    mesh::Corners,
    tile::TileError,
};

/// How far the triangles of the finest level are from the scanned surface, as a viewer has to know it, in
/// spacings.
const ERROR_IN_SPACINGS: f64 = 0.1;

/// The triangles of a tile, by the numbers of its vertices.
struct TileMesh {
    vertices: Vec<MeshVertex>,
    triangles: Vec<Corners>,
}

/// The records of the cells around a tile, with normals on the sides of their triangles.
type CellRecords = HashMap<usize, Vec<u8>>;

impl MeshSource<'_> {
    /// Writes the mesh as tiles to its directory.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(super) fn write_tiles(
        &self,
        triangulated: &Triangulated,
    ) -> Result<CompleteMesh, JobError> {
        let squares = Squares::new(self.tile_edge.unwrap_or(f64::MAX), &self.quantization);
        let mut cells_of: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        for (cell, ordered) in self.points.cells().iter().enumerate() {
            for square in squares.touched_by(&self.grids.cells.rect(ordered.key)) {
                cells_of.entry(square).or_default().push(cell);
            }
        }
        let directory = MeshTileDirectory::create(self.path)?;
        let [low, high] = triangulated
            .extent
            .bounds
            .map(|point| self.quantization.world(point));
        let origin = [0, 1, 2].map(|axis| (0.5 * (low[axis] + high[axis])).round());
        let mut tiles = Vec::new();
        for (square, cells) in cells_of {
            self.run.check_cancelled()?;
            let own = |point: Stored| squares.rect(square).contains(point);
            let mesh = self.tile(&cells, own, triangulated)?;
            if mesh.triangles.is_empty() {
                continue;
            }
            let uri = mesh_tile_name(0, square);
            let bounds = bounds(&mesh.vertices);
            let header = MeshHeader {
                vertices: mesh.vertices.len() as u64,
                triangles: mesh.triangles.len() as u64,
                bounds,
                origin: Some(origin),
                ..self.header(&triangulated.extent)
            };
            let mut writer = MeshWriter::create(&directory.file(&uri), MeshFormat::Glb, &header)?;
            writer.vertices(&mesh.vertices)?;
            writer.triangles(&mesh.triangles)?;
            writer.complete()?.deliver()?;
            tiles.push(MeshTile {
                level: 0,
                square,
                uri,
                bounds,
            });
        }
        Ok(directory.complete(&Tileset {
            tiles,
            geometric_errors: vec![ERROR_IN_SPACINGS * self.spacing],
            origin,
            crs: self.crs.clone(),
        })?)
    }

    /// The triangles in `cells` whose first corner is at home in a tile, by `own`.
    fn tile(
        &self,
        cells: &[usize],
        own: impl Fn(Stored) -> bool,
        triangulated: &Triangulated,
    ) -> Result<TileMesh, TileError> {
        let sides = &triangulated.sides;
        let mut records = CellRecords::new();
        let mut triangles: Vec<Corners> = Vec::new();
        for &cell in cells {
            let mesh = triangulated.cells.read(cell)?;
            records.insert(cell, self.turned_records(cell, &mesh, sides)?);
            for triangle in mesh.triangles {
                let first = Stored::of_record(self.record_of(triangle.corners[0], &records));
                if own(first) {
                    triangles.extend(sides.turned(triangle.corners, triangle.component));
                }
            }
        }
        triangles.sort_unstable();
        let mut corners: Vec<u32> = triangles.iter().flatten().copied().collect();
        corners.sort_unstable();
        corners.dedup();
        let mut vertices = Vec::with_capacity(corners.len());
        for &corner in &corners {
            let cell = self.points.cell_of(corner);
            if let Entry::Vacant(missing) = records.entry(cell) {
                let mesh = triangulated.cells.read(cell)?;
                missing.insert(self.turned_records(cell, &mesh, sides)?);
            }
            vertices.extend(self.vertices(self.record_of(corner, &records)));
        }
        // Every corner is among the corners.
        let place = |corner: u32| corners.binary_search(&corner).unwrap_or(0) as u32;
        triangles
            .iter_mut()
            .for_each(|triangle| *triangle = triangle.map(place));
        Ok(TileMesh {
            vertices,
            triangles,
        })
    }

    /// The record of the point with this number, whose cell is among the `records`.
    fn record_of<'a>(&self, number: u32, records: &'a CellRecords) -> &'a [u8] {
        let cell = self.points.cell_of(number);
        let length = self.record.record_length();
        let place = (u64::from(number) - self.points.cells()[cell].first) as usize;
        &records[&cell][place * length..][..length]
    }
}

/// The least and the largest coordinates of `vertices`.
fn bounds(vertices: &[MeshVertex]) -> [[f64; 3]; 2] {
    let all = |pick: fn(f64, f64) -> f64, start: f64| {
        [0, 1, 2].map(|axis| {
            let coordinates = vertices.iter().map(|vertex| vertex.position[axis]);
            coordinates.fold(start, pick)
        })
    };
    [
        all(f64::min, f64::INFINITY),
        all(f64::max, f64::NEG_INFINITY),
    ]
}
