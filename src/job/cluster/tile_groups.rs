//! One job's tiles solved by several processes, in groups of about equal cost, heaviest first.

use std::{path::Path, sync::atomic::AtomicBool};

use super::{
    claims::{Claim, Kind, MOST_GROUPS, Worker},
    handover::Handover,
};
use crate::{
    job::{
        JobError, Progress, Unit, memory::mebibytes, queue::Queue, running::threads,
        scattering::scattered, tiles::SolvedTiles, transfer::Transfer,
    },
    tile::{Pack, Plan, Tile, TileError},
};

/// Tiles, each added to the file of its group.
pub(super) const TILES: Kind = Kind {
    stem: "tiles",
    begun: "solved",
    complete: "complete",
};

/// Tiles of about equal cost together, heaviest first.
pub(super) fn groups(plan: &Plan) -> Vec<Vec<Tile>> {
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

/// The tiles that processes have solved which share the job in `dir`.
pub(crate) fn packs(dir: &Path) -> Result<Vec<Pack>, JobError> {
    packs_of(&Claim::all(&TILES, dir)?)
}

/// What is whole by now in the files of `claims`.
pub(super) fn packs_of(claims: &[Claim]) -> Result<Vec<Pack>, JobError> {
    let packs = claims.iter().map(|claim| Pack::of_another(&claim.path()));
    Ok(packs.collect::<Result<_, TileError>>()?)
}

impl Worker {
    /// Solves tiles of the job in `dir` that nobody works on, until there are none.
    ///
    /// # Errors
    ///
    /// See [`JobError`]; [`JobError::Refused`] if there are tiles that were begun too often.
    pub(crate) fn solve(
        &self,
        dir: &Path,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<(), JobError> {
        let Handover { job, record, plan } = Handover::read(dir)?;
        let spill = scattered(dir)?;
        let options = plan.options(&job.settings);
        let transfer = Transfer::new(&record, &job.settings);
        let queue = Queue {
            spill: &spill,
            plan: &plan.plan,
            quantization: plan.quantization,
            options: &options,
            transfer: &transfer,
        };
        let pool = threads(self.threads)?;
        let groups = groups(&plan.plan);
        job.watched(progress, |progress, _| {
            let (tiles, solved) = (&plan.plan.tiles, SolvedTiles::of(packs(dir)?));
            let done = tiles.iter().filter(|tile| solved.contains(tile.id)).count();
            progress.begin("solve", tiles.len() as u64, done as u64, Unit::Tiles);
            let watch = |_: &Tile, share: f64| {
                if share >= 1.0 {
                    progress.advance(1);
                }
            };
            let given_up = self.share(&TILES, dir, groups.len(), cancel, |claim, earlier| {
                let mut packs = packs_of(earlier)?;
                packs.push(Pack::open(&claim.path())?);
                let mut solved = SolvedTiles::of(packs);
                let mut missing = groups[claim.group].clone();
                missing.retain(|tile| !solved.contains(tile.id));
                queue.solve(&missing, &mut solved, &pool, &watch, cancel)?;
                claim.complete().map(|()| true)
            })?;
            if given_up.is_empty() {
                progress.end();
                return Ok(());
            }
            let tiles = given_up.iter().flat_map(|&group| &groups[group]);
            let tiles: Vec<u32> = tiles.map(|tile| tile.id).collect();
            Err(JobError::Refused(format!(
                "tiles {tiles:?}: {} processes died over them, or their machines did. They take up \
                 to {} each, with one process to a machine; see to that, and give --attempts {} to \
                 try them again",
                self.attempts,
                mebibytes(plan.memory),
                self.attempts + 1,
            )))
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
}
