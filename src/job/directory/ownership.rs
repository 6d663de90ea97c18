//! Which job and which process a job directory belongs to.
//!
//! A directory belongs to one job, which `job.json` describes, and to one process at a time,
//! which locks the file `lock`. Nothing but a job's own files is ever removed from it.

use std::{
    fs::{self, File, TryLockError},
    io,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use super::{
    file_names::{
        DIRECTORIES, LEVELS_DIRECTORY, UPLOAD_DIRECTORY, is_of_stitch, is_of_tiles, is_own,
    },
    json_files::{read_json, to_json, write_among_others, write_json},
    stamp::Stamp,
};
use crate::{job::error::JobError, tile::BEGIN_ANEW};

/// A job directory that this process has locked.
#[derive(Debug)]
pub(crate) struct JobDirectory {
    path: PathBuf,
    /// The locked file; closing it releases the lock.
    lock: File,
    owner: Owner,
    /// Whether this process began the job.
    is_new: bool,
}

/// The content of `job.json`: the job that a directory belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Owner {
    /// Inputs and settings that decide the result of the job.
    identity: serde_json::Value,
    /// The stamp of the output, once the output is complete.
    delivered: Option<Stamp>,
}

impl JobDirectory {
    /// Creates the directory at `path`, or finds the job with this `identity` in it, and locks
    /// it. With `restart` the files of whatever job is found are removed.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if the directory cannot be created, read or locked, [`JobError::Refused`] if
    /// another process keeps it locked, or if it contains another job or files that no job made.
    pub(crate) fn open(
        path: &Path,
        identity: serde_json::Value,
        restart: bool,
    ) -> Result<Self, JobError> {
        let (lock, names) = lock(path)?;
        let mut directory = Self {
            path: path.to_owned(),
            lock,
            owner: Owner {
                identity,
                delivered: None,
            },
            is_new: false,
        };
        if restart {
            directory.forget(|name| name != "lock");
        }
        match directory.read::<Owner>(OWNER_FILE) {
            Some(found) if found.identity == directory.owner.identity => directory.owner = found,
            Some(found) => return Err(other_job(path, &found.identity, &directory.owner.identity)),
            None => {
                // Without `job.json` it is unknown which job the other files belong to.
                directory.forget(|name| name != "lock" && names.iter().any(|known| known == name));
                directory.write(OWNER_FILE, &directory.owner)?;
                directory.is_new = true;
            }
        }
        Ok(directory)
    }

    /// Finds the job with this `identity` in the directory at `path`, or creates it, as one of
    /// several processes: the directory is not locked. Returns whether the `output` of the job is
    /// still to be made.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if the directory cannot be created or read, [`JobError::Refused`] if it
    /// contains another job or files that no job made.
    pub(crate) fn join(
        path: &Path,
        identity: serde_json::Value,
        output: &Path,
    ) -> Result<bool, JobError> {
        let names = own_names(path)?;
        let owner_path = path.join(OWNER_FILE);
        if read_json::<Owner>(&owner_path).is_none() {
            // A process that joins writes `job.json` first: without it the directory is empty, or
            // it is unknown which job its files belong to.
            let is_work = |name: &&String| !name.starts_with("job") && *name != "lock";
            if let Some(name) = names.iter().find(is_work)
                && !owner_path.exists()
            {
                let problem = format!("{name} belongs to an unknown job; {BEGIN_ANEW}");
                return Err(refused(path, &problem));
            }
            let owner = Owner {
                identity: identity.clone(),
                delivered: None,
            };
            write_among_others(&owner_path, to_json(&owner).as_bytes())?;
        }
        match read_json::<Owner>(&owner_path) {
            Some(found) if found.identity == identity => {
                let delivered = found.delivered;
                Ok(delivered.is_none() || Stamp::of(output).ok() != delivered)
            }
            Some(found) => Err(other_job(path, &found.identity, &identity)),
            None => Err(refused(path, &format!("{OTHER}; {BEGIN_ANEW}"))),
        }
    }

