//! Work in pieces by one process, which keeps them in one file.

use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

use super::{
    block_file::BlockFile,
    error::TileError,
    kept_blocks::{KeptBlocks, add_piece},
};
use crate::las::{KeptPieces, MakePiece, Piece, StoreError, TakePiece, Workforce};

/// One process, which shares its work with no other.
#[derive(Clone, Debug)]
pub(crate) struct OneProcess<'a> {
    /// The directory of the files of pieces.
    pub(crate) directory: PathBuf,
    /// The user sets this to stop the process.
    pub(crate) cancel: &'a AtomicBool,
}

impl OneProcess<'_> {
    /// Makes a piece, unless the user has stopped the process.
    fn make(&self, piece: usize, make: &mut MakePiece<'_>) -> Result<Piece, StoreError> {
        match self.cancel.load(Ordering::Relaxed) {
            true => Err(TileError::Cancelled.into()),
            false => make(piece),
        }
    }
}

impl Workforce for OneProcess<'_> {
    fn shared_directory(&self) -> Option<&Path> {
        None
    }

    fn keep(
        &self,
        name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
    ) -> Result<Box<dyn KeptPieces>, StoreError> {
        let path = self.directory.join(name).with_extension("pieces");
        let mut file = BlockFile::create(&path)?;
        for piece in 0..count {
            add_piece(&mut file, piece, &self.make(piece, make)?)?;
        }
        Ok(Box::new(KeptBlocks::of_one_process(file)))
    }

    fn pass(
        &self,
        _name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
        take: &mut TakePiece<'_>,
    ) -> Result<(), StoreError> {
        (0..count).try_for_each(|piece| take(piece, self.make(piece, make)?))
    }
}
