//! Work that several processes do together, on one machine or on many that have nothing in
//! common but a directory.
//!
//! Work comes in numbered groups. Who creates the file `KIND-GROUP-ATTEMPT.ENDING` has claimed
//! the group, and brings its result there; a file with another ending beside it says that it
//! is complete. Only one process can create a file, and a name is seen by all: no locks are
//! needed. While a process works it touches its file; a file that nobody touches for a while
//! is that of a dead process, and somebody makes the next attempt. Should two work on one
//! group all the same, because one was thought dead, they come to the same result. A process
//! that is told to stop says so by a third file, `….left`.

use std::{
    collections::{BTreeMap, HashMap, HashSet},
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant, SystemTime},
};

use crossbeam::channel::{self, RecvTimeoutError};

use crate::{
    job::{JobError, directory::Stamp},
    tile::TileError,
};

/// Groups that work goes in, at the most: no job directory holds more than so many claims a
/// round of attempts.
pub(crate) const MOST_GROUPS: usize = 256;
/// How often a process says that it lives.
pub(crate) const BEAT: Duration = Duration::from_secs(5);
/// How often is looked whether it is told to stop: it has less than a second then.
const HEED: Duration = Duration::from_millis(100);
/// How often is looked whether others live.
const LOOK: Duration = Duration::from_millis(500);

/// A process that does the work of a job together with others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Worker {
    /// Threads.
    pub(crate) threads: usize,
    /// It begins with every so many-th group, from this one on: which of how many.
    pub(crate) shard: Option<(u32, u32)>,
    /// After so long a silence a process is taken for dead. More than a few beats, which
    /// come every five seconds.
    pub(crate) patience: Duration,
    /// How many processes may die over a group before it is given up.
    pub(crate) attempts: u32,
    /// Whether it waits until all is done; or else it ends as soon as there is nothing that
    /// nobody works on.
    pub(crate) waits: bool,
}

/// A kind of work, by the names of its files.
#[derive(Debug)]
pub(crate) struct Kind {
    pub(crate) stem: &'static str,
    /// Ending of the file that claims a group, and holds its result.
    pub(crate) begun: &'static str,
    /// Ending of the file that says that the result is complete.
    pub(crate) complete: &'static str,
}

/// What became of an attempt; the later ones stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Ending {
    /// Somebody works on it, or died over it.
    Begun,
    /// Somebody was told to stop, or could not do it.
    Left,
    Complete,
}

/// An attempt at a group.
#[derive(Clone, Debug)]
pub(crate) struct Claim {
    kind: &'static Kind,
    pub(crate) group: usize,
    pub(crate) attempt: u32,
    pub(crate) ending: Ending,
    /// Its files without their endings.
    pub(crate) stem: PathBuf,
}

impl Claim {
    fn new(kind: &'static Kind, dir: &Path, group: usize, attempt: u32) -> Self {
        Self {
            kind,
            group,
            attempt,
            ending: Ending::Begun,
            stem: dir.join(format!("{}-{group}-{attempt}", kind.stem)),
        }
    }

    /// All of this `kind` in `dir`, by group, then by attempt.
    pub(crate) fn all(kind: &'static Kind, dir: &Path) -> Result<Vec<Self>, JobError> {
        let mut found: BTreeMap<(usize, u32), Ending> = BTreeMap::new();
        for entry in fs::read_dir(dir).map_err(|e| JobError::io("read", dir, e))? {
            let name = entry.map_err(|e| JobError::io("read", dir, e))?.file_name();
            if let Some((attempt, ending)) = name.to_str().and_then(|name| kind.parse(name)) {
                let known = found.entry(attempt).or_insert(ending);
                *known = ending.max(*known);
            }
        }
        let claim = |((group, attempt), ending)| Self {
            ending,
            ..Self::new(kind, dir, group, attempt)
        };
        Ok(found.into_iter().map(claim).collect())
    }

    /// The file that claims the group, and holds its result.
    pub(crate) fn path(&self) -> PathBuf {
        self.stem.with_extension(self.kind.begun)
    }

    /// Whether this process has it now: of several who try at once one succeeds.
    fn take(&self) -> Result<bool, JobError> {
        let path = self.path();
        match File::options().create_new(true).write(true).open(&path) {
            Ok(_) => Ok(true),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(false),
            Err(e) => Err(JobError::io("create", &path, e)),
        }
    }

    /// Says that its result is complete.
    pub(crate) fn complete(&self) -> Result<(), JobError> {
        let path = self.stem.with_extension(self.kind.complete);
        let made = File::create(&path).map(drop);
        made.map_err(|e| JobError::io("create", &path, e))
    }

    /// Says that nobody works on it any more. Where that cannot be said, others wait.
    fn leave(&self) {
        drop(File::create(self.stem.with_extension(LEFT)));
    }