    /// The path of the directory.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Reads the JSON file `name`; `None` if it is missing or damaged.
    pub(crate) fn read<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        read_json(&self.path.join(name))
    }

    /// Writes `value` to the JSON file `name`, completely or not at all.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if the file cannot be written.
    pub(crate) fn write(&self, name: &str, value: &impl Serialize) -> Result<(), JobError> {
        write_json(&self.path.join(name), value)
    }

    /// Records in `job.json` that the file with this `stamp` is the job's output.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if `job.json` cannot be written.
    pub(crate) fn deliver(&mut self, stamp: Stamp) -> Result<(), JobError> {
        self.owner.delivered = Some(stamp);
        self.write(OWNER_FILE, &self.owner)
    }

    /// Whether an earlier run of this job completed the file at `output`, and the file has not
    /// changed since.
    pub(crate) fn has_delivered(&self, output: &Path) -> bool {
        let delivered = self.owner.delivered;
        delivered.is_some() && Stamp::of(output).ok() == delivered
    }

    /// Removes the results of all tiles, and the file from which other processes would solve them.
    pub(crate) fn forget_tiles(&self) {
        self.forget(|name| is_of_tiles(name) || is_of_stitch(name) || name == "handover.json");
    }

    /// Removes the job's files whose names are `wanted`; a file that cannot be removed stays.
    pub(crate) fn forget(&self, wanted: impl Fn(&str) -> bool) {
        let entries = fs::read_dir(&self.path).into_iter().flatten().flatten();
        for entry in entries {
            let name = entry.file_name();
            if name
                .to_str()
                .is_some_and(|name| is_own(name) && wanted(name))
            {
                drop(
                    match DIRECTORIES.iter().any(|&directory| name == directory) {
                        true => fs::remove_dir_all(entry.path()),
                        false => fs::remove_file(entry.path()),
                    },
                );
            }
        }
    }

    /// Makes an empty directory for the coarser levels of a mesh.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if it cannot be made.
    pub(crate) fn for_levels(&self) -> Result<PathBuf, JobError> {
        self.forget(|name| name == LEVELS_DIRECTORY);
        let path = self.path.join(LEVELS_DIRECTORY);
        fs::create_dir(&path).map_err(|e| JobError::io("make the directory", &path, e))?;
        Ok(path)
    }

    /// Makes the directory for an output that will be uploaded, unless there is one.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if it cannot be made.
    pub(crate) fn for_upload(&self) -> Result<(), JobError> {
        let path = self.path.join(UPLOAD_DIRECTORY);
        fs::create_dir_all(&path).map_err(|e| JobError::io("make the directory", &path, e))
    }

    /// Gives the job up and removes its files if this process began it. The files of an earlier
    /// run may be the work of a night, and stay.
    pub(crate) fn abandon(self) {
        if self.is_new {
            self.clear();
        }
    }

    /// Removes the job's files and the directory. `job.json` is removed last, so that after a kill
    /// on the way the next process still recognizes the job.
    pub(crate) fn clear(self) {
        self.forget(|name| name != OWNER_FILE && name != "lock");
        self.forget(|name| name != "lock");
        self.forget(|_| true);
        let Self { path, lock, .. } = self;
        // A network file system keeps a removed file under a hidden name until it is closed.
        drop(lock);
        drop(fs::remove_dir(path));
    }
}

/// Name of the file that says which job a directory belongs to.
const OWNER_FILE: &str = "job.json";

/// How long a lock is waited for. That of a killed process which held 10 GiB was free after 0.3 s.
const LONGEST_WAIT: Duration = Duration::from_secs(5);
/// Time between two tries to lock.
const BETWEEN_TRIES: Duration = Duration::from_millis(20);

/// The problem of a directory of another job.
const OTHER: &str =
    "contains a job with other inputs or settings, or inputs that have changed since";

