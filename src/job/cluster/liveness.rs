//! Which groups are free, which are at work, and which processes are dead.
//!
//! A process that works touches the file of its claim at every heartbeat. Whether it lives is
//! judged by whether that file *changes* while this process watches it, by this process's own
//! clock: the clocks of several machines differ. A claim whose file has not changed during the
//! heartbeat timeout belongs to a dead process, and its group is free for the next attempt.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use super::claims::{AttemptState, Claim};
use crate::job::directory::Stamp;

/// What is known of a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GroupState {
    /// No process works on it; the number of its next attempt.
    Free(u32),
    /// A process works on it, as far as one can tell.
    AtWork {
        /// Whether the process was seen to give a heartbeat.
        is_alive: bool,
    },
    /// Its result is complete.
    Complete,
    /// As many processes have died over it as the retry limit allows.
    GivenUp,
}

/// How a claim's file has changed while it was watched.
#[derive(Debug)]
struct Observation {
    /// The state of the file when it was last read.
    stamp: Stamp,
    /// Whether it has changed since it was first seen.
    has_changed: bool,
    /// When it was last seen to change, or else first seen.
    since: Instant,
}

/// The heartbeats of the other processes, as far as this process has seen them.
#[derive(Debug)]
pub(super) struct Liveness {
    heartbeat_timeout: Duration,
    /// The number of deaths over one group after which it is given up.
    retry_limit: u32,
    /// By the path of the claim's file.
    seen: HashMap<PathBuf, Observation>,
}

impl Liveness {
    /// Begins to watch; no claim has been seen as yet.
    pub(super) fn new(heartbeat_timeout: Duration, retry_limit: u32) -> Self {
        Self {
            heartbeat_timeout,
            retry_limit,
            seen: HashMap::new(),
        }
    }

    /// Returns the state of each of `count` groups, given all `claims` in the order of
    /// [`Claim::all`].
    pub(super) fn states(&mut self, claims: &[Claim], count: usize) -> Vec<GroupState> {
        let mut states = vec![GroupState::Free(0); count];
        let mut deaths = vec![0; count];
        for claim in claims {
            let Some(state) = states.get_mut(claim.group) else {
                continue;
            };
            if claim.state == AttemptState::Complete || *state == GroupState::Complete {
                *state = GroupState::Complete;
                continue;
            }
            let is_alive = match claim.state {
                AttemptState::Claimed => self.is_alive(&claim.path()),
                _ => None,
            };
            if is_alive.is_none() && claim.state == AttemptState::Claimed {
                deaths[claim.group] += 1;
            }
            *state = match is_alive {
                Some(is_alive) => GroupState::AtWork { is_alive },
                None if deaths[claim.group] >= self.retry_limit => GroupState::GivenUp,
                None => GroupState::Free(claim.attempt + 1),
            };
        }
        states
    }

    /// Returns whether the file at `path` was seen to change; `None` if it has not changed during
    /// the heartbeat timeout.
    fn is_alive(&mut self, path: &Path) -> Option<bool> {
        // A file that has vanished existed a moment ago: the job is being tidied up.
        let Ok(stamp) = Stamp::of(path) else {
            return Some(false);
        };
        let observation = self
            .seen
            .entry(path.to_owned())
            .or_insert_with(|| Observation {
                stamp,
                has_changed: false,
                since: Instant::now(),
            });
        if observation.stamp != stamp {
            *observation = Observation {
                stamp,
                has_changed: true,
                since: Instant::now(),
            };
        }
        match observation.since.elapsed() >= self.heartbeat_timeout {
            true => None,
            false => Some(observation.has_changed),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{borrow::Cow, thread};

    use super::*;
    use crate::job::cluster::claims::WorkKind;

    const KIND: WorkKind = WorkKind {
        prefix: Cow::Borrowed("work"),
        claim_extension: "bin",
        complete_extension: "index",
    };

    #[test]
    fn a_silent_process_is_taken_for_dead_and_a_living_one_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let claim = |attempt| Claim::new(&KIND, dir.path(), 0, attempt);
        let states =
            |watch: &mut Liveness| watch.states(&Claim::all(&KIND, dir.path()).unwrap(), 2);
        let mut watch = Liveness::new(Duration::from_millis(200), 2);
        assert_eq!(states(&mut watch), [GroupState::Free(0); 2]);
        assert!(claim(0).take().unwrap() && !claim(0).take().unwrap());
        let at_work = |is_alive| [GroupState::AtWork { is_alive }, GroupState::Free(0)];
        assert_eq!(states(&mut watch), at_work(false));
        for _ in 0..3 {
            claim(0).touch();
            assert_eq!(states(&mut watch), at_work(true));
            thread::sleep(Duration::from_millis(100));
        }
        thread::sleep(Duration::from_millis(150));
        assert_eq!(
            states(&mut watch),
            [GroupState::Free(1), GroupState::Free(0)]
        );
        // A process that was stopped is not dead, and does not count for the retry limit.
        assert!(claim(1).take().unwrap());
        claim(1).abandon();
        assert_eq!(
            states(&mut watch),
            [GroupState::Free(2), GroupState::Free(0)]
        );
        assert!(claim(2).take().unwrap());
        assert_eq!(states(&mut watch), at_work(false));
        thread::sleep(Duration::from_millis(250));
        assert_eq!(
            states(&mut watch),
            [GroupState::GivenUp, GroupState::Free(0)]
        );
        claim(0).complete().unwrap();
        assert_eq!(
            states(&mut watch),
            [GroupState::Complete, GroupState::Free(0)]
        );
    }
}
