//! Temporary files that only the last stage reads.
//!
//! A disk of the machine itself is faster than a job directory on a network, so the user may name a
//! scratch directory for these files.

use std::{
    fs,
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use crate::job::{error::JobError, progress::Progress, resources::mebibytes};

/// A directory for files that no other process reads.
#[derive(Debug)]
pub(crate) struct Scratch {
    path: PathBuf,
    /// Whether the directory is removed with its content when this value is dropped.
    is_own: bool,
}

impl Scratch {
    /// Creates a directory in `requested` if that has room for `bytes`; otherwise takes `job_dir`
    /// itself, and notes the reason in `progress`.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if `requested` is not a directory that can be written to.
    pub(crate) fn choose(
        requested: Option<&Path>,
        job_dir: &Path,
        bytes: u64,
        progress: &dyn Progress,
    ) -> Result<Self, JobError> {
        let job_dir = Self {
            path: job_dir.to_owned(),
            is_own: false,
        };
        let Some(requested) = requested else {
            return Ok(job_dir);
        };
        let free =
            fs4::available_space(requested).map_err(|e| JobError::io("read", requested, e))?;
        let problem = match is_memory(requested) {
            true => "is memory, not a disk".to_owned(),
            false if free < bytes => {
                let (free, needed) = (mebibytes(free), mebibytes(bytes));
                format!("has {free} free, and {needed} are needed")
            }
            false => String::new(),
        };
        if !problem.is_empty() {
            let requested = requested.display();
            progress.note(&format!(
                "{requested} {problem}: the job directory is used instead"
            ));
            return Ok(job_dir);
        }
        let now = UNIX_EPOCH.elapsed().unwrap_or_default().as_nanos();
        let path = requested.join(format!("lloydar-{}-{now}", std::process::id()));
        fs::create_dir(&path).map_err(|e| JobError::io("make the directory", &path, e))?;
        Ok(Self { path, is_own: true })
    }

    /// The path of the directory.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if self.is_own {
            drop(fs::remove_dir_all(&self.path));
        }
    }
}

/// Whether files in `dir` reside in memory, where they count against the program's limit; `false`
/// where the system does not list its mounts.
fn is_memory(dir: &Path) -> bool {
    let mounts = fs::read_to_string("/proc/mounts").unwrap_or_default();
    let dir = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    // The innermost mount point above `dir` decides, and the last mount if there are several.
    let around = mounts.lines().filter_map(|line| {
        let mut words = line.split(' ').skip(1);
        let (mount_point, kind) = (Path::new(words.next()?), words.next()?);
        dir.starts_with(mount_point)
            .then(|| (mount_point.components().count(), kind))
    });
    let innermost = around.max_by_key(|(depth, _)| *depth);
    innermost.is_some_and(|(_, kind)| matches!(kind, "tmpfs" | "ramfs"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::progress::Quiet;

    #[test]
    fn a_scratch_directory_is_used_if_it_has_room_and_is_removed_with_its_content() {
        let (job, disk) = (
            tempfile::tempdir().unwrap(),
            tempfile::tempdir_in(".").unwrap(),
        );
        let choose = |requested, bytes| Scratch::choose(requested, job.path(), bytes, &Quiet);
        assert_eq!(choose(None, 1).unwrap().path(), job.path());
        assert_eq!(
            choose(Some(disk.path()), u64::MAX).unwrap().path(),
            job.path()
        );
        let scratch = choose(Some(disk.path()), 1).unwrap();
        let path = scratch.path().to_owned();
        assert!(path.starts_with(disk.path()) && path != disk.path());
        fs::write(path.join("sorted.bin"), "points").unwrap();
        drop(scratch);
        assert!(!path.exists() && job.path().exists());
        let gone = choose(Some(&disk.path().join("gone")), 1);
        assert!(gone.unwrap_err().to_string().contains("gone"));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn memory_is_distinguished_from_disks() {
        assert!(is_memory(Path::new("/dev/shm")));
        assert!(!is_memory(Path::new("/proc")));
    }
}
