//! The results of the tiles of a job, on the disk.

use std::path::Path;

use crate::{
    job::{error::JobError, tile_figures::TileFigures},
    tile::{BlockFile, SolvedCore, SolvedSite, SolvedTile, TileError, band_from_bytes},
};

/// The solved tiles of a job: three blocks for each tile, its core, its band, and its figures.
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
        self.with(keys(tile)[2]).is_some()
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
        let [core, band] = solved.to_bytes();
        let [core_key, band_key, figures_key] = keys(tile);
        let file = self.0.last_mut().ok_or_else(damaged)?;
        file.append(&[(core_key, &core), (band_key, &band)])?;
        // The figures say that the tile is solved: its sites are on the disk before them.
        file.flush()?;
        file.append(&[(figures_key, &text)])?;
        Ok(file.flush()?)
    }

    /// Reads the figures of `tile`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the tile is not solved, or its block is damaged.
    pub(crate) fn figures(&self, tile: u32) -> Result<TileFigures, JobError> {
        let text = self.read(keys(tile)[2])?;
        Ok(serde_json::from_slice(&text).map_err(|_| damaged())?)
    }

    /// Reads the sites that are at home in `tile`, with their records.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the tile is not solved, or its block is damaged.
    pub(crate) fn core(&self, tile: u32) -> Result<SolvedCore, JobError> {
        let bytes = self.read(keys(tile)[0])?;
        Ok(SolvedCore::from_bytes(&bytes).ok_or_else(damaged)?)
    }

    /// Reads the sites around the core of `tile`, as it has solved them.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the tile is not solved, or its block is damaged.
    pub(crate) fn band(&self, tile: u32) -> Result<Vec<SolvedSite>, JobError> {
        let bytes = self.read(keys(tile)[1])?;
        Ok(band_from_bytes(&bytes).ok_or_else(damaged)?)
    }
}

/// The keys of the blocks with the core, the band and the figures of `tile`.
fn keys(tile: u32) -> [u64; 3] {
    [0, 1, 2].map(|block| 3 * u64::from(tile) + block)
}

fn damaged() -> TileError {
    TileError::Damaged {
        path: OWN_FILE.to_owned(),
    }
}
