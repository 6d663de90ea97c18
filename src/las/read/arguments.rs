//! The files that arguments name: files, directories and patterns.

use std::path::{Path, PathBuf};

use super::{
    catalogue::{files_in, is_catalogue},
    point_filter::PointFilter,
};
use crate::{las::error::LasError, store::is_remote};

/// Lists the scans that `arguments` name: a file or an address as it is; all `.las` and `.laz` files in a
/// directory, at any depth; every match of a pattern (`city/*.laz`); of a catalogue those files in which there may be
/// points that `filter` accepts. They are sorted, and each file is listed once.
///
/// # Errors
///
/// If a file does not exist, a directory has no scans, a pattern matches nothing, or a name
/// is neither a file nor a directory, or if a catalogue cannot be read.
pub(crate) fn expand_inputs(
    arguments: &[PathBuf],
    filter: &PointFilter,
) -> Result<Vec<PathBuf>, LasError> {
    let mut files = Vec::new();
    for argument in arguments {
        let before = files.len();
        if is_catalogue(argument) && (is_remote(argument) || argument.is_file()) {
            files.extend(files_in(argument, filter)?);
        } else if is_remote(argument) && argument.to_string_lossy().contains('*') {
            return Err(LasError::new(
                argument,
                "is a pattern, and what lies in a store is not listed; give a catalogue (.vpc), or addresses with --from-list",
            ));
        } else if is_remote(argument) {
            files.push(argument.clone());
        } else if argument.is_dir() {
            collect_scans(argument, &mut files)?;
            if files.len() == before {
                return Err(LasError::new(
                    argument,
                    "the directory has no .las or .laz file in it",
                ));
            }
        } else if argument.exists() {
            if !argument.is_file() {
                return Err(LasError::new(argument, "is neither a file nor a directory"));
            }
            files.push(argument.clone());
        } else {
            match_pattern(argument, &mut files)?;
            if files.len() == before {
                return Err(LasError::new(argument, "there is no such file"));
            }
        }
    }
    // Links and `./` may name a file twice: its points would count twice.
    let mut known: Vec<(PathBuf, PathBuf)> = files
        .into_iter()
        .map(|file| (file.canonicalize().unwrap_or_else(|_| file.clone()), file))
        .collect();
    known.sort();
    known.dedup_by(|a, b| a.0 == b.0);
    Ok(known.into_iter().map(|(_, file)| file).collect())
}

/// Adds all scans in `directory`, at any depth, to `files`.
fn collect_scans(directory: &Path, files: &mut Vec<PathBuf>) -> Result<(), LasError> {
    let unreadable = |error: std::io::Error| LasError::unreadable(directory, error);
    for entry in std::fs::read_dir(directory).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let kind = entry.file_type().map_err(unreadable)?;
        let path = entry.path();
        // Links to directories are not followed: they may lead in circles.
        if kind.is_dir() {
            collect_scans(&path, files)?;
        } else if is_scan(&path) && is_file(&path)? {
            files.push(path);
        }
    }
    Ok(())
}

/// Whether the name of `path` ends as that of a scan.
fn is_scan(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("las") || e.eq_ignore_ascii_case("laz"))
}

/// Adds all files that match the pattern `argument` to `files`.
fn match_pattern(argument: &Path, files: &mut Vec<PathBuf>) -> Result<(), LasError> {
    let Some(pattern) = argument.to_str() else {
        return Ok(());
    };
    let matches = glob::glob(pattern).map_err(|error| {
        LasError::new(
            argument,
            format!("is neither a file nor a valid pattern: {error}"),
        )
    })?;
    for found in matches {
        let path = found.map_err(|error| LasError::unreadable(error.path(), error.error()))?;
        if is_file(&path)? {
            files.push(path);
        }
    }
    Ok(())
}

/// Whether there is a file at `path`. It is an error if that cannot be found out, so that no
/// file is left out silently.
fn is_file(path: &Path) -> Result<bool, LasError> {
    match std::fs::metadata(path) {
        Ok(metadata) => Ok(metadata.is_file()),
        // The path is a link to nothing.
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(LasError::unreadable(path, error)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_named_twice_is_read_once() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["b.laz", "a.LAS", "notes.txt"] {
            std::fs::write(dir.path().join(name), "x").unwrap();
        }
        std::fs::create_dir(dir.path().join("deep")).unwrap();
        std::fs::write(dir.path().join("deep/c.laz"), "x").unwrap();
        let arguments = [
            dir.path().to_path_buf(),
            dir.path().join("*.laz"),
            dir.path().join("./deep/../a.LAS"),
        ];
        let filter = PointFilter::default();
        let names: Vec<String> = expand_inputs(&arguments, &filter)
            .unwrap()
            .iter()
            .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        assert_eq!(names, ["a.LAS", "b.laz", "c.laz"]);
    }

    #[test]
    fn a_missing_file_is_named_in_the_error() {
        let dir = tempfile::tempdir().unwrap();
        let filter = PointFilter::default();
        for missing in ["no.laz", "*.laz", "["] {
            let error = expand_inputs(&[dir.path().join(missing)], &filter).unwrap_err();
            assert!(error.to_string().contains(missing), "{error}");
        }
        let error = expand_inputs(&[dir.path().to_path_buf()], &filter).unwrap_err();
        assert!(error.to_string().contains("no .las or .laz"), "{error}");
    }
}
