//! Which files are meant: files, directories and patterns.

use std::path::{Path, PathBuf};

use super::LasError;

/// The scans that `arguments` name: files as they are; of directories every
/// `.las` and `.laz` file in them, at any depth; of patterns (`city/*.laz`)
/// every match. Sorted, each file once.
///
/// # Errors
///
/// A file that is not there, a directory without scans, a pattern without a
/// match, a name that is neither file nor directory.
pub(crate) fn expand_inputs(arguments: &[PathBuf]) -> Result<Vec<PathBuf>, LasError> {
    let mut files = Vec::new();
    for argument in arguments {
        let before = files.len();
        if argument.is_dir() {
            collect(argument, &mut files)?;
            if files.len() == before {
                return Err(LasError::new(
                    argument,
                    "the directory holds no .las or .laz file",
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

fn collect(directory: &Path, files: &mut Vec<PathBuf>) -> Result<(), LasError> {
    let unreadable =
        |error: std::io::Error| LasError::new(directory, format!("cannot be read: {error}"));
    for entry in std::fs::read_dir(directory).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let kind = entry.file_type().map_err(unreadable)?;
        let path = entry.path();
        // Links to directories are not followed: they may lead in circles.
        if kind.is_dir() {
            collect(&path, files)?;
        } else if is_scan(&path) && is_file(&path)? {
            files.push(path);
        }
    }
    Ok(())
}

fn is_scan(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("las") || e.eq_ignore_ascii_case("laz"))
}

fn match_pattern(argument: &Path, files: &mut Vec<PathBuf>) -> Result<(), LasError> {
    let Some(pattern) = argument.to_str() else {
        return Ok(());
    };
    let matches = glob::glob(pattern)
        .map_err(|error| LasError::new(argument, format!("is no pattern: {error}")))?;
    for found in matches {
        let path = found.map_err(|error| {
            let problem = format!("cannot be read: {}", error.error());
            LasError::new(error.path(), problem)
        })?;
        if is_file(&path)? {
            files.push(path);
        }
    }
    Ok(())
}

/// Whether there is a file at `path`. One that cannot be looked at is not left out
/// without a word.
fn is_file(path: &Path) -> Result<bool, LasError> {
    match std::fs::metadata(path) {
        Ok(metadata) => Ok(metadata.is_file()),
        // A link to nowhere.
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(LasError::new(path, format!("cannot be read: {error}"))),
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
        let names: Vec<String> = expand_inputs(&arguments)
            .unwrap()
            .iter()
            .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
            .collect();
        assert_eq!(names, ["a.LAS", "b.laz", "c.laz"]);
    }

    #[test]
    fn what_is_not_there_is_named() {
        let dir = tempfile::tempdir().unwrap();
        for missing in ["no.laz", "*.laz", "["] {
            let error = expand_inputs(&[dir.path().join(missing)]).unwrap_err();
            assert!(error.to_string().contains(missing), "{error}");
        }
        let error = expand_inputs(&[dir.path().to_path_buf()]).unwrap_err();
        assert!(error.to_string().contains("no .las or .laz"), "{error}");
    }
}
