//! Pieces of work in files of blocks: a block for each section.

use std::fs;

use super::{block_file::BlockFile, error::TileError};
use crate::las::{KeptPieces, Piece, StoreError};

/// The most sections of a piece.
const MOST_SECTIONS: usize = 4;

/// Pieces in files of blocks.
#[derive(Debug)]
pub(crate) struct KeptBlocks {
    files: Vec<BlockFile>,
    /// The number of consecutive pieces in each file but the last, which may have fewer.
    pieces_per_file: usize,
    /// Whether no other process reads the files.
    is_alone: bool,
}

impl KeptBlocks {
    /// All pieces in one `file`, which no other process reads.
    pub(super) fn of_one_process(file: BlockFile) -> Self {
        Self {
            files: vec![file],
            pieces_per_file: usize::MAX,
            is_alone: true,
        }
    }

    /// Pieces that several processes have made: so many consecutive ones in each of `files`.
    pub(crate) fn of_many_processes(files: Vec<BlockFile>, pieces_per_file: usize) -> Self {
        Self {
            files,
            pieces_per_file,
            is_alone: false,
        }
    }

    /// Reads all sections of a piece.
    ///
    /// # Errors
    ///
    /// [`TileError`] if there is no such piece, or it cannot be read.
    pub(crate) fn piece(&self, piece: usize) -> Result<Piece, TileError> {
        let file = self.file(piece)?;
        let keys = (0..MOST_SECTIONS).map(|section| key_of(piece, section));
        let present = keys.take_while(|&key| file.contains(key));
        present.map(|key| file.read(key)).collect()
    }

    fn file(&self, piece: usize) -> Result<&BlockFile, TileError> {
        let file = self.files.get(piece / self.pieces_per_file);
        file.ok_or_else(|| TileError::damaged("a piece of work".as_ref()))
    }
}

impl KeptPieces for KeptBlocks {
    fn read(&self, piece: usize, section: usize) -> Result<Vec<u8>, StoreError> {
        Ok(self.file(piece)?.read(key_of(piece, section))?)
    }

    fn remove(self: Box<Self>) {
        if self.is_alone {
            for file in &self.files {
                drop(fs::remove_file(file.path()));
            }
        }
    }
}

/// Adds the sections of a `piece` with this `number` to `file`.
///
/// # Errors
///
/// [`TileError::Io`] if they cannot be written.
pub(crate) fn add_piece(
    file: &mut BlockFile,
    number: usize,
    piece: &Piece,
) -> Result<(), TileError> {
    let sections = piece.iter().enumerate();
    let blocks: Vec<(u64, &[u8])> = sections
        .map(|(section, bytes)| (key_of(number, section), bytes.as_slice()))
        .collect();
    file.append(&blocks)
}

/// The key of the block with a `section` of a `piece`.
fn key_of(piece: usize, section: usize) -> u64 {
    (piece * MOST_SECTIONS + section) as u64
}
