//! Small meshes for the tests, and for other programs to read: a sphere and hills, at
//! coordinates like those of UTM.

use std::{
    f64::consts::{PI, TAU},
    path::{Path, PathBuf},
};

use super::{
    format::MeshFormat,
    header::{MeshHeader, MeshVertex},
    tile_directory::MeshTileDirectory,
    tileset::{MeshTile, Tileset, mesh_tile_name},
    writer::MeshWriter,
};
use crate::las::error::LasError;

/// The centre of the sphere and its radius.
pub(super) const CENTRE: [f64; 3] = [691_000.25, 5_334_000.5, 520.125];
pub(super) const RADIUS: f64 = 10.0;
/// The number of rings of the sphere between its poles, and of vertices in a ring.
const RINGS: u32 = 15;
const SECTORS: u32 = 32;
/// The edge of the finest tiles of the hills.
const TILE_EDGE: f64 = 50.0;
/// The variable that names the directory into which samples are written for other programs.
const SAMPLES_VARIABLE: &str = "LLOYDAR_MESH_SAMPLES";

/// A mesh in memory.
#[derive(Clone, Default)]
pub(super) struct Sample {
    pub(super) vertices: Vec<MeshVertex>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) has_color: bool,
    pub(super) origin: Option<[f64; 3]>,
}

impl Sample {
    /// A closed sphere with the colours of its directions, whose last vertex, at the south
    /// pole, has no normal.
    pub(super) fn sphere() -> Self {
        let mut sphere = Self {
            has_color: true,
            ..Self::default()
        };
        sphere.add_direction([0.0, 0.0, 1.0]);
        for ring in 1..=RINGS {
            let (sine, cosine) = (PI * f64::from(ring) / f64::from(RINGS + 1)).sin_cos();
            for sector in 0..SECTORS {
                let (y, x) = (TAU * f64::from(sector) / f64::from(SECTORS)).sin_cos();
                sphere.add_direction([sine * x, sine * y, cosine]);
            }
        }
        sphere.add_direction([0.0, 0.0, -1.0]);
        let south = RINGS * SECTORS + 1;
        sphere.vertices[south as usize].normal = [f32::NAN; 3];
        let at = |ring: u32, sector: u32| 1 + ring * SECTORS + sector % SECTORS;
        for sector in 0..SECTORS {
            sphere.triangles.push([0, at(0, sector), at(0, sector + 1)]);
            for ring in 1..RINGS {
                let [a, b] = [at(ring - 1, sector), at(ring - 1, sector + 1)];
                let [c, d] = [at(ring, sector), at(ring, sector + 1)];
                sphere.triangles.extend([[a, c, d], [a, d, b]]);
            }
            let last = [at(RINGS - 1, sector), at(RINGS - 1, sector + 1)];
            sphere.triangles.push([south, last[1], last[0]]);
        }
        sphere
    }

    fn add_direction(&mut self, direction: [f64; 3]) {
        self.vertices.push(MeshVertex {
            position: [0, 1, 2].map(|axis| CENTRE[axis] + RADIUS * direction[axis]),
            normal: direction.map(|d| d as f32),
            color: direction.map(|d| ((0.5 + 0.5 * d) * 65_535.0) as u16),
        });
    }

    /// Hills over a square of this `edge`, of 20 by 20 cells, without colours and normals.
    fn hills(corner: [f64; 2], edge: f64) -> Self {
        const CELLS: u32 = 20;
        let mut hills = Self::default();
        for row in 0..=CELLS {
            for column in 0..=CELLS {
                let step = |index: u32| edge * f64::from(index) / f64::from(CELLS);
                let [x, y] = [corner[0] + step(column), corner[1] + step(row)];
                hills.vertices.push(MeshVertex {
                    position: [x, y, 500.0 + 4.0 * (x / 9.0).sin() * (y / 7.0).cos()],
                    normal: [f32::NAN; 3],
                    color: [0; 3],
                });
                if row < CELLS && column < CELLS {
                    let a = row * (CELLS + 1) + column;
                    let [b, c, d] = [a + 1, a + CELLS + 1, a + CELLS + 2];
                    hills.triangles.extend([[a, b, d], [a, d, c]]);
                }
            }
        }
        hills
    }

