//! One job's tiles solved by several processes, on one machine or on many that have nothing
//! in common but the job directory.
//!
//! Tiles go in groups of about equal cost, heaviest first. Who creates the file
//! `tiles-GROUP-ATTEMPT.solved` has claimed the group, adds each of its tiles to that file,
//! and renames it to `….complete`. Only one process can create a file, and a name is seen by
//! all: no locks are needed. While a process works it touches its file; a file that nobody
//! touches for a while is that of a dead process, and the next attempt at the group takes
//! over what is whole in it. Should two work on one group all the same, because one was
//! thought dead, they solve the same tiles to the same bits. A process that is told to stop
//! says so: it renames its file to `….left`.

use std::{
    collections::HashMap,
    fs::{self, File},
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant, SystemTime},
};

use crossbeam::channel::{self, RecvTimeoutError};
use serde::Serialize;

use super::{
    JobError, Progress, Unit, directory::Stamp, handover::Handover, job::threads,
    memory::mebibytes, queue::Queue, tiles::SolvedTiles, transfer::Transfer,
};
use crate::tile::{Pack, Plan, Spill, Tile, TileError};

/// Groups that tiles go in, at the most: no job directory holds more than so many files a
/// round of attempts.
const MOST_GROUPS: usize = 256;
/// How often a process says that it lives.
const BEAT: Duration = Duration::from_secs(5);
/// How often is looked whether it is told to stop: it has less than a second then.
const HEED: Duration = Duration::from_millis(100);
/// How often is looked whether others live.
const LOOK: Duration = Duration::from_millis(500);

/// A process that solves tiles of a job together with others.
#[derive(Clone, Copy, Debug)]
pub struct Worker {
    /// Threads.
    pub threads: usize,
    /// It begins with every so many-th group, from this one on: which of how many.
    pub shard: Option<(u32, u32)>,
    /// After so long a silence a process is taken for dead. More than a few beats, which
    /// come every five seconds.
    pub patience: Duration,
    /// How many processes may die over a group before it is given up.
    pub attempts: u32,
    /// Whether it waits until all tiles are solved; or else it ends as soon as there are none
    /// that nobody works on.
    pub waits: bool,
}

/// How far the tiles of a job are.
#[derive(Clone, Debug, Serialize)]
pub struct JobStatus {
    /// Tiles of the job.
    pub tiles: u64,
    /// Of those solved.
    pub solved: u64,
    /// Share of the work that is done.
    pub share: f64,
    /// Groups that somebody works on, or did.
    pub begun: Vec<BegunGroup>,
    /// Seconds until all are solved, by as many as now work; nothing if nobody does or no tile is
    /// solved.
    pub seconds: Option<f64>,
}

/// Tiles that somebody has begun.
#[derive(Clone, Debug, Serialize)]
pub struct BegunGroup {
    /// The tiles.
    pub tiles: Vec<u32>,
    /// The attempt, from 1.
    pub attempt: u32,
    /// Seconds since anything was heard of it, by the clocks of the machines.
    pub silent: f64,
}

/// Tiles of about equal cost together, heaviest first.
fn groups(plan: &Plan) -> Vec<Vec<Tile>> {
    let mut tiles = plan.tiles.clone();
    tiles.sort_by_key(|tile| (std::cmp::Reverse(tile.cost), tile.id));
    let count = tiles.len().min(MOST_GROUPS);
    let mut groups: Vec<(u64, Vec<Tile>)> = vec![(0, Vec::new()); count];
    for tile in tiles {
        // Each to the group that has least.
        if let Some((cost, group)) = groups.iter_mut().min_by_key(|(cost, _)| *cost) {
            *cost += tile.cost;
            group.push(tile);
        }
    }
    groups.sort_by_key(|(cost, group)| (std::cmp::Reverse(*cost), group[0].id));
    groups.into_iter().map(|(_, tiles)| tiles).collect()
}

/// A file of solved tiles, as its name says.
#[derive(Clone, Debug)]
struct Claim {
    group: usize,
    attempt: u32,
    ending: Ending,
    path: PathBuf,
}

