//! What is known of the tiles of a job: how they were solved, and where they end.

use std::path::Path;

use super::{JobError, TileFigures};
use crate::tile::{Pack, SolvedTile, TileError};

/// The tiles that are solved: two blocks each, the figures last. Where they are, the
/// tile is solved.
#[derive(Debug)]
pub(super) struct SolvedTiles(Pack);

/// The name of their file in the job directory.
const SOLVED: &str = "tiles.solved";
const SETTLED: &str = "tiles.settled";

impl SolvedTiles {
    /// The tiles that are solved in the job directory `dir`.
    pub(super) fn open(dir: &Path) -> Result<Self, JobError> {
        Ok(Self(Pack::open(&dir.join(SOLVED))?))
    }

    /// Whether `tile` is solved.
    pub(super) fn contains(&self, tile: u32) -> bool {
        self.0.contains(figures_key(tile))
    }

    /// Adds a tile; it is on the disk then.
    pub(super) fn add(
        &mut self,
        tile: u32,
        solved: &SolvedTile,
        figures: &TileFigures,
    ) -> Result<(), JobError> {
        let text = serde_json::to_vec(figures).expect("figures are plain numbers");
        let (solved, key) = (solved.to_bytes(), figures_key(tile));
        self.0.append(&[(key - 1, &solved), (key, &text)])?;
        Ok(self.0.flush()?)
    }

    /// The figures of `tile`.
    pub(super) fn figures(&self, tile: u32) -> Result<TileFigures, JobError> {
        let text = self.0.read(figures_key(tile))?;
        Ok(serde_json::from_slice(&text).map_err(|_| damaged())?)
    }

    /// The sites and records of `tile`.
    pub(super) fn solved(&self, tile: u32) -> Result<SolvedTile, JobError> {
        let bytes = self.0.read(figures_key(tile) - 1)?;
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

/// The records of the tiles, moved to where their sites end.
#[derive(Debug)]
pub(super) struct SettledTiles(Pack);

impl SettledTiles {
    /// None as yet, in the job directory `dir`.
    pub(super) fn create(dir: &Path) -> Result<Self, JobError> {
        Ok(Self(Pack::create(&dir.join(SETTLED))?))
    }

    /// Adds the records of `tile`.
    pub(super) fn add(&mut self, tile: u32, records: &[u8]) -> Result<(), JobError> {
        Ok(self.0.append(&[(tile.into(), records)])?)
    }

    /// The records of `tile`.
    pub(super) fn records(&self, tile: u32) -> Result<Vec<u8>, JobError> {
        Ok(self.0.read(tile.into())?)
    }
}
