//! Which group of work belongs to which process, said by the existence of files.
//!
//! Work is divided into numbered groups. The process that creates the file
//! `PREFIX-GROUP-ATTEMPT.CLAIM_EXTENSION` has claimed the group, and writes its result into that
//! file. Two more files may stand beside it:
//!
//! ```text
//!   tiles-17-0.solved      the claim, and the result as far as it has come
//!   tiles-17-0.complete    the result is complete
//!   tiles-17-0.left        the process has given the attempt up, and lives
//! ```
//!
//! Exactly one process can create a file, and every process sees the name: no locks are needed,
//! and the processes may run on machines that share nothing but the directory.

use std::{
    borrow::Cow,
    collections::BTreeMap,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    time::SystemTime,
};

use crate::job::JobError;

/// The number of groups that work is divided into, at most. It bounds the number of claims that
/// a job directory contains after one round of attempts.
pub(crate) const GROUP_LIMIT: usize = 256;

/// The extension of the file that says that an attempt was given up.
const ABANDONED_EXTENSION: &str = "left";

/// A kind of work, by the names of its files.
#[derive(Clone, Debug)]
pub(crate) struct WorkKind {
    /// The beginning of the names of all its files.
    pub(crate) prefix: Cow<'static, str>,
    /// The extension of the file that claims a group and contains its result.
    pub(crate) claim_extension: &'static str,
    /// The extension of the file that says that the result is complete.
    pub(crate) complete_extension: &'static str,
}

/// What became of an attempt. Of several states that the files of an attempt tell, the largest
/// is valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum AttemptState {
    /// A process works on the group, or died over it.
    Claimed,
    /// The process was stopped, or could not do the work, and has said so.
    Abandoned,
    /// The result is complete.
    Complete,
}

/// An attempt of one process at one group.
#[derive(Clone, Debug)]
pub(crate) struct Claim {
    /// The extensions of its files, as those of the kind of work.
    claim_extension: &'static str,
    complete_extension: &'static str,
    /// The number of the group, from 0.
    pub(crate) group: usize,
    /// The number of the attempt at this group, from 0.
    pub(crate) attempt: u32,
    /// What became of the attempt.
    pub(crate) state: AttemptState,
    /// The path of its files without their extensions.
    pub(crate) stem: PathBuf,
}

impl Claim {
    /// Describes an attempt at `group` that no file stands for as yet.
    pub(super) fn new(kind: &WorkKind, dir: &Path, group: usize, attempt: u32) -> Self {
        Self {
            claim_extension: kind.claim_extension,
            complete_extension: kind.complete_extension,
            group,
            attempt,
            state: AttemptState::Claimed,
            stem: dir.join(format!("{}-{group}-{attempt}", kind.prefix)),
        }
    }

    /// Lists all claims of this `kind` in `dir`, ordered by group, then by attempt.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if `dir` cannot be read.
    pub(crate) fn all(kind: &WorkKind, dir: &Path) -> Result<Vec<Self>, JobError> {
        let mut found: BTreeMap<(usize, u32), AttemptState> = BTreeMap::new();
        for entry in fs::read_dir(dir).map_err(|e| JobError::io("read", dir, e))? {
            let name = entry.map_err(|e| JobError::io("read", dir, e))?.file_name();
            if let Some((attempt, state)) = name.to_str().and_then(|name| kind.parse(name)) {
                let known = found.entry(attempt).or_insert(state);
                *known = state.max(*known);
            }
        }
        let claim = |((group, attempt), state)| Self {
            state,
            ..Self::new(kind, dir, group, attempt)
        };
        Ok(found.into_iter().map(claim).collect())
    }

    /// Lists one complete claim of this `kind` in `dir` for each group that has one. If two processes completed a group, their
    /// results are equal, and the first one is listed.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if `dir` cannot be read.
    pub(crate) fn all_complete(kind: &WorkKind, dir: &Path) -> Result<Vec<Self>, JobError> {
        Ok(Self::complete_of(Self::all(kind, dir)?))
    }

    /// One complete claim of `claims`, which are in the order of their groups, for each group that has one.
    pub(super) fn complete_of(mut claims: Vec<Self>) -> Vec<Self> {
        claims.retain(|claim| claim.state == AttemptState::Complete);
        claims.dedup_by_key(|claim| claim.group);
        claims
    }

    /// The path of the file that claims the group and contains its result.
    pub(crate) fn path(&self) -> PathBuf {
        self.stem.with_extension(self.claim_extension)
    }

    /// Claims the group, and returns whether this process has it now: of several processes that
    /// try at once, one succeeds.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if the file cannot be created although it does not exist.
    pub(super) fn take(&self) -> Result<bool, JobError> {
        let path = self.path();
        match File::options().create_new(true).write(true).open(&path) {
            Ok(_) => Ok(true),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            Err(e) => Err(JobError::io("create", &path, e)),
        }
    }

    /// Records that the result is complete.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if the file that says so cannot be created.
    pub(crate) fn complete(&self) -> Result<(), JobError> {
        let path = self.stem.with_extension(self.complete_extension);
        let made = File::create(&path).map(drop);
        made.map_err(|e| JobError::io("create", &path, e))
    }

    /// Records that this process has given the attempt up. If that file cannot be created, the
    /// other processes wait until the heartbeat times out.
    pub(super) fn abandon(&self) {
        drop(File::create(self.stem.with_extension(ABANDONED_EXTENSION)));
    }

    /// Gives a heartbeat: sets the time of the claim's file. If that fails, other processes may
    /// take this one for dead and do its work again, with the same result.
    pub(super) fn touch(&self) {
        if let Ok(file) = File::options().append(true).open(self.path()) {
            drop(file.set_modified(SystemTime::now()));
        }
    }
}

impl WorkKind {
    /// Reads group, attempt and state from the file name `name`; `None` if it is of another kind.
    fn parse(&self, name: &str) -> Option<((usize, u32), AttemptState)> {
        let (stem, extension) = name.split_once('.')?;
        let numbers = stem.strip_prefix(&*self.prefix)?.strip_prefix('-')?;
        let (group, attempt) = numbers.split_once('-')?;
        let states = [
            (self.claim_extension, AttemptState::Claimed),
            (ABANDONED_EXTENSION, AttemptState::Abandoned),
            (self.complete_extension, AttemptState::Complete),
        ];
        let state = states.into_iter().find(|(name, _)| *name == extension)?.1;
        Some(((group.parse().ok()?, attempt.parse().ok()?), state))
    }
}
