//! The job directory: whose it is, and what is kept in it.
//!
//! A directory belongs to one job, said by `job.json`, and to one process at a time,
//! said by the lock. Nothing but a job's own files is ever removed from it.

use std::{
    fs::{self, File, Metadata},
    io,
    path::{Path, PathBuf},
    time::UNIX_EPOCH,
};

use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::job::JobError;
use crate::tile::{read_checksummed, write_checksummed};

/// A job directory that this process holds.
#[derive(Debug)]
pub(crate) struct JobDirectory {
    path: PathBuf,
    /// ResourceSample as long as the job runs.
    _lock: File,
    about: About,
    /// Whether the job was begun by this process.
    is_new: bool,
}

/// What `job.json` says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct About {
    /// What makes this job this job.
    identity: serde_json::Value,
    /// The output, once it is complete.
    delivered: Option<Stamp>,
}

/// Length and time of a file: renamed, it is still the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stamp {
    bytes: u64,
    /// Nanoseconds since 1970.
    modified: u128,
}

impl Stamp {
    /// The stamp of the file at `path` as it is now.
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

impl JobDirectory {
    /// Makes the directory at `path` or finds this very job in it, and takes hold of
    /// it; with `restart` whatever job it finds is forgotten.
    ///
    /// # Errors
    ///
    /// If it cannot be made, another process holds it, or it holds another job or
    /// anything else.
    pub(crate) fn open(
        path: &Path,
        identity: serde_json::Value,
        restart: bool,
    ) -> Result<Self, JobError> {
        let refused = |problem: &str| refused(path, problem);
        let names = own_names(path)?;
        let lock_path = path.join("lock");
        let lock = File::create(&lock_path).map_err(|e| JobError::io("create", &lock_path, e))?;
        if lock.try_lock().is_err() {
            return Err(refused(
                "another process is at work on this job; wait for it, or choose another --job",
            ));
        }
        let mut directory = Self {
            path: path.to_owned(),
            _lock: lock,
            about: About {
                identity,
                delivered: None,
            },
            is_new: false,
        };
        if restart {
            directory.forget(|name| name != "lock");
        }
        match directory.read::<About>(ABOUT) {
            Some(found) if found.identity == directory.about.identity => directory.about = found,
            Some(_) => return Err(refused(OTHER)),
            None => {
                // Whatever else was there, nobody knows what it is of.
                directory.forget(|name| name != "lock" && names.iter().any(|known| known == name));
                directory.write(ABOUT, &directory.about)?;
                directory.is_new = true;
            }
        }
        Ok(directory)
    }

    /// Finds this very job in the directory at `path`, or makes it, as one of several
    /// processes that do: nobody takes hold of it. Whether its output is not complete yet.
    ///
    /// # Errors
    ///
    /// If it cannot be made, or holds another job or anything else.
    pub(crate) fn join(
        path: &Path,
        identity: serde_json::Value,
        output: &Path,
    ) -> Result<bool, JobError> {
        let names = own_names(path)?;
        let about_path = path.join(ABOUT);
        if read_json::<About>(&about_path).is_none() {
            // Who joins writes this first: without it there is nothing else, or nobody
            // knows what it is of.
            let is_work = |name: &&String| !name.starts_with("job") && *name != "lock";
            if let Some(name) = names.iter().find(is_work)
                && !about_path.exists()
            {
                let problem = format!("{name} is left of a job that nobody knows; {RESTART}");
                return Err(refused(path, &problem));
            }
            let about = About {
                identity: identity.clone(),
                delivered: None,
            };
            write_among_others(&about_path, to_json(&about).as_bytes())?;
        }
        match read_json::<About>(&about_path) {
            Some(found) if found.identity == identity => {
                let delivered = found.delivered;
                Ok(delivered.is_none() || Stamp::of(output).ok() != delivered)
            }
            _ => Err(refused(path, OTHER)),
        }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// What the file `name` holds, if it is there and whole.
    pub(crate) fn read<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        read_json(&self.path.join(name))
    }

    /// Writes the file `name`, complete or not at all.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    pub(crate) fn write(&self, name: &str, value: &impl Serialize) -> Result<(), JobError> {
        let path = self.path.join(name);
        write_checksummed(&path, to_json(value).as_bytes())
            .map_err(|e| JobError::io("write", &path, e))
    }

    /// Remembers that the file with this `stamp` is the job's output.
    ///
    /// # Errors
    ///
    /// If it cannot be written down.
    pub(crate) fn deliver(&mut self, stamp: Stamp) -> Result<(), JobError> {
        self.about.delivered = Some(stamp);
        self.write(ABOUT, &self.about)
    }

    /// Whether an earlier run of this job completed the file at `output`, which has
    /// been left alone since.
    pub(crate) fn has_delivered(&self, output: &Path) -> bool {
        let delivered = self.about.delivered;
        delivered.is_some() && Stamp::of(output).ok() == delivered
    }

    /// Removes the results of all tiles, and what others would solve them by.
    pub(crate) fn forget_tiles(&self) {
        self.forget(|name| name.starts_with("tiles") || name == "handover.json");
    }