    pub(super) fn header(&self) -> MeshHeader {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for vertex in &self.vertices {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(vertex.position[axis]);
                bounds[1][axis] = bounds[1][axis].max(vertex.position[axis]);
            }
        }
        MeshHeader {
            vertices: self.vertices.len() as u64,
            triangles: self.triangles.len() as u64,
            brightest_color: self.has_color.then_some(u16::MAX),
            bounds,
            origin: self.origin,
            crs: None,
        }
    }

    /// Writes the mesh to `path`, in the format of its ending and in batches.
    pub(super) fn write(&self, path: &Path) -> Result<(), LasError> {
        let format = MeshFormat::of_path(path)?;
        let mut writer = MeshWriter::create(path, format, &self.header())?;
        for batch in self.vertices.chunks(100) {
            writer.vertices(batch)?;
        }
        for batch in self.triangles.chunks(100) {
            writer.triangles(batch)?;
        }
        writer.complete()?.deliver()
    }

    /// The bytes of the mesh in a file with this ending.
    pub(super) fn bytes(&self, ending: &str) -> Vec<u8> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(format!("mesh.{ending}"));
        self.write(&path).unwrap();
        std::fs::read(path).unwrap()
    }
}

/// Writes two levels of tiles of hills to the directory `path`: one tile over four and one
/// beside them.
fn write_tiles(path: &Path) -> Result<(), LasError> {
    let directory = MeshTileDirectory::create(path)?;
    let origin = [691_000.0, 5_334_000.0, 500.0];
    let (column, row) = (13_820, 106_680);
    let mut squares = vec![(1, [column / 2, row / 2]), (0, [column + 2, row])];
    for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        squares.push((0, [column + x, row + y]));
    }
    let mut tiles = Vec::new();
    for (level, square) in squares {
        let edge = TILE_EDGE * f64::from(1 << level);
        let hills = Sample {
            origin: Some(origin),
            ..Sample::hills(square.map(|index| index as f64 * edge), edge)
        };
        let uri = mesh_tile_name(level, square);
        hills.write(&directory.file(&uri))?;
        tiles.push(MeshTile {
            level,
            square,
            uri,
            bounds: hills.header().bounds,
        });
    }
    let tileset = Tileset {
        tiles,
        geometric_errors: vec![0.1, 0.5],
        origin,
        crs: None,
    };
    directory.complete(&tileset)?.deliver()
}

/// Writes samples in every format and a directory of tiles. Other programs read them, if a
/// variable names a directory for them.
#[test]
fn samples_are_written_in_every_format() {
    let temporary = tempfile::tempdir().unwrap();
    let dir = match std::env::var_os(SAMPLES_VARIABLE) {
        Some(dir) => PathBuf::from(dir),
        None => temporary.path().to_owned(),
    };
    std::fs::create_dir_all(&dir).unwrap();
    let sphere = Sample::sphere();
    let cloud = Sample {
        triangles: Vec::new(),
        ..sphere.clone()
    };
    for ending in ["ply", "obj", "glb"] {
        let write = |sample: &Sample, name: &str| {
            sample.write(&dir.join(format!("{name}.{ending}"))).unwrap();
        };
        write(&sphere, "sphere");
        write(&Sample::hills([-20.0, 431.5], 30.0), "hills");
        write(&cloud, "no-triangles");
        write(&Sample::default(), "nothing");
    }
    write_tiles(&dir.join("tiles")).unwrap();
    // Tiles replace tiles, but nothing else.
    write_tiles(&dir.join("tiles")).unwrap();
    let error = write_tiles(&dir).unwrap_err().to_string();
    assert!(error.contains("other things than tiles"), "{error}");
    let mut names: Vec<_> = std::fs::read_dir(dir.join("tiles"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names.len(), 7, "{names:?}");
    assert_eq!(names[6], "tileset.json");
}
