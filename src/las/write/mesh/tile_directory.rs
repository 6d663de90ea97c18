//! A mesh as a directory of GLB tiles with their index: complete under its name, or not there
//! at all.

use std::path::{Path, PathBuf};

use super::{tileset::Tileset, writer::CompleteMesh};
use crate::las::{error::LasError, write::part_file::PartFile};

/// The name of the index.
const TILESET_NAME: &str = "tileset.json";

/// A directory of tiles under a preliminary name; nothing is left of it if it is dropped.
#[derive(Debug)]
pub(crate) struct MeshTileDirectory {
    part: PartFile,
}

impl MeshTileDirectory {
    /// Makes an empty directory that is to become `path`.
    ///
    /// # Errors
    ///
    /// If there is something else than tiles at `path`, or no directory can be made there.
    pub(crate) fn create(path: &Path) -> Result<Self, LasError> {
        if path.is_file() || path.is_dir() && !contains_only_mesh_tiles(path) {
            let problem = "there are other things than tiles of a mesh; give another name";
            return Err(LasError::new(path, problem));
        }
        let part = PartFile::create_directory(path)?;
        Ok(Self { part })
    }

    /// The path of the file `name` while the directory has its preliminary name. Contents are
    /// delivered there before the directory is completed.
    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.part.part().join(name)
    }

    /// Writes the index of `tileset`, all of whose contents are in the directory.
    ///
    /// # Errors
    ///
    /// If a content is missing, the tiles make no hierarchy, or the index cannot be written;
    /// nothing is left of the directory then.
    pub(crate) fn complete(self, tileset: &Tileset) -> Result<CompleteMesh, LasError> {
        tileset.write(&self.file(TILESET_NAME))?;
        for tile in &tileset.tiles {
            let path = self.file(&tile.uri);
            std::fs::metadata(&path).map_err(|e| LasError::unreadable(&path, e))?;
        }
        Ok(CompleteMesh::new(self.part))
    }
}

/// Whether all files in the directory `dir` are tiles of a mesh and their index, so that new
/// tiles may replace it.
fn contains_only_mesh_tiles(dir: &Path) -> bool {
    let is_tile =
        |name: &str| name == TILESET_NAME || name.starts_with("level") && name.ends_with(".glb");
    std::fs::read_dir(dir).is_ok_and(|mut entries| {
        entries.all(|e| e.is_ok_and(|e| is_tile(&e.file_name().to_string_lossy())))
    })
}
