//! The files into which processes write the tiles of their groups.

use std::{borrow::Cow, path::Path};

use super::claims::{Claim, WorkKind};
use crate::{
    job::{JobError, stages::solve::FilesOfOthers},
    tile::{BlockFile, TileError},
};

/// The work of solving tiles: each solved tile is appended to the file of its group.
pub(super) const TILES: WorkKind = WorkKind {
    prefix: Cow::Borrowed("tiles"),
    claim_extension: "solved",
    complete_extension: "complete",
};

/// The work of the first of two rounds, which comes before: as with solving.
pub(super) const STARTS: WorkKind = WorkKind {
    prefix: Cow::Borrowed("starts"),
    claim_extension: "started",
    complete_extension: "complete",
};

/// Opens the files of all attempts at groups of tiles in the job directory `dir`.
///
/// # Errors
///
/// [`JobError::Io`] or [`TileError::Io`] if the directory or one of the files cannot be read.
pub(crate) fn files_of_others(dir: &Path) -> Result<FilesOfOthers, JobError> {
    Ok(FilesOfOthers {
        started: block_files(&STARTS, dir)?,
        solved: block_files(&TILES, dir)?,
    })
}

/// Opens the files of all attempts at the work of `kind` in the job directory `dir`.
///
/// # Errors
///
/// [`JobError::Io`] or [`TileError::Io`] if the directory or one of the files cannot be read.
pub(super) fn block_files(kind: &WorkKind, dir: &Path) -> Result<Vec<BlockFile>, JobError> {
    block_files_of(&Claim::all(kind, dir)?)
}

/// Opens the files of the `earlier` attempts at a group, and that of `claim`, to which tiles are added.
///
/// # Errors
///
/// [`TileError::Io`] if one of the files cannot be read, or made.
pub(super) fn group_files(claim: &Claim, earlier: &[Claim]) -> Result<Vec<BlockFile>, JobError> {
    let mut files = block_files_of(earlier)?;
    files.push(BlockFile::open(&claim.path())?);
    Ok(files)
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
