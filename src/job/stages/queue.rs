//! Tiles one after the other, each read while the one before it is solved.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::Instant,
};

use crossbeam::channel;

use crate::job::{
    JobError,
    directory::SolvedTiles,
    solving::{load, solve_tile},
    transfer::Transfer,
};
use crate::{
    geometry::Quantization,
    lloyd::SolverOptions,
    tile::{Plan, Spill, Tile, TileError},
};

/// What tiles are solved from.
pub(crate) struct Queue<'a> {
    pub(crate) spill: &'a Spill,
    pub(crate) plan: &'a Plan,
    pub(crate) quantization: Quantization,
    pub(crate) options: &'a SolverOptions,
    pub(crate) transfer: &'a Transfer,
}

impl Queue<'_> {
    /// Solves `tiles` and adds them to `solved`. `watch` is told what share of the tile at
    /// work is done: all of it, once it is on the disk.
    pub(crate) fn solve(
        &self,
        tiles: &[Tile],
        solved: &mut SolvedTiles,
        pool: &rayon::ThreadPool,
        watch: &(dyn Fn(&Tile, f64) + Sync),
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        let (sender, receiver) = channel::bounded(0);
        thread::scope(|scope| {
            scope.spawn(move || {
                for &tile in tiles {
                    let loaded = pool.install(|| {
                        load(self.spill, self.plan, tile, self.quantization, self.options)
                    });
                    if cancel.load(Ordering::Relaxed) || sender.send(loaded).is_err() {
                        return;
                    }
                }
            });
            for loaded in receiver {
                let start = Instant::now();
                let loaded = loaded?;
                let tile = loaded.tile;
                let (result, mut figures) = pool.install(|| {
                    let watch = |share| watch(&tile, share);
                    solve_tile(self.spill, loaded, self.options, self.transfer, &watch)
                })?;
                figures.seconds = start.elapsed().as_secs_f64();
                solved.add(tile.id, &result, &figures)?;
                watch(&tile, 1.0);
                if cancel.load(Ordering::Relaxed) {
                    break;
                }
            }
            Ok::<(), JobError>(())
        })?;
        match cancel.load(Ordering::Relaxed) {
            true => Err(JobError::Tile(TileError::Cancelled)),
            false => Ok(()),
        }
    }
}
