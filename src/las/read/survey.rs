//! The survey of an input, whatever kind of file it is.

use std::path::Path;

use super::input::InputFile;
use crate::las::error::LasError;

impl InputFile {
    /// Reads the headers of the file at `path`.
    ///
    /// # Errors
    ///
    /// If there is no such file, it cannot be read, it is neither a LAS or LAZ file of
    /// version 1.0 to 1.4 nor, by its name, PLY or E57, or its headers cannot be true.
    pub(crate) fn survey(path: &Path) -> Result<Self, LasError> {
        let metadata = std::fs::metadata(path).map_err(|e| LasError::unreadable(path, e))?;
        if !metadata.is_file() {
            return Err(LasError::new(path, "is not a regular file"));
        }
        let bytes = metadata.len();
        match path.extension().map(|e| e.to_ascii_lowercase()) {
            Some(e) if e == "ply" => Self::survey_ply(path, bytes),
            #[cfg(feature = "e57")]
            Some(e) if e == "e57" => Self::survey_e57(path, bytes),
            #[cfg(not(feature = "e57"))]
            Some(e) if e == "e57" => Err(LasError::new(
                path,
                "is E57, which this program was built without; build it with --features e57, or \
                 convert the file to LAZ",
            )),
            Some(e) if e == "pcd" => Err(LasError::new(
                path,
                "is PCD, which is written but not read; convert it to LAZ or PLY",
            )),
            _ => Self::survey_las(path, bytes),
        }
    }
}
