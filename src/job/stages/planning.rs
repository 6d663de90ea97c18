//! How dense, and in which tiles: from true counts.

use std::collections::HashMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::job::{
    JobError, Progress, Survey,
    directory::{DiskNeed, JobDirectory, bytes_in, check_room, directory_of},
    gathering::gather_points,
    resources::{Budget, mebibytes, points_for, tile_bytes},
    running::Job,
    spacing::refusal,
    transfer::Transfer,
};
use crate::{
    config::Settings,
    geometry::{Quantization, Rect},
    lloyd::{AREA_PER_SEED, Scan, SolverOptions},
    spacing::resolve,
    tile::{CellKey, Plan, PlanOptions, Spill, Square},
};

/// What would be done.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct JobPlan {
    /// Points of the input.
    pub(crate) points: u64,
    /// Spacing of the output (CRS units).
    pub(crate) spacing: f64,
    /// Points of the output, about.
    pub(crate) points_out: u64,
    /// The tiles.
    pub(crate) plan: Plan,
    /// What a tile sees around its core (CRS units).
    pub(crate) halo: f64,
    /// Peak memory expected, in bytes.
    pub(crate) memory: u64,
    /// The budget, in bytes.
    pub(crate) budget: u64,
    /// Temporary files, in bytes.
    pub(crate) temporary: u64,
    /// Seconds expected, about.
    pub(crate) seconds: f64,
    /// Of those, seconds for the tiles to be solved.
    pub(crate) seconds_to_solve: f64,
    /// Scale and offset of the output.
    pub(crate) quantization: Quantization,
}

impl JobPlan {
    /// How the tiles are solved, as `settings` have it.
    pub(crate) fn options(&self, settings: &Settings) -> SolverOptions {
        settings
            .solver
            .at(self.spacing, self.points_out as f64 / self.points as f64)
    }
}

/// Seconds for a million points to be decoded and spilled, and for a million
/// seeds to be moved once, on one core: rough, for the estimate of a plan.
const SCATTER_SECONDS: f64 = 0.7;
const STEP_SECONDS: f64 = 3.2;
/// A tile may have more seeds to its points than the mean.
const SEEDS_TO_SPARE: f64 = 1.25;
/// Points that are held to see how many of them are kept.
const CROWD: u64 = 1 << 20;
/// Cells of more points are looked into square by square.
const LARGE_CELL: u64 = 4 << 20;

/// A spill whose tiles are to be planned.
pub(crate) struct Planning<'a> {
    pub(crate) job: &'a Job,
    pub(crate) survey: &'a Survey,
    pub(crate) directory: &'a JobDirectory,
    pub(crate) spill: &'a Spill,
    pub(crate) budget: &'a Budget,
}

