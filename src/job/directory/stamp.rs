//! Length and time of a file, by which a change of the file is noticed.

use std::{
    fs::{self, Metadata},
    io,
    path::Path,
    time::UNIX_EPOCH,
};

use serde::{Deserialize, Serialize};

/// Length and modification time of a file. Renaming the file does not change them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stamp {
    bytes: u64,
    /// Nanoseconds since 1970; 0 where the file system records no time.
    modified: u128,
}

impl Stamp {
    /// Reads the stamp of the file at `path`.
    ///
    /// # Errors
    ///
    /// If there is no such file, or it is not accessible.
    pub(crate) fn of(path: &Path) -> io::Result<Self> {
        fs::metadata(path).map(|metadata| Self::of_metadata(&metadata))
    }

    fn of_metadata(metadata: &Metadata) -> Self {
        let modified = metadata.modified().ok();
        let since = modified.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
        Self {
            bytes: metadata.len(),
            modified: since.map_or(0, |since| since.as_nanos()),
        }
    }
}
