//! The records of all tiles after the stitch, each moved to the final position of its site.

use super::error::TileError;
use crate::{
    geometry::{Rect, Stored},
    las::{KeptPieces, Piece},
};

/// The sections of a settled tile.
const RECORDS: usize = 0;
const BORDER: usize = 1;
const SUMS: usize = 2;
/// The length of a position, in bytes.
const POSITION_BYTES: usize = 12;

/// The records of all tiles after the stitch: a piece of work for each tile, by its number.
///
/// The positions near the border of its core stand in a section of their own, because neighbours need them without records.
#[derive(Debug)]
pub(crate) struct SettledTiles(Box<dyn KeptPieces>);

impl SettledTiles {
    /// The settled tiles in `pieces`.
    pub(crate) fn new(pieces: Box<dyn KeptPieces>) -> Self {
        Self(pieces)
    }

    /// The piece of a tile with this `core`, whose `records` of `record_length` bytes may be looked for by tiles whose cores lie
    /// within `reach` (stored units) of them; and what is added up over all tiles.
    pub(crate) fn piece(
        core: &Rect,
        records: Vec<u8>,
        record_length: usize,
        reach: i64,
        sums: Vec<u8>,
    ) -> Piece {
        let positions = records.chunks_exact(record_length);
        let near = positions.filter(|record| core.depth(Stored::of_record(record)) <= reach);
        let border = near.flat_map(|record| &record[..POSITION_BYTES]).copied();
        let border = border.collect();
        vec![records, border, sums]
    }

    /// The records of `tile`.
    ///
    /// # Errors
    ///
    /// [`TileError`] if they cannot be read, or are not what was written.
    pub(crate) fn records(&self, tile: u32) -> Result<Vec<u8>, TileError> {
        self.read(tile, RECORDS)
    }

    /// The positions of the records of `tile` near the border of its core.
    ///
    /// # Errors
    ///
    /// [`TileError`] if they cannot be read, or are not what was written.
    pub(crate) fn border(&self, tile: u32) -> Result<Vec<Stored>, TileError> {
        let bytes = self.read(tile, BORDER)?;
        Ok(bytes
            .chunks_exact(POSITION_BYTES)
            .map(Stored::of_record)
            .collect())
    }

    /// What is added up over all tiles.
    ///
    /// # Errors
    ///
    /// [`TileError`] if it cannot be read, or is not what was written.
    pub(crate) fn sums(&self, tile: u32) -> Result<Vec<u8>, TileError> {
        self.read(tile, SUMS)
    }

    fn read(&self, tile: u32, section: usize) -> Result<Vec<u8>, TileError> {
        self.0
            .read(tile as usize, section)
            .map_err(TileError::of_store)
    }
}