/// The error of a directory of the job `found`, which is not the one that is `wanted`. An input that both have, but not
/// alike, has changed, and is named.
fn other_job(path: &Path, found: &serde_json::Value, wanted: &serde_json::Value) -> JobError {
    let inputs =
        |identity: &serde_json::Value| identity["inputs"].as_array().cloned().unwrap_or_default();
    let before = inputs(found);
    let changed = inputs(wanted).into_iter().find(|input| {
        let is_known = |known: &&serde_json::Value| known[0] == input[0];
        before
            .iter()
            .find(is_known)
            .is_some_and(|known| known != input)
    });
    let problem = match changed.as_ref().and_then(|input| input[0].as_str()) {
        Some(input) => format!("{input} has changed since the job began"),
        None => OTHER.to_owned(),
    };
    refused(path, &format!("{problem}; {BEGIN_ANEW}"))
}

/// Locks the directory at `path`, which is created if it does not exist, and lists the names of the job's files in it. A process
/// that was killed keeps its locks until the system has taken its memory back: who starts the job again at once waits for that.
fn lock(path: &Path) -> Result<(File, Vec<String>), JobError> {
    let begun = Instant::now();
    loop {
        let error = match try_lock(path) {
            Ok(Some(locked)) => return Ok(locked),
            Ok(None) => refused(
                path,
                "another process is at work on this job; wait for it, or choose another --job",
            ),
            // A process that completes its job removes the directory, perhaps at this moment.
            Err(error) if is_missing(&error) => error,
            Err(error) => return Err(error),
        };
        if begun.elapsed() >= LONGEST_WAIT {
            return Err(error);
        }
        thread::sleep(BETWEEN_TRIES);
    }
}

/// Whether `error` is that a file or directory is not there.
fn is_missing(error: &JobError) -> bool {
    matches!(error, JobError::Io { source, .. } if source.kind() == io::ErrorKind::NotFound)
}

/// Locks the directory like [`lock`] unless another process has locked it.
fn try_lock(path: &Path) -> Result<Option<(File, Vec<String>)>, JobError> {
    let names = own_names(path)?;
    let lock_path = path.join("lock");
    let lock = File::create(&lock_path).map_err(|e| JobError::io("create", &lock_path, e))?;
    match lock.try_lock() {
        // Who had locked the file may have removed it since it was opened.
        Ok(()) => Ok(lock_path.exists().then_some((lock, names))),
        Err(TryLockError::WouldBlock) => Ok(None),
        Err(TryLockError::Error(error)) => Err(JobError::io("lock", &lock_path, error)),
    }
}

fn refused(path: &Path, problem: &str) -> JobError {
    JobError::Refused(format!("{}: {problem}", path.display()))
}

/// Creates the directory at `path` if it does not exist, and lists the names of the job's files
/// in it.
fn own_names(path: &Path) -> Result<Vec<String>, JobError> {
    fs::create_dir_all(path).map_err(|e| JobError::io("make the job directory", path, e))?;
    let entries = fs::read_dir(path).map_err(|e| JobError::io("read", path, e))?;
    let names = entries.flatten().map(|entry| entry.file_name());
    let own = |name: std::ffi::OsString| name.into_string().ok().filter(|name| is_own(name));
    names.map(own).collect::<Option<_>>().ok_or_else(|| {
        refused(
            path,
            "contains files that no job made; choose a new or empty directory with --job",
        )
    })
}

