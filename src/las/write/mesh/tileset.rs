//! The index of a mesh in tiles: 3D Tiles 1.1 (OGC 22-025r4) with GLB contents.
//!
//! All contents share one local origin. The transform of the root moves it to its place in
//! the world, so the coordinates of the tileset are those of the CRS, in metres. 3D Tiles have
//! the z axis up, and viewers turn the y axis of glTF into it, which undoes the matrix of our
//! GLB files. Boxes are in the local frame, too.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, Write},
    path::Path,
};

use serde_json::{Value, json};

use super::{
    glb_document::metres_per_unit,
    local_frame::LocalFrame,
    tile_tree::{TileNode, diagonal, root_of},
};
use crate::las::{error::LasError, format::crs::Crs};

/// The least half edge of a box (m): viewers divide by it.
const LEAST_HALF_EDGE_M: f64 = 1e-3;

/// The tiles of a mesh.
#[derive(Clone, Debug)]
pub(crate) struct Tileset {
    /// The tiles, in any order, at most one for each square of a level.
    pub(crate) tiles: Vec<MeshTile>,
    /// For each level, the finest first, the greatest distance (CRS units) of its surface
    /// from the scanned one: a viewer refines until it is less than some pixels. Each is
    /// greater than the one before.
    pub(crate) geometric_errors: Vec<f64>,
    /// The origin of the coordinates in all contents (CRS units).
    pub(crate) origin: [f64; 3],
    /// The coordinate reference system.
    pub(crate) crs: Option<Crs>,
}

/// A tile of a mesh, and the file of its content.
#[derive(Clone, Debug)]
pub(crate) struct MeshTile {
    /// The level, counted from the finest, 0; the edges of squares double from level to
    /// level.
    pub(crate) level: u32,
    /// The column and the row of the square among those of its level.
    pub(crate) square: [i64; 2],
    /// The path of the file, relative to the index.
    pub(crate) uri: String,
    /// The least and the greatest world coordinates of its vertices (CRS units).
    pub(crate) bounds: [[f64; 3]; 2],
}

impl Tileset {
    /// Writes the index to a new file at `path`, and flushes it to the disk.
    ///
    /// # Errors
    ///
    /// If the tiles make no hierarchy, or the file cannot be written.
    pub(super) fn write(&self, path: &Path) -> Result<(), LasError> {
        let text = self
            .document()
            .map_err(|problem| LasError::new(path, problem))?
            .to_string();
        let write = || -> io::Result<()> {
            let mut file = File::create(path)?;
            file.write_all(text.as_bytes())?;
            file.sync_all()
        };
        write().map_err(|e| LasError::unwritable(path, e))
    }

    /// The document of the index. Without tiles it has an empty root.
    ///
    /// # Errors
    ///
    /// If two tiles have one square, a tile has no finite bounds or no error for its level, or
    /// the errors do not grow.
    fn document(&self) -> Result<Value, String> {
        let errors = &self.geometric_errors;
        let grow = errors.windows(2).all(|pair| pair[0] < pair[1]);
        if !(grow && errors.iter().all(|e| (0.0..f64::MAX).contains(e))) {
            return Err(format!("the geometric errors {errors:?} do not grow"));
        }
        let metres = metres_per_unit(self.crs.as_ref());
        let root = root_of(self.levels(metres)?).unwrap_or(TileNode {
            bounds: thickened([[0.0; 3]; 2], metres),
            geometric_error: 0.0,
            uri: None,
            children: Vec::new(),
        });
        // The error of showing nothing at all is the size of the whole.
        let error = diagonal(root.bounds).max(root.geometric_error);
        let mut document = json!({
            "asset": { "version": "1.1", "extras": { "origin": self.origin } },
            "geometricError": error * metres,
            "root": tile_document(root, metres),
        });
        if let Some(wkt) = self.crs.as_ref().and_then(Crs::wkt) {
            document["asset"]["extras"]["crs"] = json!(wkt);
        }
        let [x, y, z] = self.origin.map(|c| c * metres);
        document["root"]["transform"] = json!([
            1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, y, z, 1.0
        ]);
        document["root"]["refine"] = json!("REPLACE");
        Ok(document)
    }