    /// Says that somebody works on it. Where that cannot be said, others think us dead, and
    /// that does no harm.
    fn touch(&self) {
        if let Ok(file) = File::options().append(true).open(self.path()) {
            drop(file.set_modified(SystemTime::now()));
        }
    }
}

const LEFT: &str = "left";

impl Kind {
    /// Group, attempt and ending of the file `name`, if it is of this kind.
    fn parse(&self, name: &str) -> Option<((usize, u32), Ending)> {
        let (stem, ending) = name.split_once('.')?;
        let (kind, numbers) = stem.split_once('-')?;
        let (group, attempt) = numbers.split_once('-')?;
        let endings = [
            (self.begun, Ending::Begun),
            (LEFT, Ending::Left),
            (self.complete, Ending::Complete),
        ];
        let ending = endings.into_iter().find(|(name, _)| *name == ending)?.1;
        let attempt = (group.parse().ok()?, attempt.parse().ok()?);
        (kind == self.stem).then_some((attempt, ending))
    }
}

/// What is known of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// To be begun, for the so many-th time.
    Free(u32),
    /// At work, as far as one can tell; whether that is known.
    Taken {
        is_alive: bool,
    },
    Complete,
    /// Begun too often.
    GivenUp,
}

/// What was seen of the others, and when.
struct Watch {
    patience: Duration,
    attempts: u32,
    /// How each claim was first seen, and when it was last seen to change.
    seen: HashMap<PathBuf, (Stamp, Option<Instant>, Instant)>,
}

impl Watch {
    /// The state of each of `count` groups by `claims`. Whether a process lives is seen by
    /// whether its file changes, by this process's clock: clocks of machines differ.
    fn states(&mut self, claims: &[Claim], count: usize) -> Vec<State> {
        let mut states = vec![State::Free(0); count];
        let mut deaths = vec![0; count];
        for claim in claims {
            let Some(state) = states.get_mut(claim.group) else {
                continue;
            };
            if claim.ending == Ending::Complete || *state == State::Complete {
                *state = State::Complete;
                continue;
            }
            let is_alive = match claim.ending {
                Ending::Begun => self.has_changed(&claim.path()),
                _ => None,
            };
            if is_alive.is_none() && claim.ending == Ending::Begun {
                deaths[claim.group] += 1;
            }
            *state = match is_alive {
                Some(is_alive) => State::Taken { is_alive },
                None if deaths[claim.group] >= self.attempts => State::GivenUp,
                None => State::Free(claim.attempt + 1),
            };
        }
        states
    }

    /// Whether the file at `path` was seen to change; `None` if it has not for too long.
    fn has_changed(&mut self, path: &Path) -> Option<bool> {
        let now = Instant::now();
        // A file that is gone was there a moment ago: the job is being tidied up.
        let Ok(stamp) = Stamp::of(path) else {
            return Some(false);
        };
        let (known, changed, since) = self
            .seen
            .entry(path.to_owned())
            .or_insert((stamp, None, now));
        if *known != stamp {
            (*known, *changed, *since) = (stamp, Some(now), now);
        }
        match since.elapsed() >= self.patience {
            true => None,
            false => Some(changed.is_some()),
        }
    }
}

impl Worker {
    /// How long a silence is usual.
    pub(crate) const PATIENCE: Duration = Duration::from_secs(60);
    /// How many deaths are.
    pub(crate) const ATTEMPTS: u32 = 4;

    /// One that sees the work done, whoever does it.
    pub(crate) fn to_the_end(threads: usize) -> Self {
        Self {
            threads,
            shard: None,
            patience: Self::PATIENCE,
            attempts: Self::ATTEMPTS,
            waits: true,
        }
    }

