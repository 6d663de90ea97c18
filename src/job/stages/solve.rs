//! Solve: tiles one after the other, each read from the spill while the one before it is solved, if
//! there is room for both; in one round, or in two.

use std::{
    ops::ControlFlow,
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::Instant,
};

use crossbeam::channel;

use super::{
    planned_job::PlannedJob,
    tile_solver::{LoadedTile, TileSolver},
};
use crate::{
    job::{
        context::RunContext,
        directory::{SolvedTiles, StartedTiles},
        error::JobError,
        progress::{Progress, Unit},
    },
    lloyd::CountCorrection,
    tile::BlockFile,
    tiling::Tile,
};

/// Receives a tile with the share of its work that is done; the share is 1 when the tile is on the
/// disk.
pub(crate) type WatchTile<'a> = &'a (dyn Fn(&Tile, f64) + Sync);

/// Receives the share of the work on a tile that is done, and says whether it goes on.
type WatchShare<'a> = &'a (dyn Fn(f64) -> ControlFlow<()> + Sync);

/// The files in which other processes have begun and solved tiles of a job.
pub(crate) struct FilesOfOthers {
    /// The tiles that have done the first of two rounds.
    pub(crate) started: Vec<BlockFile>,
    /// The tiles that are solved.
    pub(crate) solved: Vec<BlockFile>,
}

/// Solves the tiles of a planned job that are not solved yet, by this process or in the files of
/// `others`. Returns all solved tiles.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn solve_missing(
    run: &RunContext<'_>,
    planned: &PlannedJob,
    others: FilesOfOthers,
) -> Result<SolvedTiles, JobError> {
    let solver = &planned.solver;
    let mut solved = SolvedTiles::open(planned.directory.path(), others.solved)?;
    let tiles = solver.plan.plan.tiles.iter();
    let (done, missing) = tiles.partition(|tile| solved.contains(tile.id));
    let started = match solver.plan.has_two_rounds && !Vec::is_empty(&missing) {
        true => {
            let started = start_missing(run, planned, others.started)?;
            let correction = corrected_count(run, solver, &started)?;
            Some((started, correction))
        }
        false => None,
    };
    in_stage(
        run,
        "solve",
        done,
        missing,
        |missing, watch| match &started {
            Some(after) => finish_tiles(run, solver, missing, after, &mut solved, watch),
            None => solve_tiles(run, solver, missing, &mut solved, watch),
        },
    )?;
    Ok(solved)
}

/// Does the first round for the tiles of a planned job that have not done it yet, by this process or in the files of
/// `others`. Returns all tiles that have.
fn start_missing(
    run: &RunContext<'_>,
    planned: &PlannedJob,
    others: Vec<BlockFile>,
) -> Result<StartedTiles, JobError> {
    let solver = &planned.solver;
    let edge = solver.edge_of_pieces();
    let mut started = StartedTiles::open(planned.directory.path(), others, edge)?;
    let tiles = solver.plan.plan.tiles.iter();
    let (done, missing) = tiles.partition(|tile| started.contains(tile.id));
    in_stage(run, "start", done, missing, |missing, watch| {
        start_tiles(run, solver, missing, &mut started, watch)
    })?;
    run.clock.end_stage("start");
    Ok(started)
}

/// Does the first round for `tiles` and adds them to `started`.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn start_tiles(
    run: &RunContext<'_>,
    solver: &TileSolver,
    tiles: &[Tile],
    started: &mut StartedTiles,
    watch: WatchTile<'_>,
) -> Result<(), JobError> {
    let load = |tile| solver.load(tile);
    each_tile(run, solver, tiles, load, watch, |loaded, begun, watch| {
        let id = loaded.tile.id;
        let (mut tile, round) = solver.start(loaded, watch)?;
        tile.seconds = begun.elapsed().as_secs_f64();
        started.add(id, tile, round)
    })
}

/// The sites that leave and come so that the `started` tiles, which are all, have as many as were asked for.
///
/// # Errors
///
/// [`JobError::Tile`] if what a tile left cannot be read.
pub(crate) fn corrected_count(
    run: &RunContext<'_>,
    solver: &TileSolver,
    started: &StartedTiles,
) -> Result<CountCorrection, JobError> {
    let Some(wanted) = solver.wanted else {
        return Ok(CountCorrection::default());
    };
    let tiles = &solver.plan.plan.tiles;
    let (correction, sites) = started.correction(wanted, tiles, &solver.options)?;
    if !correction.is_empty() {
        run.progress.note(&format!(
            "{sites} seeds for {} points: {correction}",
            wanted.sites
        ));
    }
    Ok(correction)
}