    /// The tiles of each level as nodes, by their rows and columns; a CRS unit is so many `metres`.
    fn levels(&self, metres: f64) -> Result<Vec<BTreeMap<[i64; 2], TileNode>>, String> {
        let mut levels: Vec<BTreeMap<_, _>> = self
            .geometric_errors
            .iter()
            .map(|_| BTreeMap::new())
            .collect();
        let frame = LocalFrame {
            origin: self.origin,
        };
        for tile in &self.tiles {
            let MeshTile {
                level,
                square,
                uri,
                bounds,
            } = tile;
            let [min, max] = bounds;
            // Written so that NaN fails.
            if !(0..3).all(|axis| min[axis] <= max[axis] && (max[axis] - min[axis]).is_finite()) {
                return Err(format!("the tile {uri} has the bounds {bounds:?}"));
            }
            let index = *level as usize;
            let (Some(tiles), Some(error)) =
                (levels.get_mut(index), self.geometric_errors.get(index))
            else {
                return Err(format!("the level {level} of the tile {uri} has no error"));
            };
            let local = frame.local_bounds(*bounds);
            let node = TileNode {
                // Before boxes are put around it: a box is inside of the one above.
                bounds: thickened(local.map(|corner| corner.map(f64::from)), metres),
                geometric_error: *error,
                uri: Some(uri.clone()),
                children: Vec::new(),
            };
            if tiles.insert([square[1], square[0]], node).is_some() {
                return Err(format!(
                    "two tiles are the square {square:?} of level {level}"
                ));
            }
        }
        Ok(levels)
    }
}

/// The name of the content of a tile. It has no letters that would have to be escaped in a
/// URI.
pub(crate) fn mesh_tile_name(level: u32, [column, row]: [i64; 2]) -> String {
    format!("level{level}_{column}_{row}.glb")
}

/// The document of a tile and of all tiles below, in units of `metres`.
fn tile_document(node: TileNode, metres: f64) -> Value {
    let mut document = json!({
        "boundingVolume": { "box": box_of(node.bounds, metres) },
        "geometricError": node.geometric_error * metres,
    });
    if let Some(uri) = node.uri {
        document["content"] = json!({ "uri": uri });
    }
    if !node.children.is_empty() {
        let children = node.children.into_iter();
        let children: Vec<Value> = children.map(|child| tile_document(child, metres)).collect();
        document["children"] = json!(children);
    }
    document
}

/// The `bounds`, wider where their edges would be too short for a box; a unit is so many `metres`.
fn thickened([mut min, mut max]: [[f64; 3]; 2], metres: f64) -> [[f64; 3]; 2] {
    for axis in 0..3 {
        let half = 0.5 * (max[axis] - min[axis]);
        let missing = f64::max(LEAST_HALF_EDGE_M / metres - half, 0.0);
        min[axis] -= missing;
        max[axis] += missing;
    }
    [min, max]
}

