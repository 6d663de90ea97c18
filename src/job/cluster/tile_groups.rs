//! The tiles of one job solved by several processes, in groups of nearly equal cost, the heaviest
//! group first.

use std::{path::Path, sync::atomic::AtomicBool};

use super::{
    claims::GROUP_LIMIT,
    group_files::{STARTS, TILES, block_files, group_files},
    handover::Handover,
    worker::Worker,
};
use crate::{
    job::{
        context::RunContext,
        directory::{SolvedTiles, StartedTiles},
        error::JobError,
        progress::{Progress, Unit},
        resources::mebibytes,
        stages::{
            plan::JobPlan,
            solve::{corrected_count, finish_tiles, solve_tiles, start_tiles},
            tile_solver::TileSolver,
        },
    },
    lloyd::CountCorrection,
    tiling::{Plan, Tile},
};

/// Divides the tiles of `plan` into groups of nearly equal cost, the heaviest group first.
pub(super) fn groups(plan: &Plan) -> Vec<Vec<Tile>> {
    let mut tiles = plan.tiles.clone();
    tiles.sort_by_key(|tile| (std::cmp::Reverse(tile.cost), tile.id));
    let count = tiles.len().min(GROUP_LIMIT);
    let mut groups: Vec<(u64, Vec<Tile>)> = vec![(0, Vec::new()); count];
    for tile in tiles {
        // The costliest tile that is left is added to the group that costs least.
        if let Some((cost, group)) = groups.iter_mut().min_by_key(|(cost, _)| *cost) {
            *cost += tile.cost;
            group.push(tile);
        }
    }
    groups.sort_by_key(|(cost, group)| (std::cmp::Reverse(*cost), group[0].id));
    groups.into_iter().map(|(_, tiles)| tiles).collect()
}

impl Worker {
    /// Solves tiles of the job in `dir` that no other process solves, until there are none left.
    ///
    /// # Errors
    ///
    /// See [`JobError`]; [`JobError::Refused`] if groups of tiles were given up.
    pub(crate) fn solve(
        &self,
        dir: &Path,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        let handover = Handover::read(dir)?;
        let (job, solver) = (&handover.job, handover.solver()?);
        let plan = &solver.plan;
        let groups = groups(&plan.plan);
        RunContext::with(job, self.threads, progress, cancel, |run| {
            let progress = run.progress;
            let after = match plan.has_two_rounds {
                true => Some(self.start(run, dir, &solver, &groups)?),
                false => None,
            };
            let solved = SolvedTiles::of(block_files(&TILES, dir)?);
            let tiles = &plan.plan.tiles;
            let done = tiles.iter().filter(|tile| solved.contains(tile.id)).count();
            progress.begin("solve", tiles.len() as u64, done as u64, Unit::Tiles);
            let watch = counting(progress);
            let given_up = self.share(&TILES, dir, groups.len(), cancel, |claim, earlier| {
                // Tiles that earlier attempts have completed are not solved again.
                let mut solved = SolvedTiles::of(group_files(claim, earlier)?);
                let mut missing = groups[claim.group].clone();
                missing.retain(|tile| !solved.contains(tile.id));
                match &after {
                    Some(after) => finish_tiles(run, &solver, &missing, after, &mut solved, &watch),
                    None => solve_tiles(run, &solver, &missing, &mut solved, &watch),
                }?;
                claim.complete().map(|()| true)
            })?;
            self.check_given_up(&given_up, &groups, plan)?;
            progress.end();
            Ok(())
        })
    }

    /// Does the first of two rounds for tiles that no other process begins, and waits until all tiles have done it.
    /// Returns them, and the correction of their count.
    fn start(
        &self,
        run: &RunContext<'_>,
        dir: &Path,
        solver: &TileSolver,
        groups: &[Vec<Tile>],
    ) -> Result<(StartedTiles, CountCorrection), JobError> {
        let (progress, tiles) = (run.progress, &solver.plan.plan.tiles);
        let started = || {
            let files = block_files(&STARTS, dir)?;
            Ok::<_, JobError>(StartedTiles::of(files, solver.edge_of_pieces()))
        };
        let before = started()?;
        let done = tiles.iter().filter(|tile| before.contains(tile.id)).count();
        progress.begin("start", tiles.len() as u64, done as u64, Unit::Tiles);
        let watch = counting(progress);
        // No tile can go on before all have done the round.
        let worker = Self {
            waits_for_others: true,
            ..*self
        };
        let count = groups.len();
        let given_up = worker.share(&STARTS, dir, count, run.cancel, |claim, earlier| {
            let files = group_files(claim, earlier)?;
            let mut started = StartedTiles::of(files, solver.edge_of_pieces());
            let mut missing = groups[claim.group].clone();
            missing.retain(|tile| !started.contains(tile.id));
            start_tiles(run, solver, &missing, &mut started, &watch)?;
            claim.complete().map(|()| true)
        })?;
        self.check_given_up(&given_up, groups, &solver.plan)?;
        progress.end();
        let started = started()?;
        let correction = corrected_count(run, solver, &started)?;
        Ok((started, correction))
    }

    /// Fails if groups of tiles were `given_up`.
    fn check_given_up(
        &self,
        given_up: &[usize],
        groups: &[Vec<Tile>],
        plan: &JobPlan,
    ) -> Result<(), JobError> {
        if given_up.is_empty() {
            return Ok(());
        }
        let tiles = given_up.iter().flat_map(|&group| &groups[group]);
        let tiles: Vec<u32> = tiles.map(|tile| tile.id).collect();
        Err(self.given_up(&tiles, plan))
    }

    /// The error that reports `tiles` over which too many processes have died.
    fn given_up(&self, tiles: &[u32], plan: &JobPlan) -> JobError {
        JobError::Refused(format!(
            "tiles {tiles:?}: {} processes died while they solved them, or their machines did. \
             These tiles take up to {} each, with one process to a machine; make that much memory \
             available, and give --attempts {} to try them again",
            self.retry_limit,
            mebibytes(plan.memory),
            self.retry_limit + 1,
        ))
    }
}

/// Counts tiles that are on the disk.
fn counting(progress: &dyn Progress) -> impl Fn(&Tile, f64) + Sync + '_ {
    move |_, share| {
        if share >= 1.0 {
            progress.advance(1);
        }
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
    fn groups_have_nearly_equal_cost_and_contain_every_tile_once() {
        let costs: Vec<u64> = (0..2000).map(|k| 1000 + k * k % 777).collect();
        let groups = groups(&plan(&costs));
        assert_eq!(groups.len(), GROUP_LIMIT);
        let cost = |group: &Vec<Tile>| group.iter().map(|tile| tile.cost).sum::<u64>();
        let of_groups: Vec<u64> = groups.iter().map(cost).collect();
        assert!(of_groups.is_sorted_by(|a, b| a >= b));
        assert!(
            of_groups[GROUP_LIMIT - 1] * 10 > of_groups[0] * 8,
            "{of_groups:?}"
        );
        let mut ids: Vec<u32> = groups.iter().flatten().map(|tile| tile.id).collect();
        ids.sort_unstable();
        assert_eq!(ids, (0..2000).collect::<Vec<u32>>());
    }
}
