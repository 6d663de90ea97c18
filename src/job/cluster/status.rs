//! How far a job is that several processes do, and how long its tasks should be given.

use std::{fs, path::Path};

use serde::Serialize;

use super::{
    claims::{AttemptState, Claim, WorkKind},
    group_files::{STARTS, TILES, block_files_of},
    handover::Handover,
    shared_stitch::works_begun,
    tile_groups::groups,
    worker::HEARTBEAT_INTERVAL,
};
use crate::{
    job::{
        JobError,
        directory::{SolvedTiles, StartedTiles},
        stages::scan_groups::{POINTS, ScanGroups},
    },
    tiling::Tile,
};

/// The minutes that a task is given beyond its work: to begin, and to see what others do.
const SPARE_MINUTES: u64 = 10;
/// A task is given this many times the time that its work should take.
const TIME_LIMIT_FACTOR: f64 = 3.0;
/// The number of heartbeats that may be missing before a process no longer counts as a worker in
/// the estimate of the remaining time.
const MISSED_HEARTBEATS: f64 = 4.0;

/// How far a job is.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct JobStatus {
    /// The number of groups of scans that are scattered, and of all groups; `None` if scattering
    /// is over, or one process does it alone.
    pub(crate) scattered: Option<[u64; 2]>,
    /// The number of tiles of the job; 0 before everything is scattered.
    pub(crate) tiles: u64,
    /// The number of tiles that have done the first of two rounds; `None` if there is one round.
    pub(crate) started: Option<u64>,
    /// The number of tiles that are solved.
    pub(crate) solved: u64,
    /// The share of the scattering that is done, or of the solving by its cost.
    pub(crate) share: f64,
    /// The groups that a process has claimed and not completed.
    #[serde(rename = "begun")]
    pub(crate) claimed: Vec<ClaimedGroup>,
    /// The seconds until all tiles are solved by the processes that work now; `None` if none
    /// works, or no tile is solved as yet.
    #[serde(rename = "seconds")]
    pub(crate) remaining_seconds: Option<f64>,
    /// The works of the stitch that processes have begun together, in their order.
    pub(crate) stitch: Vec<StitchWork>,
}

/// How far a work of the stitch is.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct StitchWork {
    /// What becomes of its pieces: `settled`, `measured`, `sorted`.
    pub(crate) work: String,
    /// The number of groups of pieces that are complete, and of all groups.
    pub(crate) groups: [u64; 2],
    /// The groups that a process has claimed and not completed.
    #[serde(rename = "begun")]
    pub(crate) claimed: Vec<ClaimedGroup>,
}

/// A group that a process has claimed and not completed.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ClaimedGroup {
    /// The number of the group of scans or of pieces, or the numbers of the group's tiles.
    pub(crate) members: Vec<u32>,
    /// The number of the attempt, from 1.
    pub(crate) attempt: u32,
    /// The seconds since the last heartbeat, by the clocks of both machines.
    #[serde(rename = "silent")]
    pub(crate) silent_seconds: f64,
}

impl JobStatus {
    /// Reads the status of the job in `dir`.
    ///
    /// # Errors
    ///
    /// If `dir` contains no job that several processes do, or cannot be read.
    pub(crate) fn of(dir: &Path) -> Result<Self, JobError> {
        match ScanGroups::read(dir) {
            Some(groups) if !Handover::exists_in(dir) => Self::of_scattering(dir, groups.count),
            _ => Self::of_solving(dir),
        }
    }

    fn of_scattering(dir: &Path, count: usize) -> Result<Self, JobError> {
        let claims = Claim::all(&POINTS, dir)?;
        let claimed = claimed(&claims, |group| vec![group as u32]);
        let complete = Claim::complete_of(claims).len();
        Ok(Self {
            scattered: Some([complete as u64, count as u64]),
            tiles: 0,
            started: None,
            solved: 0,
            share: complete as f64 / count as f64,
            claimed,
            remaining_seconds: None,
            stitch: Vec::new(),
        })
    }

