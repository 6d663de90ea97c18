//! Work in numbered pieces, which one process does, or several that share a job.
//!
//! What a piece makes follows from its number and from work that was complete before. So it does not matter which process
//! makes it, and a piece that was made twice is the same twice.

use std::{fmt::Debug, path::Path};

use super::store::StoreError;

/// What a piece of work has made, in sections that are read one by one.
pub(crate) type Piece = Vec<Vec<u8>>;

/// Makes the piece with a number.
pub(crate) type MakePiece<'a> = dyn FnMut(usize) -> Result<Piece, StoreError> + 'a;

/// Takes the piece with a number.
pub(crate) type TakePiece<'a> = dyn FnMut(usize, Piece) -> Result<(), StoreError> + 'a;

/// The process or the processes that do work in pieces.
pub(crate) trait Workforce: Sync {
    /// A directory for files that this process makes for the one that puts all pieces together; it may have to be made. `None` if
    /// no other process shares the work.
    fn shared_directory(&self) -> Option<&Path>;

    /// Whether several processes may share the work, so that it is to be divided even where it would fit one's memory.
    fn is_shared(&self) -> bool {
        self.shared_directory().is_some()
    }

    /// Makes the pieces 0 to `count` of the work with this `name`, and keeps them in files.
    ///
    /// # Errors
    ///
    /// The errors of `make`, or if files cannot be written or read.
    fn keep(
        &self,
        name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
    ) -> Result<Box<dyn KeptPieces>, StoreError>;

    /// Makes the pieces 0 to `count` of the work with this `name`, and passes them to `take` in the order of their numbers. A
    /// process that only helps passes none.
    ///
    /// # Errors
    ///
    /// The errors of `make` and `take`, or if files cannot be written or read.
    fn pass(
        &self,
        name: &str,
        count: usize,
        make: &mut MakePiece<'_>,
        take: &mut TakePiece<'_>,
    ) -> Result<(), StoreError>;
}

/// Pieces in files.
pub(crate) trait KeptPieces: Debug + Send + Sync {
    /// Reads a `section` of the piece with this number.
    ///
    /// # Errors
    ///
    /// If there is no such section, or it cannot be read.
    fn read(&self, piece: usize, section: usize) -> Result<Vec<u8>, StoreError>;

    /// Removes the files, unless other processes read them; files that cannot be removed stay.
    fn remove(self: Box<Self>);
}