/// What became of an attempt, as its name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ending {
    /// Somebody works on it, or died over it.
    Solved,
    Complete,
    /// Somebody was told to stop.
    Left,
}

impl Ending {
    const ALL: [Self; 3] = [Self::Solved, Self::Complete, Self::Left];

    fn name(self) -> &'static str {
        match self {
            Self::Solved => "solved",
            Self::Complete => "complete",
            Self::Left => "left",
        }
    }
}

impl Claim {
    fn of_path(path: PathBuf) -> Option<Self> {
        let (stem, ending) = path.file_name()?.to_str()?.split_once('.')?;
        let (group, attempt) = stem.strip_prefix("tiles-")?.split_once('-')?;
        Some(Self {
            group: group.parse().ok()?,
            attempt: attempt.parse().ok()?,
            ending: Ending::ALL.into_iter().find(|e| e.name() == ending)?,
            path,
        })
    }

    fn name(group: usize, attempt: u32, ending: Ending) -> String {
        format!("tiles-{group}-{attempt}.{}", ending.name())
    }

    /// The tiles in it. Since it was listed it may have got another name.
    fn pack(&self) -> Result<Pack, TileError> {
        let mut pack = Pack::of_another(&self.path);
        for ending in [Ending::Complete, Ending::Left] {
            if pack.as_ref().is_err_and(TileError::is_missing) {
                let name = Self::name(self.group, self.attempt, ending);
                pack = Pack::of_another(&self.path.with_file_name(name));
            }
        }
        pack
    }

    /// All claims in the job directory `dir`.
    fn all(dir: &Path) -> Result<Vec<Self>, JobError> {
        let entries = fs::read_dir(dir).map_err(|e| JobError::io("read", dir, e))?;
        let mut claims = Vec::new();
        for entry in entries {
            let entry = entry.map_err(|e| JobError::io("read", dir, e))?;
            claims.extend(Self::of_path(entry.path()));
        }
        claims.sort_by_key(|claim| (claim.group, claim.attempt));
        Ok(claims)
    }
}

/// The tiles that processes have solved which share the job in `dir`.
pub(super) fn packs(dir: &Path) -> Result<Vec<Pack>, JobError> {
    packs_of(Claim::all(dir)?.iter())
}

