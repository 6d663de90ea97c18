//! Where the last stage puts what only it needs: on a disk of its own machine it is faster
//! than in a job directory on a network.

use std::{
    fs,
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use crate::job::{JobError, Progress, memory::mebibytes};

/// A directory for files that nobody else reads.
#[derive(Debug)]
pub(crate) struct Scratch {
    path: PathBuf,
    /// Whether it goes when it is not needed any more, with all that is in it.
    is_own: bool,
}

impl Scratch {
    /// A new directory in `asked` if that has room for so many `bytes`, or else `job_dir`
    /// itself: `progress` is told why.
    ///
    /// # Errors
    ///
    /// If `asked` is no directory that can be written to.
    pub(crate) fn choose(
        asked: Option<&Path>,
        job_dir: &Path,
        bytes: u64,
        progress: &dyn Progress,
    ) -> Result<Self, JobError> {
        let job_dir = Self {
            path: job_dir.to_owned(),
            is_own: false,
        };
        let Some(asked) = asked else {
            return Ok(job_dir);
        };
        let free = fs4::available_space(asked).map_err(|e| JobError::io("read", asked, e))?;
        let problem = match is_memory(asked) {
            true => "is memory, not a disk".to_owned(),
            false if free < bytes => {
                let (free, needed) = (mebibytes(free), mebibytes(bytes));
                format!("has {free} free, and {needed} are needed")
            }
            false => String::new(),
        };
        if !problem.is_empty() {
            let asked = asked.display();
            progress.note(&format!(
                "{asked} {problem}: the job directory is used instead"
            ));
            return Ok(job_dir);
        }
        let now = UNIX_EPOCH.elapsed().unwrap_or_default().as_nanos();
        let path = asked.join(format!("lloydar-{}-{now}", std::process::id()));
        fs::create_dir(&path).map_err(|e| JobError::io("make the directory", &path, e))?;
        Ok(Self { path, is_own: true })
    }

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

/// Whether files in `dir` are held in memory, where they count as the program's; not if the
/// system does not tell.
fn is_memory(dir: &Path) -> bool {
    let mounts = fs::read_to_string("/proc/mounts").unwrap_or_default();
    let dir = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    // Of the places that it lies in the innermost, and of those the last mounted.
    let around = mounts.lines().filter_map(|line| {
        let mut words = line.split(' ').skip(1);
        let (place, kind) = (Path::new(words.next()?), words.next()?);
        dir.starts_with(place)
            .then(|| (place.components().count(), kind))
    });
    let innermost = around.max_by_key(|(depth, _)| *depth);
    innermost.is_some_and(|(_, kind)| matches!(kind, "tmpfs" | "ramfs"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Quiet;

    #[test]
    fn a_scratch_is_used_if_it_has_room_and_goes_with_all_that_is_in_it() {
        let (job, disk) = (
            tempfile::tempdir().unwrap(),
            tempfile::tempdir_in(".").unwrap(),
        );
        let choose = |asked, bytes| Scratch::choose(asked, job.path(), bytes, &Quiet);
        assert_eq!(choose(None, 1).unwrap().path(), job.path());
        assert_eq!(
            choose(Some(disk.path()), u64::MAX).unwrap().path(),
            job.path()
        );
        let scratch = choose(Some(disk.path()), 1).unwrap();
        let path = scratch.path().to_owned();
        assert!(path.starts_with(disk.path()) && path != disk.path());
        fs::write(path.join("octree.bin"), "points").unwrap();
        drop(scratch);
        assert!(!path.exists() && job.path().exists());
        let gone = choose(Some(&disk.path().join("gone")), 1);
        assert!(gone.unwrap_err().to_string().contains("gone"));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn memory_is_told_from_disks() {
        assert!(is_memory(Path::new("/dev/shm")));
        assert!(!is_memory(Path::new("/proc")));
    }
}
