//! The results of the tiles of a job, on the disk.

use std::path::Path;

use crate::{
    job::{error::JobError, tile_figures::TileFigures},
    tile::{BlockFile, SolvedTile, TileError},
};

/// The solved tiles of a job: two blocks for each tile, its sites and records, then its figures.
///
/// A tile is solved if its figures are there. The blocks may be in several files; tiles are added
/// to the last one.
#[derive(Debug)]
pub(crate) struct SolvedTiles(Vec<BlockFile>);

/// Name of the file in the job directory to which one process adds its tiles.
const OWN_FILE: &str = "tiles.solved";

impl SolvedTiles {
    /// Opens the tiles that are solved in the job directory `dir`: those in `files`, which other
    /// processes have written, and those of this process, to which tiles can be added.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the file of this process cannot be opened.
    pub(crate) fn open(dir: &Path, mut files: Vec<BlockFile>) -> Result<Self, JobError> {
        files.push(BlockFile::open(&dir.join(OWN_FILE))?);
        Ok(Self(files))
    }

    /// The tiles in `files`; tiles are added to the last of these.
    pub(crate) fn of(files: Vec<BlockFile>) -> Self {
        Self(files)
    }

    /// Whether `tile` is solved.
    pub(crate) fn contains(&self, tile: u32) -> bool {
        self.with(figures_key(tile)).is_some()
    }

    fn with(&self, key: u64) -> Option<&BlockFile> {
        self.0.iter().find(|file| file.contains(key))
    }

    fn read(&self, key: u64) -> Result<Vec<u8>, JobError> {
        Ok(self.with(key).ok_or_else(damaged)?.read(key)?)
    }

    /// Adds a tile; when this returns, the tile is on the disk.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the file cannot be written.
    pub(crate) fn add(
        &mut self,
        tile: u32,
        solved: &SolvedTile,
        figures: &TileFigures,
    ) -> Result<(), JobError> {
        let text = serde_json::to_vec(figures).expect("figures are plain numbers");
        let (solved, key) = (solved.to_bytes(), figures_key(tile));
        let file = self.0.last_mut().ok_or_else(damaged)?;
        file.append(&[(key - 1, &solved), (key, &text)])?;
        Ok(file.flush()?)
    }

    /// Reads the figures of `tile`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the tile is not solved, or its block is damaged.
    pub(crate) fn figures(&self, tile: u32) -> Result<TileFigures, JobError> {
        let text = self.read(figures_key(tile))?;
        Ok(serde_json::from_slice(&text).map_err(|_| damaged())?)
    }

    /// Reads the sites and records of `tile`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the tile is not solved, or its block is damaged.
    pub(crate) fn solved(&self, tile: u32) -> Result<SolvedTile, JobError> {
        let bytes = self.read(figures_key(tile) - 1)?;
        Ok(SolvedTile::from_bytes(&bytes).ok_or_else(damaged)?)
    }
}

/// The number of the block with the figures of `tile`; the block before it contains the tile itself.
fn figures_key(tile: u32) -> u64 {
    2 * u64::from(tile) + 1
}

fn damaged() -> TileError {
    TileError::Damaged {
        path: OWN_FILE.to_owned(),
    }
}
