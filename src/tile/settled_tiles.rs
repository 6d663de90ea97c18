//! The records of all tiles after the stitch, each moved to the final position of its site.

use std::path::Path;

use super::{block_file::BlockFile, error::TileError};

/// The records of all tiles after the stitch, each moved to the final position of its site.
#[derive(Debug)]
pub(crate) struct SettledTiles(BlockFile);

/// The name of the file in the scratch directory.
const SETTLED_FILE: &str = "tiles.settled";

impl SettledTiles {
    /// Makes an empty file in the directory `dir`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be made.
    pub(crate) fn create(dir: &Path) -> Result<Self, TileError> {
        Ok(Self(BlockFile::create(&dir.join(SETTLED_FILE))?))
    }

    /// Adds the records of `tile`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if they cannot be written.
    pub(crate) fn add(&mut self, tile: u32, records: &[u8]) -> Result<(), TileError> {
        self.0.append(&[(tile.into(), records)])
    }

    /// Reads the records of `tile`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if they cannot be read, [`TileError::Damaged`] if they were not added or
    /// are not what was written.
    pub(crate) fn records(&self, tile: u32) -> Result<Vec<u8>, TileError> {
        self.0.read(tile.into())
    }
}