    /// Does groups of `kind`, of which there are `count`, that nobody does, until there are
    /// none; says which were begun too often. `work` is given a claim and all earlier ones of
    /// its group; it says whether it has done the group, or leaves it to others.
    ///
    /// # Errors
    ///
    /// Those of `work`; [`TileError::Cancelled`] soon after `cancel` is set.
    pub(crate) fn share(
        &self,
        kind: &'static Kind,
        dir: &Path,
        count: usize,
        cancel: &AtomicBool,
        mut work: impl FnMut(&Claim, &[Claim]) -> Result<bool, JobError>,
    ) -> Result<Vec<usize>, JobError> {
        let mut order: Vec<usize> = (0..count).collect();
        if let Some((own, of)) = self.shard {
            // Its own groups first, then those of the next shard, and so on.
            order.sort_by_key(|&group| (group as u32 % of + of - own) % of);
        }
        let mut watch = Watch {
            patience: self.patience,
            attempts: self.attempts,
            seen: HashMap::new(),
        };
        let mut left = HashSet::new();
        loop {
            if cancel.load(Ordering::Relaxed) {
                return Err(JobError::Tile(TileError::Cancelled));
            }
            let claims = Claim::all(kind, dir)?;
            let states = watch.states(&claims, count);
            let free = order.iter().find_map(|&group| match states[group] {
                State::Free(attempt) if !left.contains(&group) => Some((group, attempt)),
                _ => None,
            });
            if let Some((group, attempt)) = free {
                let claim = Claim::new(kind, dir, group, attempt);
                if claim.take()? {
                    let of_group = |other: &Claim| other.group == group;
                    let earlier: Vec<Claim> = claims.into_iter().filter(of_group).collect();
                    let is_done = beating(&claim, cancel, || work(&claim, &earlier));
                    if !matches!(is_done, Ok(true)) {
                        // Whatever it was, this process says so, and did not die of it.
                        claim.leave();
                        left.insert(group);
                    }
                    is_done?;
                } else {
                    // Another process was faster; what a network lists may be older still.
                    thread::sleep(HEED);
                }
                continue;
            }
            let waits_for = |state: &State| match state {
                State::Taken { is_alive } => self.waits || !is_alive,
                _ => false,
            };
            if !states.iter().any(waits_for) {
                let given_up = |&group: &usize| states[group] == State::GivenUp;
                return Ok((0..count).filter(given_up).collect());
            }
            thread::sleep(LOOK);
        }
    }
}

/// Does `work`, and says all the while that `claim` is at work; once `cancel` is set, that it
/// is left, for the work may be ended before it has come to its end.
fn beating<T>(claim: &Claim, cancel: &AtomicBool, work: impl FnOnce() -> T) -> T {
    let (working, done) = channel::bounded::<()>(0);
    thread::scope(|scope| {
        scope.spawn(move || {
            let mut beat = Instant::now();
            while done.recv_timeout(HEED) == Err(RecvTimeoutError::Timeout) {
                if cancel.load(Ordering::Relaxed) {
                    claim.leave();
                    return;
                }
                if beat.elapsed() >= BEAT {
                    claim.touch();
                    beat = Instant::now();
                }
            }
        });
        let result = work();
        drop(working);
        result
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const KIND: Kind = Kind {
        stem: "work",
        begun: "bin",
        complete: "index",
    };

    #[test]
    fn a_silent_process_is_taken_for_dead_and_a_living_one_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let claim = |attempt| Claim::new(&KIND, dir.path(), 0, attempt);
        let states = |watch: &mut Watch| watch.states(&Claim::all(&KIND, dir.path()).unwrap(), 2);
        let mut watch = Watch {
            patience: Duration::from_millis(200),
            attempts: 2,
            seen: HashMap::new(),
        };
        assert_eq!(states(&mut watch), [State::Free(0); 2]);
        assert!(claim(0).take().unwrap() && !claim(0).take().unwrap());
        let taken = |is_alive| [State::Taken { is_alive }, State::Free(0)];
        assert_eq!(states(&mut watch), taken(false));
        for _ in 0..3 {
            claim(0).touch();
            assert_eq!(states(&mut watch), taken(true));
            thread::sleep(Duration::from_millis(100));
        }
        thread::sleep(Duration::from_millis(150));
        assert_eq!(states(&mut watch), [State::Free(1), State::Free(0)]);
        // One that was told to stop is not dead, and no trouble.
        assert!(claim(1).take().unwrap());
        claim(1).leave();
        assert_eq!(states(&mut watch), [State::Free(2), State::Free(0)]);
        assert!(claim(2).take().unwrap());
        assert_eq!(states(&mut watch), taken(false));
        thread::sleep(Duration::from_millis(250));
        assert_eq!(states(&mut watch), [State::GivenUp, State::Free(0)]);
        claim(0).complete().unwrap();
        assert_eq!(states(&mut watch), [State::Complete, State::Free(0)]);
    }

    /// Three at once: every group is done by one of them, but one that nobody can do, which
    /// each tries once.
    #[test]
    fn every_group_is_done_once() {
        let dir = tempfile::tempdir().unwrap();
        let done = std::sync::Mutex::new(vec![0; 20]);
        let never = AtomicBool::new(false);
        thread::scope(|scope| {
            for own in 0..3 {
                let (done, never, dir) = (&done, &never, dir.path());
                scope.spawn(move || {
                    let worker = Worker {
                        shard: Some((own, 3)),
                        waits: false,
                        ..Worker::to_the_end(1)
                    };
                    let given_up = worker.share(&KIND, dir, 20, never, |claim, earlier| {
                        assert_eq!(earlier.len(), claim.attempt as usize);
                        done.lock().unwrap()[claim.group] += 1;
                        if claim.group == 7 {
                            return Ok(false);
                        }
                        claim.complete().map(|()| true)
                    });
                    assert!(given_up.unwrap().is_empty());
                });
            }
        });
        let mut expected = vec![1; 20];
        expected[7] = 3;
        assert_eq!(*done.lock().unwrap(), expected);
    }
}
