//! Solve: tiles one after the other, each read from the spill while the one before it is solved.

use std::{
    ops::ControlFlow,
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::Instant,
};

use crossbeam::channel;

use super::{planned_job::PlannedJob, tile_solver::TileSolver};
use crate::{
    job::{
        context::RunContext,
        directory::SolvedTiles,
        error::JobError,
        progress::{Progress, Unit},
    },
    tile::BlockFile,
    tiling::Tile,
};

/// Solves the tiles of a planned job that are not solved yet, by this process or in the files of
/// `others`. Returns all solved tiles.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn solve_missing(
    run: &RunContext<'_>,
    planned: &PlannedJob,
    others: Vec<BlockFile>,
) -> Result<SolvedTiles, JobError> {
    let progress = run.progress;
    let tiles = &planned.solver.plan.plan.tiles;

    // Find what is missing.
    let mut solved = SolvedTiles::open(planned.directory.path(), others)?;
    let (done, missing): (Vec<Tile>, Vec<Tile>) =
        tiles.iter().partition(|tile| solved.contains(tile.id));
    progress.begin("solve", tiles.len() as u64, done.len() as u64, Unit::Tiles);

    // Solve it, and report the share of the cost that is done.
    let cost = |tiles: &[Tile]| tiles.iter().map(|tile| tile.cost).sum::<u64>();
    let (all_cost, done_cost) = (cost(tiles), AtomicU64::new(cost(&done)));
    let watch = |tile: &Tile, share: f64| {
        let before = done_cost.load(Ordering::Relaxed) as f64;
        progress.reach((before + share * tile.cost as f64) / all_cost as f64);
        if share >= 1.0 {
            done_cost.fetch_add(tile.cost, Ordering::Relaxed);
            progress.advance(1);
        }
    };
    solve_tiles(run, &planned.solver, &missing, &mut solved, &watch)?;
    progress.end();
    Ok(solved)
}

/// Solves `tiles` and adds them to `solved`. `watch` receives each tile with the share of its work
/// that is done; the share is 1 when the tile is on the disk.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn solve_tiles(
    run: &RunContext<'_>,
    solver: &TileSolver,
    tiles: &[Tile],
    solved: &mut SolvedTiles,
    watch: &(dyn Fn(&Tile, f64) + Sync),
) -> Result<(), JobError> {
    // Without capacity the channel passes a tile on only when the one before it is solved, so that
    // two tiles at most are in memory.
    let (sender, receiver) = channel::bounded(0);
    thread::scope(|scope| {
        // Read the tiles in a thread of its own.
        scope.spawn(move || {
            for &tile in tiles {
                let loaded = run.pool.install(|| solver.load(tile));
                if run.cancel.load(Ordering::Relaxed) || sender.send(loaded).is_err() {
                    return;
                }
            }
        });

        // Solve each, and write its result to the disk.
        for loaded in receiver {
            let start = Instant::now();
            let loaded = loaded?;
            let tile = loaded.tile;
            let watch_tile = |share| {
                watch(&tile, share);
                match run.cancel.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            let (result, mut figures) = run.pool.install(|| solver.solve(loaded, &watch_tile))?;
            figures.seconds = start.elapsed().as_secs_f64();
            solved.add(tile.id, &result, &figures)?;
            watch(&tile, 1.0);
            if run.cancel.load(Ordering::Relaxed) {
                break;
            }
        }
        Ok::<(), JobError>(())
    })?;
    run.check_cancelled()
}
