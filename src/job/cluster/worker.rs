//! One process that does the work of a job together with others.
//!
//! It repeats: list the claims, take the first free group, do it, and give heartbeats meanwhile.
//! Should two processes work on one group all the same, because one was taken for dead, they
//! come to the same result.

use std::{
    collections::HashSet,
    path::Path,
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

use crossbeam::channel::{self, RecvTimeoutError};

use super::{
    claims::{Claim, WorkKind},
    liveness::{GroupState, Liveness},
};
use crate::{job::JobError, tile::TileError};

/// The time between two heartbeats of a process.
pub(super) const HEARTBEAT_INTERVAL: Duration = Duration::from_secs(5);
/// The time between two looks at whether this process is to stop: schedulers give it less than a
/// second when they do not wait.
const CANCEL_POLL_INTERVAL: Duration = Duration::from_millis(100);
/// The time between two listings of the claims while there is nothing to do: at least, and at most.
const POLL_INTERVALS: [Duration; 2] = [Duration::from_millis(10), Duration::from_millis(500)];
/// Between them it is this part of the time for which there was nothing to do, so that hardly more is lost by it than by the wait.
const POLLS_PER_WAIT: u32 = 8;

/// A process that does the work of a job together with others.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Worker {
    /// The number of threads.
    pub(crate) threads: usize,
    /// The shard `(i, n)`: this process begins with the groups whose number is `i` modulo `n`.
    pub(crate) shard: Option<(u32, u32)>,
    /// The silence after which another process is taken for dead. It is several times the
    /// interval of heartbeats, which is five seconds.
    pub(crate) heartbeat_timeout: Duration,
    /// The number of processes that may die over a group before it is given up.
    pub(crate) retry_limit: u32,
    /// Whether it waits until all groups are complete; otherwise it ends as soon as a living
    /// process works on every group that is not.
    pub(crate) waits_for_others: bool,
}

impl Worker {
    /// The heartbeat timeout unless the user gives another one.
    pub(crate) const DEFAULT_HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(60);
    /// The retry limit unless the user gives another one.
    pub(crate) const DEFAULT_RETRY_LIMIT: u32 = 4;

    /// Describes a process that returns when all work is done, by itself or by others.
    pub(crate) fn until_all_is_done(threads: usize) -> Self {
        Self {
            threads,
            shard: None,
            heartbeat_timeout: Self::DEFAULT_HEARTBEAT_TIMEOUT,
            retry_limit: Self::DEFAULT_RETRY_LIMIT,
            waits_for_others: true,
        }
    }

    /// Does the groups of `kind` (there are `count`) that no other process does, until there are
    /// none left; returns the groups that were given up. `work` receives a claim and all earlier
    /// claims of its group, and returns whether it has done the group; if not, the group is left
    /// to other processes.
    ///
    /// # Errors
    ///
    /// The errors of `work`; [`TileError::Cancelled`] soon after `cancel` is set.
    pub(crate) fn share(
        &self,
        kind: &WorkKind,
        dir: &Path,
        count: usize,
        cancel: &AtomicBool,
        mut work: impl FnMut(&Claim, &[Claim]) -> Result<bool, JobError>,
    ) -> Result<Vec<usize>, JobError> {
        let order = self.order(count);
        let mut liveness = Liveness::new(self.heartbeat_timeout, self.retry_limit);
        let mut abandoned = HashSet::new();
        let mut idle_since = Instant::now();
        loop {
            if cancel.load(Ordering::Relaxed) {
                return Err(JobError::Tile(TileError::Cancelled));
            }
            let claims = Claim::all(kind, dir)?;
            let states = liveness.states(&claims, count);
            let free = order.iter().find_map(|&group| match states[group] {
                GroupState::Free(attempt) if !abandoned.contains(&group) => Some((group, attempt)),
                _ => None,
            });
            if let Some((group, attempt)) = free {
                let claim = Claim::new(kind, dir, group, attempt);
                if claim.take()? {
                    let of_group = |other: &Claim| other.group == group;
                    let earlier: Vec<Claim> = claims.into_iter().filter(of_group).collect();
                    let is_done = with_heartbeat(&claim, cancel, || work(&claim, &earlier));
                    if !matches!(is_done, Ok(true)) {
                        // Whatever the reason, this process records that it did not die.
                        claim.abandon();
                        abandoned.insert(group);
                    }
                    is_done?;
                    idle_since = Instant::now();
                } else {
                    // Another process was faster, and the listing of a network file system may
                    // be older still.
                    thread::sleep(CANCEL_POLL_INTERVAL);
                }
                continue;
            }
            if !states.iter().any(|state| self.waits_for(state)) {
                let is_given_up = |&group: &usize| states[group] == GroupState::GivenUp;
                return Ok((0..count).filter(is_given_up).collect());
            }
            let [least, most] = POLL_INTERVALS;
            thread::sleep((idle_since.elapsed() / POLLS_PER_WAIT).clamp(least, most));
        }
    }

    /// The order in which this process tries the groups: first those of its own shard, then
    /// those of the next shard, and so on.
    fn order(&self, count: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..count).collect();
        if let Some((own, of)) = self.shard {
            order.sort_by_key(|&group| (group as u32 % of + of - own) % of);
        }
        order
    }

    /// Whether this process stays while a group is in this state.
    fn waits_for(&self, state: &GroupState) -> bool {
        match state {
            GroupState::AtWork { is_alive } => self.waits_for_others || !is_alive,
            _ => false,
        }
    }
}

/// Does `work` while another thread gives the heartbeats of `claim`. Once `cancel` is set, that
/// thread records that the claim is abandoned, because the process may be killed before `work`
/// returns.
fn with_heartbeat<T>(claim: &Claim, cancel: &AtomicBool, work: impl FnOnce() -> T) -> T {
    let (working, done) = channel::bounded::<()>(0);
    thread::scope(|scope| {
        scope.spawn(move || {
            let mut last = Instant::now();
            while done.recv_timeout(CANCEL_POLL_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                if cancel.load(Ordering::Relaxed) {
                    claim.abandon();
                    return;
                }
                if last.elapsed() >= HEARTBEAT_INTERVAL {
                    claim.touch();
                    last = Instant::now();
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
    use std::borrow::Cow;

    use super::*;

    const KIND: WorkKind = WorkKind {
        prefix: Cow::Borrowed("work"),
        claim_extension: "bin",
        complete_extension: "index",
    };

    /// Three processes work at once. Every group is done by one of them, except for one group
    /// that none can do, which each tries once.
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
                        waits_for_others: false,
                        ..Worker::until_all_is_done(1)
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
