//! The records of the tiles, moved to where their sites end.

use std::path::Path;

use super::{TileError, pack::BlockFile};

/// The records of the tiles, moved to where their sites end.
#[derive(Debug)]
pub(crate) struct SettledTiles(BlockFile);

/// The name of the file.
const SETTLED: &str = "tiles.settled";

impl SettledTiles {
    /// No tile as yet, in the job directory `dir`.
    pub(crate) fn create(dir: &Path) -> Result<Self, TileError> {
        Ok(Self(BlockFile::create(&dir.join(SETTLED))?))
    }

    /// Adds the records of `tile`.
    pub(crate) fn add(&mut self, tile: u32, records: &[u8]) -> Result<(), TileError> {
        self.0.append(&[(tile.into(), records)])
    }

    /// The records of `tile`.
    pub(crate) fn records(&self, tile: u32) -> Result<Vec<u8>, TileError> {
        self.0.read(tile.into())
    }
}
