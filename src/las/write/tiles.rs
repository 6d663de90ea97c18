//! A cloud as a directory of LAZ or PCD files, one for each square of the plane, with an index, and a catalogue of LAZ.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{
    cloud::{CloudHeader, Workspace},
    las::create_las,
    las_header::PointEncoding,
    ordered_records::OrderedRecords,
    part_file::PartFile,
    pcd::PcdCloud,
    pcd_tiles::write_driving_index,
    pieces::{Piece, Workforce},
    squares::Squares,
    store::{SortedRecords, StoreError},
    tile_catalogue::{CataloguedTile, tile_catalogue},
    tile_format::TileFormat,
    tile_names::{CATALOGUE_ENDING, INDEX_NAME, tile_name},
    writer::CompleteCloud,
};
use crate::{
    geometry::Stored,
    las::{error::LasError, format::crs::Crs},
};

/// The bytes of records that are passed to the writer of a tile at a time.
const TILE_BATCH_BYTES: usize = 4 << 20;

/// Writes the points of `sorted` as a directory of tiles that is to become `path`. `progress` gets the numbers of points that
/// are written.
///
/// # Errors
///
/// If no directory can be made there, or temporary files cannot be read.
pub(super) fn write_tiles(
    path: &Path,
    format: TileFormat,
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
    progress: &dyn Fn(u64),
) -> Result<CompleteCloud, LasError> {
    let part = PartFile::create_directory(path)?;
    let name = path.file_name().map(|name| name.to_string_lossy());
    let tiles = Tiles::new(format, header, workspace, sorted);
    let directory = Directory {
        path: part.part(),
        name: &name.unwrap_or_default(),
        tiles: &tiles,
    };
    let bytes = directory.write(sorted, progress)?;
    Ok(CompleteCloud::of_directory(part, sorted.points(), bytes))
}

/// Does a part of the work of [`write_tiles`] in LAZ, whose directory another process writes.
///
/// # Errors
///
/// If temporary files cannot be read or written.
pub(super) fn help_write_tiles(
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
) -> Result<(), StoreError> {
    let tiles = Tiles::new(TileFormat::Laz, header, workspace, sorted);
    let mut file_of = |_| Err("a process that helps has no directory".into());
    tiles.pass(
        &tiles.squares.occupied(sorted),
        &mut file_of,
        &mut |_, _| Ok(()),
    )
}

/// The tiles of a cloud.
struct Tiles<'a> {
    format: TileFormat,
    /// What PCD tiles have in common, if the tiles are some.
    pcd: Option<PcdCloud>,
    /// The records in an order that depends on nothing else.
    ordered: OrderedRecords<'a>,
    header: &'a CloudHeader,
    squares: Squares,
    workforce: &'a dyn Workforce,
}

/// A tile that is written.
#[derive(Serialize, Deserialize)]
struct WrittenTile {
    /// The file, if it is not in its place yet.
    file: Option<PathBuf>,
    points: u64,
    bytes: u64,
    /// The least and the greatest coordinates (stored units).
    bounds: [[i32; 3]; 2],
}

/// The path of the tile of a square.
type FileOf<'a> = dyn FnMut([i64; 2]) -> Result<PathBuf, StoreError> + 'a;

impl<'a> Tiles<'a> {
    fn new(
        format: TileFormat,
        header: &'a CloudHeader,
        workspace: &Workspace<'a>,
        sorted: &'a dyn SortedRecords,
    ) -> Self {
        let length = header.record.record_length();
        Self {
            format,
            pcd: (format == TileFormat::Pcd)
                .then(|| PcdCloud::new(header, workspace, &sorted.bounds())),
            ordered: OrderedRecords::new(sorted, length, workspace.sort_bytes),
            header,
            squares: Squares::new(workspace.tile_edge, &header.quantization),
            workforce: workspace.workforce,
        }
    }

    /// Writes the tiles of `squares`: those that processes share to directories of their own, all others to the paths of
    /// `file_of`. Passes them to `take`.
    fn pass(
        &self,
        squares: &[[i64; 2]],
        file_of: &mut FileOf<'_>,
        take: &mut dyn FnMut([i64; 2], WrittenTile) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let shared = self.workforce.shared_directory();
        let mut make = |number: usize| {
            let square = squares[number];
            let path = match shared {
                Some(directory) => {
                    std::fs::create_dir_all(directory)?;
                    directory.join(format!("{number}{}", self.format.ending()))
                }
                None => file_of(square)?,
            };
            let tile = self.write_tile(&path, square)?;
            let file = shared.map(|_| path);
            let piece = serde_json::to_vec(&WrittenTile { file, ..tile })?;
            Ok::<_, StoreError>(vec![piece])
        };
        let mut taken = |number: usize, piece: Piece| {
            take(squares[number], serde_json::from_slice(&piece.concat())?)
        };
        (self.workforce).pass("written", squares.len(), &mut make, &mut taken)
    }

