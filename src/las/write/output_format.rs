//! The formats in which clouds are written, by the names of files.

use std::path::Path;

use super::{tile_format::TileFormat, tile_names::contains_only_tiles};
use crate::las::error::LasError;

/// The format of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Format {
    /// Uncompressed LAS.
    Las,
    /// Compressed LAS.
    Laz,
    /// Compressed LAS as an octree, of which viewers read parts from a server.
    Copc,
    /// Polygon file format, points only.
    Ply,
    /// The format of the Point Cloud Library.
    Pcd,
    /// A directory of tiles.
    Tiles(TileFormat),
}

impl Format {
    /// The format that the ending of `path` stands for.
    ///
    /// # Errors
    ///
    /// If it stands for none that can be written.
    pub(crate) fn of_path(path: &Path) -> Result<Self, LasError> {
        let name = path
            .file_name()
            .map(|name| name.to_string_lossy().to_ascii_lowercase())
            .unwrap_or_default();
        if name.ends_with(".copc.laz") {
            return Ok(Self::Copc);
        }
        match path.extension().map(|e| e.to_ascii_lowercase()) {
            Some(e) if e == "las" => Ok(Self::Las),
            Some(e) if e == "laz" => Ok(Self::Laz),
            Some(e) if e == "ply" => Ok(Self::Ply),
            Some(e) if e == "pcd" => Ok(Self::Pcd),
            _ => Err(LasError::new(
                path,
                "name the output .copc.laz, .laz, .las, .ply or .pcd",
            )),
        }
    }

    /// Whether points stand in the file in the order in which they are given.
    pub(crate) fn keeps_order(self) -> bool {
        matches!(self, Self::Las | Self::Laz | Self::Ply)
    }

    /// Whether it is PCD, one file or tiles. Its colours are relative to the largest value of all.
    pub(crate) fn is_pcd(self) -> bool {
        matches!(self, Self::Pcd | Self::Tiles(TileFormat::Pcd))
    }

    /// Whether several processes can make it together, once its points are sorted.
    pub(crate) fn is_made_by_many(self) -> bool {
        matches!(self, Self::Copc | Self::Tiles(TileFormat::Laz))
    }

    /// Refuses to replace a directory, except that tiles replace one in which there is
    /// nothing but tiles.
    ///
    /// # Errors
    ///
    /// If there is another directory at `path`.
    pub(crate) fn check_replaceable(self, path: &Path) -> Result<(), LasError> {
        match path.is_dir() && !(matches!(self, Self::Tiles(_)) && contains_only_tiles(path)) {
            true => Err(LasError::new(
                path,
                "is a directory in which there are other things than tiles; give another name",
            )),
            false => Ok(()),
        }
    }
}