/// Solves `tiles`, which have done the first round as all others have, by those and the correction of their count, and
/// adds them to `solved`.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn finish_tiles(
    run: &RunContext<'_>,
    solver: &TileSolver,
    tiles: &[Tile],
    (started, correction): &(StartedTiles, CountCorrection),
    solved: &mut SolvedTiles,
    watch: WatchTile<'_>,
) -> Result<(), JobError> {
    let load = |tile| solver.load_again(tile, started);
    each_tile(run, solver, tiles, load, watch, |loaded, begun, watch| {
        let id = loaded.tile.id;
        let (result, mut figures) = solver.finish(loaded, started, correction, watch)?;
        figures.seconds += begun.elapsed().as_secs_f64();
        solved.add(id, &result, &figures)
    })
}

/// Solves `tiles` in one round and adds them to `solved`.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn solve_tiles(
    run: &RunContext<'_>,
    solver: &TileSolver,
    tiles: &[Tile],
    solved: &mut SolvedTiles,
    watch: WatchTile<'_>,
) -> Result<(), JobError> {
    let load = |tile| solver.load(tile);
    each_tile(run, solver, tiles, load, watch, |loaded, begun, watch| {
        let id = loaded.tile.id;
        let (result, mut figures) = solver.solve(loaded, watch)?;
        figures.seconds = begun.elapsed().as_secs_f64();
        solved.add(id, &result, &figures)
    })
}

/// Does `work` on the tiles that are `missing`, and reports what is done of it as `stage`.
fn in_stage(
    run: &RunContext<'_>,
    stage: &str,
    done: Vec<Tile>,
    missing: Vec<Tile>,
    work: impl FnOnce(&[Tile], WatchTile<'_>) -> Result<(), JobError>,
) -> Result<(), JobError> {
    let (progress, all) = (run.progress, done.len() + missing.len());
    progress.begin(stage, all as u64, done.len() as u64, Unit::Tiles);
    let cost = |tiles: &[Tile]| tiles.iter().map(|tile| tile.cost).sum::<u64>();
    let done_cost = AtomicU64::new(cost(&done));
    let all_cost = cost(&done) + cost(&missing);
    work(&missing, &|tile, share| {
        let before = done_cost.load(Ordering::Relaxed) as f64;
        progress.reach((before + share * tile.cost as f64) / all_cost as f64);
        if share >= 1.0 {
            done_cost.fetch_add(tile.cost, Ordering::Relaxed);
            progress.advance(1);
        }
    })?;
    progress.end();
    Ok(())
}

/// Gets each of `tiles` by `load`, while `work` is done on the one before it if both fit the memory.
/// `work` receives the moment when it began, and brings its result to the disk; `watch` is told what
/// is done.
fn each_tile(
    run: &RunContext<'_>,
    solver: &TileSolver,
    tiles: &[Tile],
    load: impl Fn(Tile) -> Result<LoadedTile, JobError> + Send + Sync,
    watch: WatchTile<'_>,
    mut work: impl FnMut(LoadedTile, Instant, WatchShare<'_>) -> Result<(), JobError> + Send,
) -> Result<(), JobError> {
    // Without capacity the channel passes a tile on only when the one before it is done, so that
    // two tiles at most are in memory.
    let (sender, receiver) = channel::bounded(0);
    let (done, wait_for_done) = channel::unbounded();
    let budget = run.budget.holding(solver.spill.resident_bytes());
    thread::scope(|scope| {
        // However the work ends, the thread that waits for it hears of the end.
        let done = done;
        // Read the tiles in a thread of its own.
        scope.spawn(move || {
            let mut before: Option<Tile> = None;
            for &tile in tiles {
                let has_room = |before: Tile| budget.has_room_for_next(before.cost, tile.cost);
                if !before.is_none_or(has_room) {
                    // The tiles that are done come in their order; without work there is no more.
                    let is_last = |&done: &u32| Some(done) == before.map(|tile| tile.id);
                    if !wait_for_done.iter().any(|done| is_last(&done)) {
                        return;
                    }
                }
                before = Some(tile);
                let loaded = run.pool.install(|| load(tile));
                if run.cancel.load(Ordering::Relaxed) || sender.send(loaded).is_err() {
                    return;
                }
            }
        });

        // Work on each.
        for loaded in receiver {
            let (loaded, begun) = (loaded?, Instant::now());
            let tile = loaded.tile;
            let watch_share = |share| {
                watch(&tile, share);
                match run.cancel.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            run.pool.install(|| work(loaded, begun, &watch_share))?;
            watch(&tile, 1.0);
            // Whoever waits for it may have been stopped.
            done.send(tile.id).ok();
            if run.cancel.load(Ordering::Relaxed) {
                break;
            }
        }
        Ok::<(), JobError>(())
    })?;
    run.check_cancelled()
}