fn packs_of<'a>(claims: impl Iterator<Item = &'a Claim>) -> Result<Vec<Pack>, JobError> {
    let packs = claims.map(Claim::pack);
    Ok(packs.collect::<Result<_, TileError>>()?)
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
                Ending::Left => None,
                _ => self.has_changed(&claim.path),
            };
            if is_alive.is_none() && claim.ending == Ending::Solved {
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
        // A file that is gone was renamed meanwhile.
        let stamp = Stamp::of(path).ok();
        let Some(stamp) = stamp else {
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
    /// Solves tiles of the job in `dir` that nobody works on, until there are none.
    ///
    /// # Errors
    ///
    /// See [`JobError`]; [`JobError::Refused`] if there are tiles that were begun too often.
    pub fn solve(
        &self,
        dir: &Path,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        let handover = Handover::read(dir)?;
        let spill = Spill::open(&dir.join("spill"))?;
        let settings = &handover.job.settings;
        let plan = &handover.plan;
        let options = plan.options(settings);
        let transfer = Transfer::new(&handover.record, settings);
        let queue = Queue {
            spill: &spill,
            plan: &plan.plan,
            lattice: plan.lattice,
            options: &options,
            transfer: &transfer,
        };
        let pool = threads(self.threads)?;
        let groups = groups(&plan.plan);
        let mut order: Vec<usize> = (0..groups.len()).collect();
        if let Some((own, of)) = self.shard {
            // Its own groups first, then those of the next shard, and so on.
            order.sort_by_key(|&group| (group as u32 % of + of - own) % of);
        }
        let tiles = plan.plan.tiles.len() as u64;
        progress.begin("solve", tiles, 0, Unit::Tiles);
        let done = |_: &Tile, share: f64| {
            if share >= 1.0 {
                progress.advance(1);
            }
        };
        let mut watch = Watch {
            patience: self.patience,
            attempts: self.attempts,
            seen: HashMap::new(),
        };
        loop {
            if cancel.load(Ordering::Relaxed) {
                return Err(JobError::Tile(TileError::Cancelled));
            }
            let claims = Claim::all(dir)?;
            let states = watch.states(&claims, groups.len());
            let free = order.iter().find_map(|&group| match states[group] {
                State::Free(attempt) => Some((group, attempt)),
                _ => None,
            });
            if let Some((group, attempt)) = free {
                let named = |ending| dir.join(Claim::name(group, attempt, ending));
                let path = named(Ending::Solved);
                // If it is there by now, another process was faster.
                if let Some(own) = Pack::claim(&path)? {
                    let mut packs = packs_of(claims.iter().filter(|c| c.group == group))?;
                    packs.push(own);
                    let mut solved = SolvedTiles::of(packs);
                    let missing: Vec<Tile> = groups[group]
                        .iter()
                        .copied()
                        .filter(|tile| !solved.contains(tile.id))
                        .collect();
                    let left = named(Ending::Left);
                    let result = beating(&path, &left, cancel, || {
                        queue.solve(&missing, &mut solved, &pool, &done, cancel)
                    });
                    if result.is_err() {
                        // Whatever it was, this process says so, and did not die of it.
                        drop(fs::rename(&path, left));
                    }
                    result?;
                    solved.rename_last(&named(Ending::Complete))?;
                }
                continue;
            }
            let given_up: Vec<u32> = (groups.iter().zip(&states))
                .filter(|(_, state)| **state == State::GivenUp)
                .flat_map(|(tiles, _)| tiles.iter().map(|tile| tile.id))
                .collect();
            let waits_for = |state: &State| match state {
                State::Taken { is_alive } => self.waits || !is_alive,
                _ => false,
            };
            if states.iter().any(waits_for) {
                thread::sleep(LOOK);
            } else if given_up.is_empty() {
                progress.end();
                return Ok(());
            } else {
                return Err(JobError::Refused(format!(
                    "tiles {given_up:?}: {} processes died over them, or their machines did. They take up to {} each, with one process to a \
                     machine; see to that, and give --attempts {} to try them again",
                    self.attempts,
                    mebibytes(plan.memory),
                    self.attempts + 1,
                )));
            }
        }
    }
}

/// Does `work`, and touches the file at `path` all the while; once `cancel` is set, it is given
/// the name `left`, for the work may be ended before it has come to its end.
fn beating<T>(path: &Path, left: &Path, cancel: &AtomicBool, work: impl FnOnce() -> T) -> T {
    let (working, done) = channel::bounded::<()>(0);
    thread::scope(|scope| {
        scope.spawn(move || {
            let mut beat = Instant::now();
            while done.recv_timeout(HEED) == Err(RecvTimeoutError::Timeout) {
                // Where this fails the others think us dead, and that does no harm.
                if cancel.load(Ordering::Relaxed) {
                    drop(fs::rename(path, left));
                    return;
                }
                if beat.elapsed() >= BEAT
                    && let Ok(file) = File::options().append(true).open(path)
                {
                    drop(file.set_modified(SystemTime::now()));
                    beat = Instant::now();
                }
            }
        });
        let result = work();
        drop(working);
        result
    })
}

impl JobStatus {
    /// That of the job in `dir`.
    ///
    /// # Errors
    ///
    /// If `dir` holds no scattered job, or cannot be read.
    pub fn of(dir: &Path) -> Result<Self, JobError> {
        let handover = Handover::read(dir)?;
        let plan = &handover.plan.plan;
        let claims = Claim::all(dir)?;
        let solved = SolvedTiles::of(packs_of(claims.iter())?);
        let (mut done, mut seconds) = (0, 0.0);
        let mut count = 0;
        for tile in plan.tiles.iter().filter(|tile| solved.contains(tile.id)) {
            count += 1;
            done += tile.cost;
            seconds += solved.figures(tile.id)?.seconds;
        }
        let groups = groups(plan);
        let is_over = |claim: &Claim| {
            let of_group = || claims.iter().filter(|other| other.group == claim.group);
            of_group().any(|o| o.ending == Ending::Complete || o.attempt > claim.attempt)
        };
        let begun: Vec<BegunGroup> = claims
            .iter()
            .filter(|claim| claim.ending == Ending::Solved && !is_over(claim))
            .filter_map(|claim| {
                let modified = fs::metadata(&claim.path).ok()?.modified().ok()?;
                Some(BegunGroup {
                    tiles: groups.get(claim.group)?.iter().map(|t| t.id).collect(),
                    attempt: claim.attempt + 1,
                    silent: modified.elapsed().unwrap_or_default().as_secs_f64(),
                })
            })
            .collect();
        let all: u64 = plan.tiles.iter().map(|tile| tile.cost).sum();
        let workers = begun
            .iter()
            .filter(|g| g.silent < 4.0 * BEAT.as_secs_f64())
            .count();
        let rest = seconds / done as f64 * (all - done) as f64 / workers as f64;
        Ok(Self {
            tiles: plan.tiles.len() as u64,
            solved: count,
            share: done as f64 / all as f64,
            begun,
            seconds: rest.is_finite().then_some(rest),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Rect;

    fn plan(costs: &[u64]) -> Plan {
        let tiles = (0..).zip(costs).map(|(id, &cost)| Tile {
            id,
            core: Rect {
                min: [0, 0],
                max: [1, 1],
            },
            points_core: 1,
            points_seen: 1,
            cost,
        });
        Plan {
            tiles: tiles.collect(),
            halo: 1,
        }
    }

    #[test]
    fn groups_are_of_about_equal_cost_and_hold_every_tile_once() {
        let costs: Vec<u64> = (0..2000).map(|k| 1000 + k * k % 777).collect();
        let groups = groups(&plan(&costs));
        assert_eq!(groups.len(), MOST_GROUPS);
        let cost = |group: &Vec<Tile>| group.iter().map(|tile| tile.cost).sum::<u64>();
        let of_groups: Vec<u64> = groups.iter().map(cost).collect();
        assert!(of_groups.is_sorted_by(|a, b| a >= b));
        assert!(
            of_groups[MOST_GROUPS - 1] * 10 > of_groups[0] * 8,
            "{of_groups:?}"
        );
        let mut ids: Vec<u32> = groups.iter().flatten().map(|tile| tile.id).collect();
        ids.sort_unstable();
        assert_eq!(ids, (0..2000).collect::<Vec<u32>>());
    }

    #[test]
    fn a_silent_process_is_taken_for_dead_and_a_living_one_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let claim = |attempt| dir.path().join(Claim::name(0, attempt, Ending::Solved));
        let states = |watch: &mut Watch| watch.states(&Claim::all(dir.path()).unwrap(), 2);
        let mut watch = Watch {
            patience: Duration::from_millis(200),
            attempts: 2,
            seen: HashMap::new(),
        };
        assert_eq!(states(&mut watch), [State::Free(0); 2]);
        fs::write(claim(0), "").unwrap();
        let taken = |is_alive| [State::Taken { is_alive }, State::Free(0)];
        assert_eq!(states(&mut watch), taken(false));
        for length in 1..4 {
            fs::write(claim(0), vec![0; length]).unwrap();
            assert_eq!(states(&mut watch), taken(true));
            thread::sleep(Duration::from_millis(100));
        }
        thread::sleep(Duration::from_millis(150));
        assert_eq!(states(&mut watch), [State::Free(1), State::Free(0)]);
        // One that was told to stop is not dead, and no trouble.
        let left = dir.path().join(Claim::name(0, 1, Ending::Left));
        fs::write(left, "").unwrap();
        assert_eq!(states(&mut watch), [State::Free(2), State::Free(0)]);
        fs::write(claim(2), "").unwrap();
        assert_eq!(states(&mut watch), taken(false));
        thread::sleep(Duration::from_millis(250));
        assert_eq!(states(&mut watch), [State::GivenUp, State::Free(0)]);
        fs::rename(
            claim(0),
            dir.path().join(Claim::name(0, 0, Ending::Complete)),
        )
        .unwrap();
        assert_eq!(states(&mut watch), [State::Complete, State::Free(0)]);
    }
}
