//! A cloud as a directory of LAZ or PCD files, one for each square of the plane, with an index, and a catalogue of LAZ.

use std::path::Path;

use serde_json::{Value, json};

use super::{
    cloud::{CloudHeader, Workspace},
    las::create_las,
    las_header::PointEncoding,
    ordered_records::OrderedRecords,
    part_file::PartFile,
    pcd::PcdCloud,
    pcd_tiles::write_driving_index,
    squares::Squares,
    store::SortedRecords,
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
    let tiles = Tiles {
        directory: part.part(),
        format,
        pcd: (format == TileFormat::Pcd)
            .then(|| PcdCloud::new(header, workspace, &sorted.bounds())),
        ordered: OrderedRecords::new(sorted, header.record.record_length(), workspace.sort_bytes),
        name: &name.unwrap_or_default(),
        header,
        squares: Squares::new(workspace.tile_edge, &header.quantization),
    };
    let bytes = tiles.write(sorted, progress)?;
    Ok(CompleteCloud::of_directory(part, sorted.points(), bytes))
}

/// The tiles of a cloud.
struct Tiles<'a> {
    directory: &'a Path,
    /// The name of the cloud, with which the names of the tiles begin.
    name: &'a str,
    format: TileFormat,
    /// What PCD tiles have in common, if the tiles are some.
    pcd: Option<PcdCloud>,
    /// The records in an order that depends on nothing else.
    ordered: OrderedRecords<'a>,
    header: &'a CloudHeader,
    squares: Squares,
}

impl Tiles<'_> {
    /// Writes all points of `sorted`, and an index. `progress` gets the numbers of points
    /// that are written. Returns the length of all files in bytes.
    fn write(&self, sorted: &dyn SortedRecords, progress: &dyn Fn(u64)) -> Result<u64, LasError> {
        let (mut bytes, mut points) = (0, 0);
        let (mut features, mut corners, mut catalogued) = (Vec::new(), Vec::new(), Vec::new());
        for square in self.squares.occupied(sorted) {
            let corner = self.squares.corner(square);
            let file = tile_name(self.name, corner, self.format);
            let (cloud, bounds) = self.write_tile(&self.directory.join(&file), square)?;
            if cloud.points() == 0 {
                // The square shares a counting square with its neighbours' points only.
                continue;
            }
            progress(cloud.points());
            bytes += cloud.bytes();
            points += cloud.points();
            let bounds = self.world(bounds);
            features.push(Self::feature(&file, &self.squares, square, &cloud, bounds));
            catalogued.push(CataloguedTile {
                file: file.clone(),
                points: cloud.points(),
                bounds,
            });
            corners.push((file, corner));
            cloud.deliver()?;
        }
        if points != sorted.points() {
            let lost = format!(
                "only {points} of {} points have a tile; this is a defect of the program, \
                 please report it",
                sorted.points()
            );
            return Err(LasError::new(self.directory, lost));
        }
        bytes += self.write_index(features)?;
        if self.format == TileFormat::Laz {
            let catalogue = tile_catalogue(self.header, &catalogued);
            bytes += self.write_text(&format!("{}{CATALOGUE_ENDING}", self.name), &catalogue)?;
        }
        if let Some(pcd) = &self.pcd {
            bytes +=
                write_driving_index(self.directory, self.squares.edge(), pcd.origin, &corners)?;
        }
        Ok(bytes)
    }

    /// Writes the points of a square to `path`; returns them with their least and greatest
    /// coordinates in stored units.
    fn write_tile(
        &self,
        path: &Path,
        square: [i64; 2],
    ) -> Result<(CompleteCloud, [[i32; 3]; 2]), LasError> {
        let rect = self.squares.rect(square);
        let mut bounds = [[i32::MAX; 3], [i32::MIN; 3]];
        if let Some(pcd) = &self.pcd {
            let cloud = pcd.write_file(path, &self.ordered, &rect, &mut |record| {
                extend(&mut bounds, Stored::of_record(record));
            })?;
            return Ok((cloud, bounds));
        }
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
        Ok((writer.complete()?, bounds))
    }

    /// The world coordinates of `bounds`.
    fn world(&self, bounds: [[i32; 3]; 2]) -> [[f64; 3]; 2] {
        bounds.map(|[x, y, z]| self.header.quantization.world(Stored { x, y, z }))
    }

    /// The entry of a tile in the index.
    fn feature(
        file: &str,
        squares: &Squares,
        square: [i64; 2],
        cloud: &CompleteCloud,
        [min, max]: [[f64; 3]; 2],
    ) -> Value {
        json!({
            "type": "Feature",
            "properties": {
                "file": file, "points": cloud.points(), "bytes": cloud.bytes(),
                "zmin": min[2], "zmax": max[2],
            },
            "geometry": {
                "type": "Polygon",
                "coordinates": [squares.outline(square)],
            },
        })
    }

    /// Writes the index, and returns its length in bytes.
    fn write_index(&self, features: Vec<Value>) -> Result<u64, LasError> {
        let index = json!({
            "type": "FeatureCollection",
            "name": self.name,
            "wkt": self.header.crs.as_ref().and_then(Crs::wkt),
            "features": features,
        });
        self.write_text(INDEX_NAME, &index)
    }

    /// Writes `value` to the file `name` in the directory, and returns its length in bytes.
    fn write_text(&self, name: &str, value: &Value) -> Result<u64, LasError> {
        let text = value.to_string();
        let path = self.directory.join(name);
        std::fs::write(&path, &text).map_err(|e| LasError::unwritable(&path, e))?;
        Ok(text.len() as u64)
    }
}

/// Extends `bounds`, in stored units, by a point.
fn extend(bounds: &mut [[i32; 3]; 2], point: Stored) {
    for (axis, c) in [point.x, point.y, point.z].into_iter().enumerate() {
        bounds[0][axis] = bounds[0][axis].min(c);
        bounds[1][axis] = bounds[1][axis].max(c);
    }
}
