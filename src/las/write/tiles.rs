//! A cloud as a directory of LAZ or PCD files, one for each square of the plane, with an index.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::{
    cloud::{CloudHeader, Workspace},
    las::create_las,
    las_header::PointEncoding,
    ordered_records::OrderedRecords,
    part_file::PartFile,
    pcd::PcdCloud,
    pcd_fields::brightness,
    pcd_tiles::write_driving_index,
    sink::SinkMonitor,
    squares::Squares,
    store::{RecordSorter, SortedRecords},
    tile_format::TileFormat,
    tile_names::{INDEX_NAME, tile_name},
    writer::{CloudBody, CloudWriter, CompleteCloud, Completion},
};
use crate::{
    geometry::{Rect, Stored},
    las::{error::LasError, format::crs::Crs},
};

/// The bytes of records that are passed to the writer of a tile at a time.
const TILE_BATCH_BYTES: usize = 4 << 20;

/// The points of a directory of tiles.
struct TilesBody {
    /// The final path of the directory, whose name is that of the cloud.
    path: PathBuf,
    /// The preliminary path of the directory.
    directory: PathBuf,
    format: TileFormat,
    header: CloudHeader,
    workspace: Workspace,
    sorter: Box<dyn RecordSorter>,
    /// The largest value of a colour so far.
    brightest: u16,
}

/// Begins a directory of tiles at `path`.
///
/// # Errors
///
/// If no directory can be made there, or no file in the `workspace`.
pub(super) fn create_tiles(
    path: &Path,
    format: TileFormat,
    header: &CloudHeader,
    workspace: &Workspace,
) -> Result<CloudWriter, LasError> {
    let part = PartFile::create_directory(path)?;
    let body = TilesBody {
        path: path.to_owned(),
        directory: part.part().to_owned(),
        format,
        header: header.clone(),
        workspace: workspace.clone(),
        sorter: workspace.begin_sorting(header, path)?,
        brightest: 0,
    };
    let record_length = header.record.record_length();
    CloudWriter::new(part, SinkMonitor::default(), Box::new(body), record_length)
}

impl CloudBody for TilesBody {
    fn write(&mut self, records: &[u8]) -> Result<(), LasError> {
        if self.format == TileFormat::Pcd {
            self.brightest = self.brightest.max(brightness(records, &self.header.record));
        }
        self.sorter
            .push(records)
            .map_err(|e| LasError::unwritable(&self.path, e))
    }

    fn complete(
        self: Box<Self>,
        _points: u64,
        _seen: Option<&Rect>,
        progress: &dyn Fn(u64),
    ) -> Result<Completion, LasError> {
        let Self {
            path,
            directory,
            format,
            header,
            workspace,
            sorter,
            brightest,
        } = *self;
        let sorted = sorter.finish();
        let sorted = sorted.map_err(|e| LasError::unwritable(&path, e))?;
        let name = path.file_name().map(|name| name.to_string_lossy());
        let pcd = (format == TileFormat::Pcd).then(|| {
            let length = header.record.record_length();
            let ordered = OrderedRecords::new(&*sorted, length, workspace.sort_bytes);
            let pcd = PcdCloud::new(&header, &workspace, &sorted.bounds(), brightest);
            (pcd, ordered)
        });
        let tiles = Tiles {
            directory: &directory,
            format,
            pcd,
            name: &name.unwrap_or_default(),
            header: &header,
            squares: Squares::new(workspace.tile_edge, &header.quantization),
        };
        let bytes = tiles.write(&*sorted, progress)?;
        sorted.remove();
        Ok(Completion::Directory(bytes))
    }
}

/// The tiles of a cloud.
struct Tiles<'a> {
    directory: &'a Path,
    /// The name of the cloud, with which the names of the tiles begin.
    name: &'a str,
    format: TileFormat,
    /// What PCD tiles have in common, and the records in their order.
    pcd: Option<(PcdCloud, OrderedRecords<'a>)>,
    header: &'a CloudHeader,
    squares: Squares,
}

impl Tiles<'_> {
    /// Writes all points of `sorted`, and an index. `progress` gets the numbers of points
    /// that are written. Returns the length of all files in bytes.
    fn write(&self, sorted: &dyn SortedRecords, progress: &dyn Fn(u64)) -> Result<u64, LasError> {
        let (mut bytes, mut points) = (0, 0);
        let (mut features, mut corners) = (Vec::new(), Vec::new());
        for square in self.squares.occupied(sorted) {
            let corner = self.squares.corner(square);
            let file = tile_name(self.name, corner, self.format);
            let (cloud, heights) = self.write_tile(&self.directory.join(&file), square, sorted)?;
            if cloud.points() == 0 {
                // The square shares a counting square with its neighbours' points only.
                continue;
            }
            progress(cloud.points());
            bytes += cloud.bytes();
            points += cloud.points();
            features.push(self.feature(&file, square, &cloud, heights));
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
        if let Some((pcd, _)) = &self.pcd {
            bytes +=
                write_driving_index(self.directory, self.squares.edge(), pcd.origin, &corners)?;
        }
        Ok(bytes)
    }

    /// Writes the points of a square to `path`; returns them with their least and greatest
    /// height in stored units.
    fn write_tile(
        &self,
        path: &Path,
        square: [i64; 2],
        sorted: &dyn SortedRecords,
    ) -> Result<(CompleteCloud, [i32; 2]), LasError> {
        let mut heights = [i32::MAX, i32::MIN];
        if let Some((pcd, ordered)) = &self.pcd {
            let cloud =
                pcd.write_file(path, ordered, &self.squares.rect(square), &mut |record| {
                    let z = Stored::of_record(record).z;
                    heights = [heights[0].min(z), heights[1].max(z)];
                })?;
            return Ok((cloud, heights));
        }
        let mut writer = create_las(path, self.header, PointEncoding::Laz)?;
        let mut waiting = Vec::new();
        let mut failure = None;
        let visited = sorted.visit(&self.squares.rect(square), &mut |record| {
            if failure.is_some() {
                return;
            }
            let z = Stored::of_record(record).z;
            heights = [heights[0].min(z), heights[1].max(z)];
            waiting.extend_from_slice(record);
            if waiting.len() >= TILE_BATCH_BYTES {
                failure = writer.write(&waiting).err();
                waiting.clear();
            }
        });
        visited.map_err(|e| LasError::unwritable(path, e))?;
        if let Some(error) = failure {
            return Err(error);
        }
        writer.write(&waiting)?;
        Ok((writer.complete(None, &|_| {})?, heights))
    }

    /// The entry of a tile in the index.
    fn feature(
        &self,
        file: &str,
        square: [i64; 2],
        cloud: &CompleteCloud,
        heights: [i32; 2],
    ) -> Value {
        let quantization = &self.header.quantization;
        let [low, high] =
            heights.map(|z| quantization.offset[2] + f64::from(z) * quantization.scale);
        json!({
            "type": "Feature",
            "properties": {
                "file": file, "points": cloud.points(), "bytes": cloud.bytes(),
                "zmin": low, "zmax": high,
            },
            "geometry": {
                "type": "Polygon",
                "coordinates": [self.squares.outline(square)],
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
        let text = index.to_string();
        let path = self.directory.join(INDEX_NAME);
        std::fs::write(&path, &text).map_err(|e| LasError::unwritable(&path, e))?;
        Ok(text.len() as u64)
    }
}
