//! Room on the disks, checked before it is needed.

use std::path::{Path, PathBuf};

use crate::job::{error::JobError, resources::mebibytes};

/// Files that are about to be written.
pub(crate) struct DiskNeed<'a> {
    /// The files, in words for a message.
    pub(crate) what: String,
    /// A directory on the file system where the files will be.
    pub(crate) dir: &'a Path,
    /// Their length in bytes.
    pub(crate) bytes: u64,
}

/// Checks that every file system has room for the sum of the `needs` on it.
///
/// # Errors
///
/// [`JobError::Resources`] with the bytes that a file system has free and the bytes that are needed.
pub(crate) fn check_room(needs: &[DiskNeed<'_>]) -> Result<(), JobError> {
    let mut unchecked: Vec<&DiskNeed<'_>> = needs.iter().collect();
    while let Some(first) = unchecked.first() {
        let disk = disk_of(first.dir);
        let (here, elsewhere): (Vec<&DiskNeed<'_>>, _) = unchecked
            .iter()
            .copied()
            .partition(|need| disk_of(need.dir) == disk);
        // Where a file system does not report its free space, lack of it shows when files are written.
        let free = fs4::available_space(first.dir).unwrap_or(u64::MAX);
        let needed = here
            .iter()
            .fold(0, |sum: u64, need| sum.saturating_add(need.bytes));
        if needed > free {
            return Err(no_room(&here, needed, free));
        }
        unchecked = elsewhere;
    }
    Ok(())
}

fn no_room(needs: &[&DiskNeed<'_>], needed: u64, free: u64) -> JobError {
    let parts: Vec<String> = needs
        .iter()
        .map(|need| {
            let (bytes, dir) = (mebibytes(need.bytes), need.dir.display());
            format!("{} in {dir}: {bytes}", need.what)
        })
        .collect();
    JobError::Resources(format!(
        "the disk has {} free, and the job needs about {} ({}); free some space, or put temporary \
         files on another disk with --job",
        mebibytes(free),
        mebibytes(needed),
        parts.join(", ")
    ))
}

/// The directory that contains the file at `path`.
pub(crate) fn directory_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// The number by which the system distinguishes the file system of `dir` from others.
#[cfg(unix)]
fn disk_of(dir: &Path) -> Option<u64> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(dir).ok().map(|metadata| metadata.dev())
}

/// Without numbers of file systems all directories are taken to be on one.
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
        let need = |bytes| DiskNeed {
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
