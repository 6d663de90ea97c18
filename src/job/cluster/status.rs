//! How far a job is that several processes do.

use std::{fs, path::Path};

use serde::Serialize;

use super::{
    claims::{BEAT, Claim, Ending},
    handover::Handover,
    tile_groups::{TILES, groups, packs_of},
};
use crate::{
    job::{
        JobError,
        scattering::{POINTS, ScanGroups},
        tiles::SolvedTiles,
    },
    tile::Tile,
};

/// For a task to begin, and to look at what others do.
const SPARE_MINUTES: u64 = 10;

/// How far a job is.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct JobStatus {
    /// Groups of scans that were scattered, and all of them; nothing if that is over, or one
    /// process does it alone.
    pub(crate) scattered: Option<[u64; 2]>,
    /// Tiles of the job; none before all is scattered.
    pub(crate) tiles: u64,
    /// Of those solved.
    pub(crate) solved: u64,
    /// Share of the scattering that is done, or of the solving.
    pub(crate) share: f64,
    /// Groups that somebody works on, or did.
    pub(crate) begun: Vec<BegunGroup>,
    /// Seconds until all are solved, by as many as now work; nothing if nobody does or no tile is
    /// solved.
    pub(crate) seconds: Option<f64>,
}

/// Work that somebody has begun.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct BegunGroup {
    /// The group of scans; of tiles, those.
    pub(crate) members: Vec<u32>,
    /// The attempt, from 1.
    pub(crate) attempt: u32,
    /// Seconds since anything was heard of it, by the clocks of the machines.
    pub(crate) silent: f64,
}

impl JobStatus {
    /// That of the job in `dir`.
    ///
    /// # Errors
    ///
    /// If `dir` holds no job that several processes do, or cannot be read.
    pub(crate) fn of(dir: &Path) -> Result<Self, JobError> {
        if let Some(groups) = ScanGroups::read(dir)
            && !Handover::is_in(dir)
        {
            return Self::of_scattering(dir, groups.count);
        }
        let handover = Handover::read(dir)?;
        let plan = &handover.plan.plan;
        let claims = Claim::all(&TILES, dir)?;
        let solved = SolvedTiles::of(packs_of(&claims)?);
        let (mut done, mut seconds) = (0, 0.0);
        let mut count = 0;
        for tile in plan.tiles.iter().filter(|tile| solved.contains(tile.id)) {
            count += 1;
            done += tile.cost;
            seconds += solved.figures(tile.id)?.seconds;
        }
        let groups = groups(plan);
        let begun = begun(&claims, |group| {
            let tiles = groups.get(group).into_iter().flatten();
            tiles.map(|tile| tile.id).collect()
        });
        let all: u64 = plan.tiles.iter().map(|tile| tile.cost).sum();
        let workers = begun
            .iter()
            .filter(|g| g.silent < 4.0 * BEAT.as_secs_f64())
            .count();
        let rest = seconds / done as f64 * (all - done) as f64 / workers as f64;
        Ok(Self {
            scattered: None,
            tiles: plan.tiles.len() as u64,
            solved: count,
            share: done as f64 / all as f64,
            begun,
            seconds: rest.is_finite().then_some(rest),
        })
    }

    /// Minutes after which each of so many tasks, with so many cores each, that solve the tiles of the
    /// job in `dir` should have come to its end: three times what the plan expects, and a little.
    ///
    /// # Errors
    ///
    /// If `dir` holds no scattered job, or cannot be read.
    pub(crate) fn minutes_at_most(dir: &Path, tasks: u32, cores: u32) -> Result<u64, JobError> {
        let handover = Handover::read(dir)?;
        let (plan, settings) = (&handover.plan, &handover.job.settings);
        let groups = groups(&plan.plan);
        let cost = |tiles: &[Tile]| tiles.iter().map(|tile| tile.cost).sum::<u64>();
        let heaviest = groups.first().map_or(0, |group| cost(group));
        // A task does a whole group, however many tasks there are.
        let share = heaviest as f64 / cost(&plan.plan.tiles).max(1) as f64;
        let seconds_of_a_core = plan.seconds_to_solve * settings.threads as f64;
        let seconds = seconds_of_a_core / f64::from(cores) * share.max(1.0 / f64::from(tasks));
        Ok((3.0 * seconds / 60.0).ceil() as u64 + SPARE_MINUTES)
    }

    fn of_scattering(dir: &Path, count: usize) -> Result<Self, JobError> {
        let claims = Claim::all(&POINTS, dir)?;
        let is_complete = |group| {
            let of_group = |c: &&Claim| c.group == group;
            let complete = |c: &Claim| c.ending == Ending::Complete;
            claims.iter().filter(of_group).any(complete)
        };
        let complete = (0..count).filter(|&group| is_complete(group)).count();
        Ok(Self {
            scattered: Some([complete as u64, count as u64]),
            tiles: 0,
            solved: 0,
            share: complete as f64 / count as f64,
            begun: begun(&claims, |group| vec![group as u32]),
            seconds: None,
        })
    }
}

/// The attempts of `claims` that may be at work.
fn begun(claims: &[Claim], members: impl Fn(usize) -> Vec<u32>) -> Vec<BegunGroup> {
    let is_over = |claim: &Claim| {
        let mut of_group = claims.iter().filter(|other| other.group == claim.group);
        of_group.any(|o| o.ending == Ending::Complete || o.attempt > claim.attempt)
    };
    claims
        .iter()
        .filter(|claim| claim.ending == Ending::Begun && !is_over(claim))
        .filter_map(|claim| {
            let modified = fs::metadata(claim.path()).ok()?.modified().ok()?;
            Some(BegunGroup {
                members: members(claim.group),
                attempt: claim.attempt + 1,
                silent: modified.elapsed().unwrap_or_default().as_secs_f64(),
            })
        })
        .collect()
}