    /// Removes the job's files of which `wanted` says so; what cannot be removed stays.
    pub(crate) fn forget(&self, wanted: impl Fn(&str) -> bool) {
        let entries = fs::read_dir(&self.path).into_iter().flatten().flatten();
        for entry in entries {
            let name = entry.file_name();
            if name
                .to_str()
                .is_some_and(|name| is_own(name) && wanted(name))
            {
                drop(fs::remove_file(entry.path()));
            }
        }
    }

    /// Gives the job up: removes what this process made of it. What an earlier run left
    /// may be the work of a night, and stays.
    pub(crate) fn abandon(self) {
        if self.is_new {
            self.clear();
        }
    }

    /// Removes the job, and the directory. Whose it was goes last: a process that is
    /// killed on the way knows it again.
    pub(crate) fn clear(self) {
        self.forget(|name| name != ABOUT && name != "lock");
        self.forget(|name| name != "lock");
        self.forget(|_| true);
        drop(fs::remove_dir(&self.path));
    }
}

/// The file that says whose a directory is.
const ABOUT: &str = "job.json";

/// What to do about a directory that cannot be used.
const RESTART: &str = "give --restart to begin anew, or choose another --job";
const OTHER: &str = "holds a job with other inputs or settings, or inputs that have changed since; \
                     give --restart to begin anew, or choose another --job";

fn refused(path: &Path, problem: &str) -> JobError {
    JobError::Refused(format!("{}: {problem}", path.display()))
}

/// Makes the directory at `path` if it is not there: the names of the job's files in it.
fn own_names(path: &Path) -> Result<Vec<String>, JobError> {
    fs::create_dir_all(path).map_err(|e| JobError::io("make the job directory", path, e))?;
    let entries = fs::read_dir(path).map_err(|e| JobError::io("read", path, e))?;
    let names = entries.flatten().map(|entry| entry.file_name());
    let own = |name: std::ffi::OsString| name.into_string().ok().filter(|name| is_own(name));
    names.map(own).collect::<Option<_>>().ok_or_else(|| {
        refused(
            path,
            "holds files that are no job's; choose a new or empty directory with --job",
        )
    })
}

/// Writes `content` to `path`, complete or not at all, where other processes may write the
/// same at the same time.
pub(crate) fn write_among_others(path: &Path, content: &[u8]) -> Result<(), JobError> {
    // Processes on several machines may have one number, but not at one moment.
    let now = UNIX_EPOCH.elapsed().unwrap_or_default().as_nanos();
    let own = format!("job-{}-{now}.json", std::process::id());
    let aside = path.with_file_name(own);
    let write = write_checksummed(&aside, content).and_then(|()| fs::rename(&aside, path));
    write.map_err(|e| JobError::io("write", path, e))
}

/// What the file at `path` holds, if it is there and whole.
fn read_json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let content = read_checksummed(path).ok()??;
    serde_json::from_slice(&content).ok()
}

fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).expect("plain numbers and text")
}

/// Bytes of the files in `dir` whose names are `wanted`; none if there is no such directory.
pub(crate) fn bytes_in(dir: &Path, wanted: impl Fn(&str) -> bool) -> u64 {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    entries
        .filter(|entry| entry.file_name().to_str().is_some_and(&wanted))
        .filter_map(|entry| entry.metadata().ok())
        .map(|metadata| metadata.len())
        .sum()
}

/// Whether `name` is that of a file that jobs make.
fn is_own(name: &str) -> bool {
    const STEMS: [&str; 11] = [
        "groups", "handover", "inputs", "job", "left-out", "lock", "octree", "plan", "spacing",
        "spill", "tiles",
    ];
    const ENDINGS: [&str; 10] = [
        "",
        "json",
        "part",
        "bin",
        "index",
        "checkpoint",
        "complete",
        "left",
        "solved",
        "settled",
    ];
    let (stem, ending) = name.split_once('.').unwrap_or((name, ""));
    // What processes share has numbers.
    let stem = stem.trim_end_matches(|c: char| c == '-' || c.is_ascii_digit());
    STEMS.contains(&stem) && ENDINGS.contains(&ending)
}

/// A name for the directory of the job that makes `output`.
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
    fn a_directory_is_joined_by_processes_of_one_job() {
        let dir = tempfile::tempdir().unwrap();
        let (path, output) = (dir.path().join("job"), dir.path().join("out.laz"));
        let join = |identity: u32| JobDirectory::join(&path, identity.into(), &output);
        std::thread::scope(|scope| {
            let joining = [(); 8].map(|()| scope.spawn(|| join(1).unwrap()));
            assert!(joining.into_iter().all(|joined| joined.join().unwrap()));
        });
        assert!(join(2).unwrap_err().to_string().contains("other inputs"));
        let names = own_names(&path).unwrap();
        assert_eq!(names, [ABOUT]);
        // One that takes hold of it knows it, too, and those who join find it done.
        let mut job = open(&path, 1, false).unwrap();
        fs::write(&output, "a cloud").unwrap();
        job.deliver(Stamp::of(&output).unwrap()).unwrap();
        assert!(!join(1).unwrap());
        fs::remove_file(path.join(ABOUT)).unwrap();
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
            assert!(error.contains("no job's"), "{error}");
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
