//! The mesh as tiles: a GLB file for each square of the plane, level by level, and the index by which viewers load them.
//!
//! A triangle is in the tile that contains its first corner. Points that triangles of two tiles have in common
//! are in both, in the same place to the bit, so that no gap can be seen.

use std::{
    collections::{BTreeMap, HashMap, hash_map::Entry},
    path::Path,
};

use super::mesh_source::{MeshSource, Triangulated};
use crate::{
    geometry::Stored,
    job::error::JobError,
    las::{
        CompleteMesh, LasError, MeshFormat, MeshHeader, MeshTile, MeshTileDirectory, MeshVertex,
        MeshWriter, Squares, Tileset, mesh_tile_name,
    },
    mesh::Corners,
    tile::TileError,
};

/// A viewer shows the next finer level where so many spacings of a level are larger than some pixels: the colours and
/// the corners of a level are as coarse.
const ERROR_IN_SPACINGS: f64 = 0.5;

/// The tiles of a mesh in their directory, not yet under its name: level by level, the finest first.
pub(crate) struct MeshTiles {
    directory: MeshTileDirectory,
    /// The edge of the tiles of the finest level (CRS units); it doubles from level to level.
    edge: f64,
    tileset: Tileset,
}

impl MeshTiles {
    /// No tiles yet, in a directory that is to become `path`.
    ///
    /// # Errors
    ///
    /// [`LasError`] if the directory cannot be made, or there is something else than tiles at `path`.
    pub(crate) fn create(path: &Path, edge: f64) -> Result<Self, LasError> {
        Ok(Self {
            directory: MeshTileDirectory::create(path)?,
            edge,
            tileset: Tileset {
                tiles: Vec::new(),
                geometric_errors: Vec::new(),
                origin: [0.0; 3],
                crs: None,
            },
        })
    }

    /// The number of levels.
    pub(crate) fn levels(&self) -> u32 {
        self.tileset.geometric_errors.len() as u32
    }

    /// The number of tiles of the coarsest level.
    pub(crate) fn tiles_of_coarsest(&self) -> usize {
        let levels = self.levels();
        let tiles = self.tileset.tiles.iter();
        tiles.filter(|tile| tile.level + 1 == levels).count()
    }

    /// Writes the index of the tiles.
    ///
    /// # Errors
    ///
    /// [`LasError`] if it cannot be written; nothing is left of the tiles then.
    pub(crate) fn complete(self) -> Result<CompleteMesh, LasError> {
        self.directory.complete(&self.tileset)
    }

    /// Writes the next tile of this `level`.
    fn write(
        &mut self,
        level: u32,
        square: [i64; 2],
        mesh: &TileMesh,
        header: MeshHeader,
    ) -> Result<(), LasError> {
        let uri = mesh_tile_name(level, square);
        let bounds = bounds(&mesh.vertices);
        let header = MeshHeader {
            vertices: mesh.vertices.len() as u64,
            triangles: mesh.triangles.len() as u64,
            bounds,
            origin: Some(self.tileset.origin),
            ..header
        };
        let mut writer = MeshWriter::create(&self.directory.file(&uri), MeshFormat::Glb, &header)?;
        writer.vertices(&mesh.vertices)?;
        writer.triangles(&mesh.triangles)?;
        writer.complete()?.deliver()?;
        self.tileset.tiles.push(MeshTile {
            level,
            square,
            uri,
            bounds,
        });
        Ok(())
    }
}

/// The triangles of a tile, by the numbers of its vertices.
struct TileMesh {
    vertices: Vec<MeshVertex>,
    triangles: Vec<Corners>,
}

/// The records of the cells around a tile, with normals on the sides of their triangles.
type CellRecords = HashMap<usize, Vec<u8>>;

impl MeshSource<'_> {
    /// Writes the mesh as the next level of `tiles`.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(super) fn write_tiles(
        &self,
        triangulated: &Triangulated,
        tiles: &mut MeshTiles,
    ) -> Result<(), JobError> {
        let level = tiles.levels();
        let tileset = &mut tiles.tileset;
        if level == 0 {
            let [low, high] = triangulated.extent.world(&self.quantization);
            tileset.origin = [0, 1, 2].map(|axis| (0.5 * (low[axis] + high[axis])).round());
            tileset.crs.clone_from(&self.crs);
        }
        tileset
            .geometric_errors
            .push(ERROR_IN_SPACINGS * self.spacing);
        let edge = tiles.edge * f64::from(1_u32 << level);
        let squares = Squares::new(edge, &self.quantization);
        let mut cells_of: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        for (cell, ordered) in self.points.cells().iter().enumerate() {
            for square in squares.touched_by(&self.grids.cells.rect(ordered.key)) {
                cells_of.entry(square).or_default().push(cell);
            }
        }
        for (square, cells) in cells_of {
            self.run.check_cancelled()?;
            let own = |point: Stored| squares.rect(square).contains(point);
            let mesh = self.tile(&cells, own, triangulated)?;
            if !mesh.triangles.is_empty() {
                tiles.write(level, square, &mesh, self.header(&triangulated.extent))?;
            }
        }
        Ok(())
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
