//! The files into which processes write the tiles of their groups.

use std::path::Path;

use super::claims::{Claim, WorkKind};
use crate::{
    job::JobError,
    tile::{BlockFile, TileError},
};

/// The work of solving tiles: each solved tile is appended to the file of its group.
pub(super) const TILES: WorkKind = WorkKind {
    prefix: "tiles",
    claim_extension: "solved",
    complete_extension: "complete",
};

/// Opens the files of all attempts at groups of tiles in the job directory `dir`.
///
/// # Errors
///
/// [`JobError::Io`] or [`TileError::Io`] if the directory or one of the files cannot be read.
pub(crate) fn block_files(dir: &Path) -> Result<Vec<BlockFile>, JobError> {
    block_files_of(&Claim::all(&TILES, dir)?)
}

/// Opens the files of `claims`, with the tiles that are complete by now.
///
/// # Errors
///
/// [`TileError::Io`] if one of the files cannot be read.
pub(super) fn block_files_of(claims: &[Claim]) -> Result<Vec<BlockFile>, JobError> {
    let files = claims
        .iter()
        .map(|claim| BlockFile::open_for_reading(&claim.path()));
    Ok(files.collect::<Result<_, TileError>>()?)
}