    fn of_solving(dir: &Path) -> Result<Self, JobError> {
        let handover = Handover::read(dir)?;
        let plan = &handover.plan.plan;
        let claims = Claim::all(&TILES, dir)?;
        let tiles = SolvedTiles::of(block_files_of(&claims)?);
        let (mut solved, mut cost_done, mut seconds) = (0, 0, 0.0);
        for tile in plan.tiles.iter().filter(|tile| tiles.contains(tile.id)) {
            solved += 1;
            cost_done += tile.cost;
            seconds += tiles.figures(tile.id)?.seconds;
        }
        let starts = Claim::all(&STARTS, dir)?;
        let begun = StartedTiles::of(block_files_of(&starts)?, 1);
        let begun = plan.tiles.iter().filter(|tile| begun.contains(tile.id));
        let started = handover.plan.has_two_rounds.then(|| begun.count() as u64);
        let groups = groups(plan);
        let members = |group: usize| {
            let tiles = groups.get(group).into_iter().flatten();
            tiles.map(|tile| tile.id).collect()
        };
        let of_kinds = [starts, claims].into_iter();
        let claimed: Vec<ClaimedGroup> = of_kinds
            .flat_map(|of_kind| claimed(&of_kind, members))
            .collect();
        let is_alive = |group: &&ClaimedGroup| {
            group.silent_seconds < MISSED_HEARTBEATS * HEARTBEAT_INTERVAL.as_secs_f64()
        };
        let workers = claimed.iter().filter(is_alive).count();
        let cost: u64 = plan.tiles.iter().map(|tile| tile.cost).sum();
        // Without a solved tile or a worker this is a division by zero, and not finite.
        let remaining = seconds / cost_done as f64 * (cost - cost_done) as f64 / workers as f64;
        Ok(Self {
            scattered: None,
            tiles: plan.tiles.len() as u64,
            started,
            solved,
            share: cost_done as f64 / cost as f64,
            claimed,
            remaining_seconds: remaining.is_finite().then_some(remaining),
            stitch: stitch(dir, plan.tiles.len())?,
        })
    }

    /// Returns the minutes after which each of `tasks` tasks with `cores` cores should have ended
    /// that together solve the tiles of the job in `dir`: three times what the plan expects, and
    /// ten minutes.
    ///
    /// # Errors
    ///
    /// If `dir` contains no scattered job, or cannot be read.
    pub(crate) fn time_limit_minutes(dir: &Path, tasks: u32, cores: u32) -> Result<u64, JobError> {
        let handover = Handover::read(dir)?;
        let (plan, settings) = (&handover.plan, &handover.job.settings);
        let groups = groups(&plan.plan);
        let cost = |tiles: &[Tile]| tiles.iter().map(|tile| tile.cost).sum::<u64>();
        let heaviest = groups.first().map_or(0, |group| cost(group));
        // A task does a whole group, however many tasks there are.
        let share = heaviest as f64 / cost(&plan.plan.tiles).max(1) as f64;
        let seconds_of_a_core = plan.seconds_to_solve * settings.resources.threads as f64;
        let seconds = seconds_of_a_core / f64::from(cores) * share.max(1.0 / f64::from(tasks));
        Ok((TIME_LIMIT_FACTOR * seconds / 60.0).ceil() as u64 + SPARE_MINUTES)
    }
}

/// Lists the works of the stitch of `tiles` tiles that processes have begun in `dir`.
fn stitch(dir: &Path, tiles: usize) -> Result<Vec<StitchWork>, JobError> {
    let status = |(kind, count): (WorkKind, usize)| {
        let claims = Claim::all(&kind, dir)?;
        let claimed = claimed(&claims, |group| vec![group as u32]);
        let complete = Claim::complete_of(claims).len();
        // The number of pieces, which the names of files have, says nothing to who asks.
        let name = kind.prefix.trim_end_matches(|c: char| c.is_ascii_digit());
        Ok(StitchWork {
            work: name.trim_end_matches('-').to_owned(),
            groups: [complete as u64, count as u64],
            claimed,
        })
    };
    works_begun(dir, tiles)?.into_iter().map(status).collect()
}

/// Lists the latest attempts of `claims` at groups that are not complete; `members` returns what
/// belongs to a group.
fn claimed(claims: &[Claim], members: impl Fn(usize) -> Vec<u32>) -> Vec<ClaimedGroup> {
    let is_over = |claim: &Claim| {
        let mut of_group = claims.iter().filter(|other| other.group == claim.group);
        of_group.any(|o| o.state == AttemptState::Complete || o.attempt > claim.attempt)
    };
    claims
        .iter()
        .filter(|claim| claim.state == AttemptState::Claimed && !is_over(claim))
        .filter_map(|claim| {
            let modified = fs::metadata(claim.path()).ok()?.modified().ok()?;
            Some(ClaimedGroup {
                members: members(claim.group),
                attempt: claim.attempt + 1,
                silent_seconds: modified.elapsed().unwrap_or_default().as_secs_f64(),
            })
        })
        .collect()
}
