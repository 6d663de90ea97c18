//! Room on the disks, looked at before it is needed.

use std::path::{Path, PathBuf};

use crate::job::{JobError, memory::mebibytes};

/// What is about to be written.
pub(crate) struct Need<'a> {
    /// What it is called.
    pub(crate) what: String,
    /// A directory on the file system that it goes to.
    pub(crate) dir: &'a Path,
    pub(crate) bytes: u64,
}

/// Refuses what has no room.
///
/// # Errors
///
/// [`JobError::Refused`] with the file system, what it needs, and what it has.
pub(crate) fn check_room(needs: &[Need<'_>]) -> Result<(), JobError> {
    let mut left: Vec<&Need<'_>> = needs.iter().collect();
    while let Some(first) = left.first() {
        let disk = disk_of(first.dir);
        let (here, elsewhere) = left.iter().partition(|need| disk_of(need.dir) == disk);
        let here: Vec<&Need<'_>> = here;
        // Some file systems do not tell; then it is seen when it happens.
        let free = fs4::available_space(first.dir).unwrap_or(u64::MAX);
        let needed = here
            .iter()
            .fold(0, |sum: u64, need| sum.saturating_add(need.bytes));
        if needed > free {
            let parts: Vec<String> = here
                .iter()
                .map(|need| {
                    let (bytes, dir) = (mebibytes(need.bytes), need.dir.display());
                    format!("{} in {dir}: {bytes}", need.what)
                })
                .collect();
            return Err(JobError::Refused(format!(
                "the disk has {} free, and the job needs about {} ({}); free some space, or put \
                 temporary files on another disk with --job",
                mebibytes(free),
                mebibytes(needed),
                parts.join(", ")
            )));
        }
        left = elsewhere;
    }
    Ok(())
}

/// Writes the file at `path`, complete under its name or not there.
///
/// # Errors
///
/// [`JobError::Io`] if it cannot be written.
pub(crate) fn write_file(path: &Path, content: &[u8]) -> Result<(), JobError> {
    let mut part = path.to_owned().into_os_string();
    part.push(".part");
    std::fs::write(&part, content)
        .and_then(|()| std::fs::rename(&part, path))
        .map_err(|e| JobError::io("write", path, e))
}

/// The directory that a file at `path` lies in.
pub(crate) fn directory_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// What tells a file system from another.
#[cfg(unix)]
fn disk_of(dir: &Path) -> Option<u64> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(dir).ok().map(|metadata| metadata.dev())
}

/// Where that is not known, all is taken for one.
#[cfg(not(unix))]
fn disk_of(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_refused_with_the_sum() {
        let dir = tempfile::tempdir().unwrap();
        let need = |bytes| Need {
            what: "a file".to_owned(),
            dir: dir.path(),
            bytes,
        };
        check_room(&[need(1), need(2)]).unwrap();
        let free = fs4::available_space(dir.path()).unwrap();
        // Each would fit alone.
        let error = check_room(&[need(free / 5 * 3), need(free / 5 * 3)]).unwrap_err();
        let error = error.to_string();
        assert!(
            error.contains("--job") && error.contains("a file"),
            "{error}"
        );
        check_room(&[need(u64::MAX), need(u64::MAX)]).unwrap_err();
    }
}