/// The centre and the half edges of a box along x, y and z, in units of `metres`.
fn box_of([min, max]: [[f64; 3]; 2], metres: f64) -> [f64; 12] {
    let mut numbers = [0.0; 12];
    for axis in 0..3 {
        numbers[axis] = 0.5 * (min[axis] + max[axis]) * metres;
        numbers[3 + 4 * axis] = 0.5 * (max[axis] - min[axis]) * metres;
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    const ORIGIN: [f64; 3] = [691_000.0, 5_334_000.0, 500.0];

    fn tile(level: u32, square: [i64; 2]) -> MeshTile {
        let edge = f64::from(50 << level);
        let corner = [square[0] as f64 * edge, square[1] as f64 * edge, 500.0];
        MeshTile {
            level,
            square,
            uri: mesh_tile_name(level, square),
            bounds: [corner, [corner[0] + edge, corner[1] + edge, 530.0]],
        }
    }

    fn tileset(tiles: Vec<MeshTile>) -> Tileset {
        Tileset {
            tiles,
            geometric_errors: vec![0.1, 0.4],
            origin: ORIGIN,
            crs: None,
        }
    }

    #[test]
    fn a_box_is_around_the_origin_that_the_transform_moves_to_its_place() {
        let document = tileset(vec![tile(0, [13_820, 106_680])])
            .document()
            .unwrap();
        let root = &document["root"];
        assert_eq!(
            root["boundingVolume"]["box"],
            json!([
                25.0, 25.0, 15.0, 25.0, 0.0, 0.0, 0.0, 25.0, 0.0, 0.0, 0.0, 15.0
            ])
        );
        assert_eq!(root["transform"][12], ORIGIN[0]);
        assert_eq!(root["content"]["uri"], "level0_13820_106680.glb");
        assert_eq!(root["geometricError"], 0.1);
        let error = document["geometricError"].as_f64().unwrap();
        assert!((error - 5900_f64.sqrt()).abs() < 1e-9, "{error}");
        assert!(root.get("children").is_none());
    }

    #[test]
    fn feet_become_metres_everywhere() {
        let mut tileset = tileset(vec![tile(0, [13_820, 106_680])]);
        tileset.crs = Some(Crs::Wkt("PROJCS[\"p\",UNIT[\"foot\",0.3048]]".to_owned()));
        let document = tileset.document().unwrap();
        let root = &document["root"];
        assert_eq!(root["transform"][13], 5_334_000.0 * 0.3048);
        assert_eq!(root["boundingVolume"]["box"][0], 25.0 * 0.3048);
        assert_eq!(root["geometricError"], 0.1 * 0.3048);
    }

    #[test]
    fn the_box_of_a_flat_tile_is_inside_of_the_one_above() {
        let up_to = |top: f64, tile: MeshTile| {
            let [[x, y, z], [far_x, far_y, _]] = tile.bounds;
            let bounds = [[x, y, z], [far_x, far_y, top]];
            MeshTile { bounds, ..tile }
        };
        let flat = up_to(500.0, tile(0, [13_820, 106_680]));
        let nearly_flat = up_to(500.0005, tile(1, [6_910, 53_340]));
        let document = tileset(vec![flat, nearly_flat]).document().unwrap();
        let low = |tile: &Value| {
            let number = |k: usize| tile["boundingVolume"]["box"][k].as_f64().unwrap();
            number(2) - number(11)
        };
        let (root, below) = (&document["root"], &document["root"]["children"][0]);
        assert_eq!(below["boundingVolume"]["box"][11], LEAST_HALF_EDGE_M);
        assert!(low(root) <= low(below), "{document}");
    }

    #[test]
    fn no_tiles_are_an_empty_root() {
        let document = tileset(Vec::new()).document().unwrap();
        assert_eq!(document["root"]["geometricError"], 0.0);
        assert!(document["root"].get("content").is_none());
    }

    #[test]
    fn tiles_that_make_no_hierarchy_are_refused() {
        let cases = [
            (vec![tile(0, [1, 2]), tile(0, [1, 2])], "two tiles"),
            (vec![tile(2, [1, 2])], "level 2"),
            (
                vec![MeshTile {
                    bounds: [[f64::NAN; 3]; 2],
                    ..tile(0, [1, 2])
                }],
                "bounds",
            ),
        ];
        for (tiles, expected) in cases {
            let error = tileset(tiles).document().unwrap_err();
            assert!(error.contains(expected), "{error}");
        }
        let mut falling = tileset(Vec::new());
        falling.geometric_errors = vec![1.0, 1.0];
        assert!(falling.document().unwrap_err().contains("do not grow"));
    }
}
