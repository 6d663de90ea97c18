//! What is known of the tiles of a job: how they were solved, and where they end.

use std::path::Path;

use crate::job::{JobError, TileFigures, cluster};
use crate::tile::{BlockFile, SolvedTile, TileError};

/// The tiles that are solved: two blocks each, the figures last. Where they are, the
/// tile is solved. Of several files tiles are added to the last.
#[derive(Debug)]
pub(crate) struct SolvedTiles(Vec<BlockFile>);

/// The name of their file in the job directory.
const SOLVED: &str = "tiles.solved";

impl SolvedTiles {
    /// The tiles that are solved in the job directory `dir`, by this process and by others.
    pub(crate) fn open(dir: &Path) -> Result<Self, JobError> {
        let mut files = cluster::block_files(dir)?;
        files.push(BlockFile::open(&dir.join(SOLVED))?);
        Ok(Self(files))
    }

    /// The tiles in `files`.
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

    /// Adds a tile; it is on the disk then.
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

    /// The figures of `tile`.
    pub(crate) fn figures(&self, tile: u32) -> Result<TileFigures, JobError> {
        let text = self.read(figures_key(tile))?;
        Ok(serde_json::from_slice(&text).map_err(|_| damaged())?)
    }

    /// The sites and records of `tile`.
    pub(crate) fn solved(&self, tile: u32) -> Result<SolvedTile, JobError> {
        let bytes = self.read(figures_key(tile) - 1)?;
        Ok(SolvedTile::from_bytes(&bytes).ok_or_else(damaged)?)
    }
}

fn figures_key(tile: u32) -> u64 {
    2 * u64::from(tile) + 1
}

fn damaged() -> TileError {
    TileError::Damaged {
        path: SOLVED.to_owned(),
    }
}
