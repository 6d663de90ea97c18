//! The writer for each format.

use std::path::Path;

use super::{
    cloud::{CloudHeader, Workspace},
    copc::{help_write_copc, write_copc},
    las::create_las,
    las_header::PointEncoding,
    output_format::Format,
    pcd::write_pcd,
    ply::create_ply,
    progressive::write_progressive,
    store::{SortedRecords, StoreError},
    tile_format::TileFormat,
    tiles::{help_write_tiles, write_tiles},
    writer::{CloudWriter, CompleteCloud},
};
use crate::{geometry::Rect, las::error::LasError};

impl CloudWriter {
    /// Begins the cloud at `path`, under another name in the same directory, in a format that keeps the order of the points.
    ///
    /// # Errors
    ///
    /// If no file can be made there, or the `format` keeps no order.
    pub(crate) fn create(
        path: &Path,
        format: Format,
        header: &CloudHeader,
    ) -> Result<Self, LasError> {
        format.check_replaceable(path)?;
        match format {
            Format::Las => create_las(path, header, PointEncoding::Las),
            Format::Laz => create_las(path, header, PointEncoding::Laz),
            Format::Ply => create_ply(path, header),
            Format::Copc | Format::Pcd | Format::Tiles(_) => Err(LasError::unwritable(
                path,
                "its points have to be sorted, but not here; write .laz",
            )),
        }
    }
}

/// Does parts of the work of [`write_sorted`], whose cloud another process writes.
///
/// # Errors
///
/// If temporary files cannot be read or written.
pub(crate) fn help_write_sorted(
    format: Format,
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
) -> Result<(), StoreError> {
    match format {
        Format::Copc => help_write_copc(header, workspace, sorted),
        Format::Tiles(TileFormat::Laz) => help_write_tiles(header, workspace, sorted),
        _ => Ok(()),
    }
}

/// Writes the points of `sorted` as a cloud that is to become `path`: in the order of the `format` or, if it keeps any order,
/// as a progressive file. If the cloud has levels, those of the points in `seen` are returned with it. `progress` gets the
/// numbers of points that are written.
///
/// # Errors
///
/// If the cloud cannot be written, or would replace a directory with other files; nothing is left of it then.
pub(crate) fn write_sorted(
    path: &Path,
    format: Format,
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
    seen: Option<&Rect>,
    progress: &dyn Fn(u64),
) -> Result<CompleteCloud, LasError> {
    format.check_replaceable(path)?;
    match format {
        Format::Copc => write_copc(path, header, workspace, sorted, seen, progress),
        Format::Pcd => write_pcd(path, header, workspace, sorted, progress),
        Format::Tiles(format) => write_tiles(path, format, header, workspace, sorted, progress),
        Format::Las | Format::Laz | Format::Ply => {
            let ordered = CloudWriter::create(path, format, header)?;
            write_progressive(ordered, path, header, workspace, sorted, seen, progress)
        }
    }
}
