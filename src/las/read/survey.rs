//! The survey of an input, whatever kind of file it is.

use std::{
    path::{Path, PathBuf},
    thread,
};

use rayon::prelude::*;

use super::input::InputFile;
use crate::{
    las::error::LasError,
    store::{Source, is_remote},
};

/// The remote files that are surveyed at once: what they take is the time between request and answer.
const SURVEYED_AT_ONCE: usize = 16;

/// The most remote files whose headers stay in memory, for the decoders that ask for them again.
const MOST_WITH_HEADERS: usize = 128;

impl InputFile {
    /// Reads the headers of the files at `paths`, several at once; the results are in the order of the paths.
    pub(crate) fn survey_all(paths: &[PathBuf]) -> Vec<Result<Self, LasError>> {
        if !paths.iter().any(|path| is_remote(path)) {
            return paths.par_iter().map(|path| Self::survey(path)).collect();
        }
        let length = paths.len().div_ceil(SURVEYED_AT_ONCE);
        let forgets = paths.len() > MOST_WITH_HEADERS;
        thread::scope(|scope| {
            let survey = |paths: &[PathBuf]| {
                let survey = |path: &PathBuf| {
                    let surveyed = Self::survey(path);
                    if forgets && let Ok(input) = &surveyed {
                        input.source.forget_pieces();
                    }
                    surveyed
                };
                paths.iter().map(survey).collect::<Vec<_>>()
            };
            let threads: Vec<_> = paths
                .chunks(length)
                .map(|paths| scope.spawn(move || survey(paths)))
                .collect();
            let join = |thread: thread::ScopedJoinHandle<'_, _>| {
                thread
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            threads.into_iter().flat_map(join).collect()
        })
    }

    /// Reads the headers of the file at `path`.
    ///
    /// # Errors
    ///
    /// If there is no such file, it cannot be read, it is neither a LAS or LAZ file of
    /// version 1.0 to 1.4 nor, by its name, PLY or E57, or its headers cannot be true.
    pub(crate) fn survey(path: &Path) -> Result<Self, LasError> {
        let source = Source::find(path).map_err(|e| match e.kind() {
            // The reason of a store, or of a directory, is a sentence about it.
            _ if is_remote(path) => LasError::new(path, e.to_string()),
            std::io::ErrorKind::Other => LasError::new(path, e.to_string()),
            _ => LasError::unreadable(path, e),
        })?;
        let wrong = |problem: &str| Err(LasError::new(path, problem));
        let ending = source.path().extension().map(|e| e.to_ascii_lowercase());
        let ending = ending.as_deref().and_then(|ending| ending.to_str());
        match ending {
            Some("ply" | "e57" | "pcd") if source.is_remote() => {
                wrong("is remote, and only LAS, LAZ and COPC are read from there; copy it here")
            }
            Some("ply") => Self::survey_ply(source),
            #[cfg(feature = "e57")]
            Some("e57") => Self::survey_e57(source),
            #[cfg(not(feature = "e57"))]
            Some("e57") => wrong(
                "is E57, which this program was built without; build it with --features e57, or convert the file to LAZ",
            ),
            Some("pcd") => wrong("is PCD, which is written but not read; convert it to LAZ or PLY"),
            _ => Self::survey_las(source),
        }
    }
}
