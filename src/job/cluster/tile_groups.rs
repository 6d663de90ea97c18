//! The tiles of one job solved by several processes, in groups of nearly equal cost, the heaviest
//! group first.

use std::{path::Path, sync::atomic::AtomicBool};

use super::{
    claims::GROUP_LIMIT,
    group_files::{TILES, block_files, block_files_of},
    handover::Handover,
    worker::Worker,
};
use crate::{
    job::{
        context::RunContext,
        directory::SolvedTiles,
        error::JobError,
        progress::{Progress, Unit},
        resources::mebibytes,
        stages::{
            plan::JobPlan, scan_groups::open_spill, solve::solve_tiles, tile_solver::TileSolver,
        },
    },
    tile::BlockFile,
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
        let Handover { job, record, plan } = Handover::read(dir)?;
        let solver = TileSolver::new(open_spill(dir)?, plan, &record, &job.settings);
        let plan = &solver.plan;
        let groups = groups(&plan.plan);
        RunContext::with(&job, self.threads, progress, cancel, |run| {
            let progress = run.progress;
            let (tiles, solved) = (&plan.plan.tiles, SolvedTiles::of(block_files(dir)?));
            let done = tiles.iter().filter(|tile| solved.contains(tile.id)).count();
            progress.begin("solve", tiles.len() as u64, done as u64, Unit::Tiles);
            let watch = |_: &Tile, share: f64| {
                if share >= 1.0 {
                    progress.advance(1);
                }
            };
            let given_up = self.share(&TILES, dir, groups.len(), cancel, |claim, earlier| {
                // Tiles that earlier attempts have completed are not solved again.
                let mut files = block_files_of(earlier)?;
                files.push(BlockFile::open(&claim.path())?);
                let mut solved = SolvedTiles::of(files);
                let mut missing = groups[claim.group].clone();
                missing.retain(|tile| !solved.contains(tile.id));
                solve_tiles(run, &solver, &missing, &mut solved, &watch)?;
                claim.complete().map(|()| true)
            })?;
            if given_up.is_empty() {
                progress.end();
                return Ok(());
            }
            let tiles = given_up.iter().flat_map(|&group| &groups[group]);
            let tiles: Vec<u32> = tiles.map(|tile| tile.id).collect();
            Err(self.given_up(&tiles, plan))
        })
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
