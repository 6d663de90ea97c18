//! Work in pieces by one process, which keeps them in one file.

use std::path::{Path, PathBuf};

use super::{
    block_file::BlockFile,
    kept_blocks::{KeptBlocks, add_piece},
};
use crate::las::{KeptPieces, MakePiece, StoreError, TakePiece, Workforce};

/// One process, which shares its work with no other.
#[derive(Clone, Debug)]
pub(crate) struct OneProcess {
    /// The directory of the files of pieces.
    pub(crate) directory: PathBuf,
}

impl Workforce for OneProcess {
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
            add_piece(&mut file, piece, &make(piece)?)?;
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
        (0..count).try_for_each(|piece| take(piece, make(piece)?))
    }
}
