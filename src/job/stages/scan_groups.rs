//! The spills of a job: one by a single process, or one for each group of scans.

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use crate::{
    job::{
        cluster::{Claim, WorkKind},
        directory::write_among_others,
        error::JobError,
    },
    tile::{Spill, read_checksummed},
};

/// The work of scattering: the points of each group of parts are brought to a spill of the group.
pub(crate) const POINTS: WorkKind = WorkKind {
    prefix: Cow::Borrowed("spill"),
    claim_extension: "bin",
    complete_extension: "index",
};

/// Stem of the names of the spill that a single process makes.
const SINGLE_SPILL: &str = "spill";

/// The number of groups in which several processes scatter the points of a job.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct ScanGroups {
    /// Number of groups.
    pub(crate) count: usize,
}

impl ScanGroups {
    const FILE: &str = "groups.json";

    /// Reads the number of groups in the job directory `dir`; `None` if no processes scatter the
    /// job together.
    pub(crate) fn read(dir: &Path) -> Option<Self> {
        let content = read_checksummed(&dir.join(Self::FILE)).ok()??;
        serde_json::from_slice(&content).ok()
    }

    /// Writes the number of groups to the job directory `dir`.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if the file cannot be written.
    pub(super) fn write(&self, dir: &Path) -> Result<(), JobError> {
        let text = serde_json::to_vec(self).expect("a number is valid JSON");
        write_among_others(&dir.join(Self::FILE), &text)
    }
}

/// The stem of the spill that a single process makes in the job directory `dir`.
pub(super) fn single_spill(dir: &Path) -> PathBuf {
    dir.join(SINGLE_SPILL)
}

/// Opens the complete spill in the job directory `dir`, of one process or of several.
///
/// # Errors
///
/// See [`Spill::join`].
pub(crate) fn open_spill(dir: &Path) -> Result<Spill, JobError> {
    let claims = Claim::all_complete(&POINTS, dir)?;
    let stems: Vec<PathBuf> = match claims.is_empty() {
        true => vec![single_spill(dir)],
        false => claims.into_iter().map(|claim| claim.stem).collect(),
    };
    Ok(Spill::join(&stems)?)
}