    /// Writes the points of a square to `path`; a square without points has no file.
    fn write_tile(&self, path: &Path, square: [i64; 2]) -> Result<WrittenTile, LasError> {
        let rect = self.squares.rect(square);
        let mut bounds = [[i32::MAX; 3], [i32::MIN; 3]];
        let cloud = if let Some(pcd) = &self.pcd {
            pcd.write_file(path, &self.ordered, &rect, &mut |record| {
                extend(&mut bounds, Stored::of_record(record));
            })?
        } else {
            let mut writer = create_las(path, self.header, PointEncoding::Laz)?;
            let mut waiting = Vec::new();
            let visited = self.ordered.visit(&rect, &mut |record| {
                extend(&mut bounds, Stored::of_record(record));
                waiting.extend_from_slice(record);
                if waiting.len() >= TILE_BATCH_BYTES {
                    writer.write(&waiting)?;
                    waiting.clear();
                }
                Ok(())
            });
            visited.map_err(|e| LasError::unwritable(path, e))?;
            writer.write(&waiting)?;
            writer.complete()?
        };
        let (points, bytes) = (cloud.points(), cloud.bytes());
        // The square may share a counting square with its neighbours' points only.
        if points > 0 {
            cloud.deliver()?;
        }
        Ok(WrittenTile {
            file: None,
            points,
            bytes,
            bounds,
        })
    }
}

/// The directory of the tiles of a cloud.
struct Directory<'a> {
    path: &'a Path,
    /// The name of the cloud, with which the names of the tiles begin.
    name: &'a str,
    tiles: &'a Tiles<'a>,
}

impl Directory<'_> {
    /// Writes all points of `sorted`, and an index. `progress` gets the numbers of points
    /// that are written. Returns the length of all files in bytes.
    fn write(&self, sorted: &dyn SortedRecords, progress: &dyn Fn(u64)) -> Result<u64, LasError> {
        let tiles = self.tiles;
        let (mut bytes, mut points) = (0, 0);
        let (mut features, mut corners, mut catalogued) = (Vec::new(), Vec::new(), Vec::new());
        let name_of = |square| tile_name(self.name, tiles.squares.corner(square), tiles.format);
        let mut file_of = |square| Ok(self.path.join(name_of(square)));
        let mut take = |square: [i64; 2], tile: WrittenTile| {
            if tile.points == 0 {
                return Ok(());
            }
            let file = name_of(square);
            if let Some(found) = &tile.file {
                bring(found, &self.path.join(&file))?;
            }
            progress(tile.points);
            bytes += tile.bytes;
            points += tile.points;
            let bounds = self.world(tile.bounds);
            features.push(self.feature(&file, square, &tile, bounds));
            corners.push((file.clone(), tiles.squares.corner(square)));
            catalogued.push(CataloguedTile {
                file,
                points: tile.points,
                bounds,
            });
            Ok(())
        };
        let passed = tiles.pass(&tiles.squares.occupied(sorted), &mut file_of, &mut take);
        passed.map_err(|e| LasError::unwritable(self.path, e))?;
        if points != sorted.points() {
            let lost = format!(
                "only {points} of {} points have a tile; this is a defect of the program, \
                 please report it",
                sorted.points()
            );
            return Err(LasError::new(self.path, lost));
        }
        bytes += self.write_index(features)?;
        if tiles.format == TileFormat::Laz {
            let catalogue = tile_catalogue(tiles.header, &catalogued);
            bytes += self.write_text(&format!("{}{CATALOGUE_ENDING}", self.name), &catalogue)?;
        }
        if let Some(pcd) = &tiles.pcd {
            bytes += write_driving_index(self.path, tiles.squares.edge(), pcd.origin, &corners)?;
        }
        Ok(bytes)
    }

    /// The world coordinates of `bounds`.
    fn world(&self, bounds: [[i32; 3]; 2]) -> [[f64; 3]; 2] {
        bounds.map(|[x, y, z]| self.tiles.header.quantization.world(Stored { x, y, z }))
    }

    /// The entry of a tile in the index.
    fn feature(
        &self,
        file: &str,
        square: [i64; 2],
        tile: &WrittenTile,
        [min, max]: [[f64; 3]; 2],
    ) -> Value {
        json!({
            "type": "Feature",
            "properties": {
                "file": file, "points": tile.points, "bytes": tile.bytes,
                "zmin": min[2], "zmax": max[2],
            },
            "geometry": {
                "type": "Polygon",
                "coordinates": [self.tiles.squares.outline(square)],
            },
        })
    }

    /// Writes the index, and returns its length in bytes.
    fn write_index(&self, features: Vec<Value>) -> Result<u64, LasError> {
        let index = json!({
            "type": "FeatureCollection",
            "name": self.name,
            "wkt": self.tiles.header.crs.as_ref().and_then(Crs::wkt),
            "features": features,
        });
        self.write_text(INDEX_NAME, &index)
    }

    /// Writes `value` to the file `name` in the directory, and returns its length in bytes.
    fn write_text(&self, name: &str, value: &Value) -> Result<u64, LasError> {
        let text = value.to_string();
        let path = self.path.join(name);
        std::fs::write(&path, &text).map_err(|e| LasError::unwritable(&path, e))?;
        Ok(text.len() as u64)
    }
}

/// Brings a file to its place: as another name of it, or where that cannot be as a copy. A process that is killed after that finds
/// the file again.
fn bring(file: &Path, place: &Path) -> Result<(), LasError> {
    let linked = std::fs::hard_link(file, place);
    let brought = linked.or_else(|_| std::fs::copy(file, place).map(drop));
    brought.map_err(|e| LasError::unwritable(place, format!("from {}: {e}", file.display())))
}

/// Extends `bounds`, in stored units, by a point.
fn extend(bounds: &mut [[i32; 3]; 2], point: Stored) {
    for (axis, c) in [point.x, point.y, point.z].into_iter().enumerate() {
        bounds[0][axis] = bounds[0][axis].min(c);
        bounds[1][axis] = bounds[1][axis].max(c);
    }
}