/// The usual job directory for `output`: `OUTPUT.job` beside it.
pub(crate) fn default_directory(output: &Path) -> PathBuf {
    let mut name = output
        .file_name()
        .map(std::ffi::OsStr::to_owned)
        .unwrap_or_default();
    name.push(".job");
    output.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn open(path: &Path, identity: u32, restart: bool) -> Result<JobDirectory, JobError> {
        JobDirectory::open(path, identity.into(), restart)
    }

    #[test]
    fn a_directory_belongs_to_one_job_and_one_process() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("job");
        let first = open(&path, 1, false).unwrap();
        first.write("spacing.json", &0.5).unwrap();
        let error = open(&path, 1, false).unwrap_err().to_string();
        assert!(error.contains("another process"), "{error}");
        drop(first);
        assert_eq!(
            open(&path, 1, false).unwrap().read("spacing.json"),
            Some(0.5)
        );
        let error = open(&path, 2, false).unwrap_err().to_string();
        assert!(error.contains("--restart"), "{error}");
        let anew = open(&path, 2, true).unwrap();
        assert_eq!(anew.read::<f64>("spacing.json"), None);
        anew.clear();
        assert!(!path.exists());
    }

    #[test]
    fn a_lock_that_is_given_up_soon_is_waited_for() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("job");
        let dying = open(&path, 1, false).unwrap();
        dying.write("spacing.json", &0.5).unwrap();
        thread::scope(|scope| {
            let next = scope.spawn(|| open(&path, 1, false).unwrap().read("spacing.json"));
            thread::sleep(10 * BETWEEN_TRIES);
            assert!(!next.is_finished());
            drop(dying);
            assert_eq!(next.join().unwrap(), Some(0.5));
        });
        // One that completes its job removes the directory.
        let done = open(&path, 1, false).unwrap();
        thread::scope(|scope| {
            let next = scope.spawn(|| open(&path, 1, false).unwrap());
            thread::sleep(10 * BETWEEN_TRIES);
            done.clear();
            let next = next.join().unwrap();
            assert!(next.is_new && path.join(OWNER_FILE).exists());
        });
    }

    #[test]
    fn a_directory_is_joined_by_processes_of_one_job() {
        let dir = tempfile::tempdir().unwrap();
        let (path, output) = (dir.path().join("job"), dir.path().join("out.laz"));
        let join = |identity: u32| JobDirectory::join(&path, identity.into(), &output);
        thread::scope(|scope| {
            let joining = [(); 8].map(|()| scope.spawn(|| join(1).unwrap()));
            assert!(joining.into_iter().all(|joined| joined.join().unwrap()));
        });
        assert!(join(2).unwrap_err().to_string().contains("other inputs"));
        let names = own_names(&path).unwrap();
        assert_eq!(names, [OWNER_FILE]);
        // A process that locks the directory recognizes the job, too; later ones find it done.
        let mut job = open(&path, 1, false).unwrap();
        fs::write(&output, "a cloud").unwrap();
        job.deliver(Stamp::of(&output).unwrap()).unwrap();
        assert!(!join(1).unwrap());
        fs::remove_file(path.join(OWNER_FILE)).unwrap();
        fs::write(path.join("plan.json"), "of whom?").unwrap();
        assert!(join(1).unwrap_err().to_string().contains("plan.json"));
    }

    #[test]
    fn what_an_earlier_run_left_is_not_given_up() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("job");
        open(&path, 1, false).unwrap().abandon();
        assert!(!path.exists());
        drop(open(&path, 1, false).unwrap());
        open(&path, 1, false).unwrap().abandon();
        assert!(path.join("job.json").exists());
    }

    #[test]
    fn what_is_no_jobs_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["tile-photo.jpg", "notes.txt", "plan.xls", "Données"] {
            let path = dir.path().join(name);
            fs::write(&path, "precious").unwrap();
            let error = open(dir.path(), 1, true).unwrap_err().to_string();
            assert!(error.contains("no job made"), "{error}");
            assert_eq!(fs::read(&path).unwrap(), b"precious");
            fs::remove_file(path).unwrap();
        }
    }

    #[test]
    fn a_delivered_output_is_known_again_unless_it_was_changed() {
        let dir = tempfile::tempdir().unwrap();
        let (path, output) = (dir.path().join("job"), dir.path().join("out.laz"));
        fs::write(&output, "a cloud").unwrap();
        let mut job = open(&path, 1, false).unwrap();
        assert!(!job.has_delivered(&output));
        job.deliver(Stamp::of(&output).unwrap()).unwrap();
        drop(job);
        assert!(open(&path, 1, false).unwrap().has_delivered(&output));
        fs::write(&output, "another one").unwrap();
        assert!(!open(&path, 1, false).unwrap().has_delivered(&output));
    }
}