impl Planning<'_> {
    /// The spacing, and about how many points it gives.
    pub(crate) fn spacing(&self, progress: &dyn Progress) -> Result<(f64, u64), JobError> {
        if let Some(found) = self.directory.read("spacing.json") {
            return Ok(found);
        }
        let (spill, settings) = (self.spill, &self.job.settings);
        let quantization = &self.survey.quantization;
        let found = resolve(spill, quantization, &settings.solver, settings.target);
        let found = found.map_err(refusal)?;
        progress.note(&format!(
            "spacing {:.4}, about {} points out of {}",
            found.0,
            found.1,
            spill.points()
        ));
        self.directory.write("spacing.json", &found)?;
        Ok(found)
    }

    /// Tiles for about `points_out` seeds, and what they will take.
    pub(crate) fn tiles(
        &self,
        options: &SolverOptions,
        points_out: u64,
        progress: &dyn Progress,
    ) -> Result<JobPlan, JobError> {
        let (spill, settings) = (self.spill, &self.job.settings);
        let quantization = self.survey.quantization;
        let halo = settings.halo.unwrap_or_else(|| options.halo());
        let most_cost = self.budget.tile();
        // Tiles solved under another plan would not fit together: the first
        // plan of a job stands, as long as it fits the budget of this run.
        let plan = match self.directory.read::<Plan>("plan.json") {
            Some(found) if found.most_cost() <= most_cost => found,
            found => {
                let plan = Plan::make(
                    &self.squares(options, points_out)?,
                    spill.grid().square(),
                    &PlanOptions {
                        halo: quantization.units(halo),
                        margin: quantization.units(options.farthest_seed()),
                        tile_edge: settings.tile_size.map(|edge| quantization.units(edge)),
                        most_cost,
                    },
                );
                self.check_memory(&plan, halo)?;
                if found.is_some() {
                    progress.note(
                        "the tiles of an earlier run do not fit this one's memory: all are solved \
                         anew",
                    );
                }
                self.directory.forget_tiles();
                self.directory.write("plan.json", &plan)?;
                plan
            }
        };
        let points_seen: u64 = plan.tiles.iter().map(|tile| tile.points_seen).sum();
        let overlap = points_seen as f64 / spill.points().max(1) as f64;
        let million = 1e-6 / settings.threads as f64;
        let seconds_to_solve =
            points_out as f64 * million * STEP_SECONDS * f64::from(options.iterations) * overlap;
        let seconds =
            spill.points() as f64 * million * SCATTER_SECONDS * (1.0 + overlap) + seconds_to_solve;
        let transfer = Transfer::new(&self.survey.record, settings);
        let records = points_out * transfer.record().record_length() as u64;
        // A site twice, as its tile leaves it and as it is settled, and once more if it is
        // sorted; and those of the bands.
        let sorted = match self.job.is_sorted() {
            true => records,
            false => 0,
        };
        let solved = 2 * records + sorted + 48 * points_out;
        self.check_disk(solved, records)?;
        let needed = self.budget.needed(plan.most_cost() as f64);
        progress.note(&format!(
            "{} tiles; memory up to {} of {}, temporary files up to {}",
            plan.tiles.len(),
            mebibytes(needed),
            mebibytes(self.budget.total),
            mebibytes(spill.bytes() + solved)
        ));
        Ok(JobPlan {
            points: spill.points(),
            spacing: options.spacing,
            points_out,
            halo,
            memory: needed.max(self.budget.least()),
            budget: self.budget.total,
            temporary: spill.bytes() + solved,
            seconds,
            seconds_to_solve,
            plan,
            quantization,
        })
    }

    fn check_memory(&self, plan: &Plan, halo: f64) -> Result<(), JobError> {
        let costly = plan.tiles.iter().max_by_key(|tile| tile.cost);
        let Some(tile) = costly.filter(|tile| tile.cost > self.budget.tile()) else {
            return Ok(());
        };
        let (total, needed) = (self.budget.total, self.budget.needed(tile.cost as f64));
        let points = tile.points_seen;
        Err(JobError::Refused(match self.job.settings.tile_size {
            Some(_) => format!(
                "--tile-size makes a tile of {points} points, which takes about {}, and --memory is \
                 {}; give smaller tiles or more memory",
                mebibytes(needed),
                mebibytes(total)
            ),
            None => format!(
                "--memory {} is too little: the densest place holds {points} points within a halo of \
                 {halo:.3}; give at least {}",
                mebibytes(total),
                mebibytes(needed)
            ),
        }))
    }

    /// Refuses what has no room for `solved` bytes of solved tiles, and an output of
    /// `records` bytes at the most.
    fn check_disk(&self, solved: u64, records: u64) -> Result<(), JobError> {
        let present = bytes_in(self.directory.path(), |name| name.starts_with("tiles"));
        let is_compressed = self
            .job
            .output
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("laz"));
        check_room(&[
            DiskNeed {
                what: "solved tiles".to_owned(),
                dir: self.directory.path(),
                bytes: solved.saturating_sub(present),
            },
            DiskNeed {
                what: "the output".to_owned(),
                dir: &directory_of(&self.job.output),
                bytes: if is_compressed { records / 2 } else { records },
            },
        ])
    }

    /// The occupied counting squares, with the memory that a tile takes for each.
    fn squares(&self, options: &SolverOptions, points_out: u64) -> Result<Vec<Square>, JobError> {
        let squares = self.squares_with(&HashMap::new(), options, points_out);
        // If one tile has room for all as they are, it does not matter how many are kept.
        if squares.iter().map(|square| square.cost).sum::<u64>() <= self.budget.tile() {
            return Ok(squares);
        }
        let kept = self.kept(options)?;
        Ok(self.squares_with(&kept, options, points_out))
    }

    /// The same, where of the points of some squares so many are `kept`.
    fn squares_with(
        &self,
        kept: &HashMap<[i64; 2], u64>,
        options: &SolverOptions,
        points_out: u64,
    ) -> Vec<Square> {
        let spill = self.spill;
        let edge = spill.grid().square() as f64 * self.survey.quantization.scale;
        let mean = SEEDS_TO_SPARE * points_out as f64 / spill.points() as f64;
        // Where the scan is sparse it has more seeds to the point, up to one for each,
        // or more where holes are filled; but no more than there is room for.
        let room = (edge / options.spacing).powi(2) / AREA_PER_SEED;
        let sparse = |points: f64| room.min(points * f64::max(1.0, 2.0 * mean));
        let all_sparse: f64 = spill
            .squares()
            .map(|(_, points)| sparse(points as f64))
            .sum();
        // What stands upright has seeds above each other.
        let layers = SEEDS_TO_SPARE * points_out as f64 / all_sparse;
        spill
            .squares()
            .map(|(place, points)| {
                let held = kept.get(&place).map_or(points, |&kept| kept.min(points));
                // Each is right where the other is not; a tile has of both kinds.
                let seeds = 0.5 * (points as f64 * mean + layers * sparse(points as f64));
                Square {
                    place,
                    points,
                    cost: tile_bytes(held as f64, seeds).ceil() as u64,
                }
            })
            .collect()
    }

    /// Of squares that hold more points than a scan of a plane keeps: how many it does keep.
    fn kept(&self, options: &SolverOptions) -> Result<HashMap<[i64; 2], u64>, JobError> {
        let (spill, quantization) = (self.spill, &self.survey.quantization);
        let edge = spill.grid().square() as f64 * quantization.scale;
        let most = Scan::most_on_square(edge, quantization, options);
        let mut crowded: Vec<([i64; 2], CellKey)> = Vec::new();
        let mut of_cell: HashMap<CellKey, u64> = HashMap::new();
        let grid = spill.grid();
        for (place, points) in spill.squares() {
            let cell = grid.cell_of_square(place);
            *of_cell.entry(cell).or_default() += points;
            if points as f64 > most {
                crowded.push((place, cell));
            }
        }
        let mut looked_into: Vec<_> = crowded
            .into_iter()
            .map(|(place, cell)| match of_cell[&cell] > LARGE_CELL {
                true => grid.rect_of_square(place),
                false => grid.rect(cell),
            })
            .collect();
        looked_into.sort_unstable_by_key(|rect| rect.min);
        looked_into.dedup();
        // Together they hold what one alone may.
        let threads = self.job.settings.threads;
        let crowd = CROWD.min(points_for(self.budget.tile())) / threads as u64;
        let kept_in = |rect: &Rect| -> Result<HashMap<[i64; 2], u64>, JobError> {
            let points = gather_points(spill, rect, quantization, options, crowd)?;
            let mut kept = HashMap::new();
            for point in Scan::thinned(points, quantization, options) {
                *kept.entry(grid.square_of(point)).or_default() += 1;
            }
            Ok(kept)
        };
        let mut kept = HashMap::new();
        // Given all at once, a thread that waits for a part of one would begin another.
        for few in looked_into.chunks(threads) {
            let parts: Vec<_> = few.par_iter().map(kept_in).collect::<Result<_, _>>()?;
            kept.extend(parts.into_iter().flatten());
        }
        Ok(kept)
    }
}
