//! The plane is cut into tiles that fit the memory, to be solved in one round or in two.

use serde::{Deserialize, Serialize};

use super::{scatter::SpillReaders, scattered_cloud::ScatteredCloud, tile_costs::costed_squares};
use crate::{
    job::{directory::PLAN_FILE, error::JobError, progress::Progress, resources::mebibytes},
    lloyd::{SolverOptions, candidate_band},
    tiling::{Plan, PlanOptions, Square, Tile},
};

/// The tiles of a job, as they are kept in its directory.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct CutTiles {
    #[serde(flatten)]
    pub(super) plan: Plan,
    /// Whether all tiles do a part of the iterations before any tile does the rest.
    #[serde(default)]
    pub(super) has_two_rounds: bool,
}

/// Work of a tile in two rounds over its work in one, if it sees the same: its points are read
/// twice, and the states of its sites are written and read.
const WORK_OF_TWO_ROUNDS: f64 = 1.25;

/// Cuts the plane into tiles, or reads the tiles of an earlier run. Tiles that were solved under
/// another plan would not fit together, so the first plan of a job stays as long as it fits the
/// budget of this run.
///
/// # Errors
///
/// [`JobError::Resources`] if the memory is too little, [`JobError::Tile`] if points cannot be read
/// from the spill.
pub(super) fn cut_tiles(
    cloud: &ScatteredCloud<'_>,
    options: &SolverOptions,
    points_out: u64,
    readers: SpillReaders,
) -> Result<CutTiles, JobError> {
    let run = cloud.run;
    let found = cloud.directory.read::<CutTiles>(PLAN_FILE);
    let is_new = found.is_none();
    // Several tiles meet a count between rounds.
    let has_count = run.job.settings.wanted_count(points_out).is_some();
    // Between rounds all processes wait for the last.
    let has_rounds = options.acceleration.has_rounds();
    let may_have_rounds = has_count || (readers == SpillReaders::ThisProcess && has_rounds);
    let fits = |found: &CutTiles| {
        let has_all = !has_count || found.has_two_rounds || found.plan.tiles.len() <= 1;
        found.plan.most_cost() <= cloud.budget().tile()
            && (may_have_rounds || !found.has_two_rounds)
            && has_all
    };
    if let Some(found) = found.filter(fits) {
        return Ok(found);
    }
    let squares = costed_squares(cloud, options, points_out)?;
    let halo = run.job.settings.tiling.halo;
    let in_one = cut(cloud, &squares, options, halo.unwrap_or(options.halo()));
    let is_one = in_one.as_ref().is_ok_and(|plan| plan.tiles.len() <= 1);
    let cut = if is_one || !may_have_rounds || (halo.is_some() && !has_count) {
        in_one.map(CutTiles::in_one_round)
    } else {
        let [mut first, last] = options.two_rounds().map(|round| round.halo(options));
        if has_count {
            first += candidate_band(options);
        }
        let halo = halo.unwrap_or(first.max(last));
        let in_two = cut(cloud, &squares, options, halo);
        match has_count {
            true => in_two.map(CutTiles::in_two_rounds),
            false => cheaper(in_one, in_two),
        }
    };
    let cut = cut.map_err(|tile| too_little_memory(cloud, &tile))?;
    if !is_new {
        run.progress
            .note("the tiles of an earlier run do not fit this one's memory: all are solved anew");
    }
    cloud.directory.forget_tiles();
    cloud.directory.write(PLAN_FILE, &cut)?;
    Ok(cut)
}

impl CutTiles {
    fn in_one_round(plan: Plan) -> Self {
        Self {
            plan,
            has_two_rounds: false,
        }
    }

    fn in_two_rounds(plan: Plan) -> Self {
        Self {
            plan,
            has_two_rounds: true,
        }
    }
}

/// The plan with less work, of those that fit; or the tile that fits neither.
fn cheaper(in_one: Result<Plan, Tile>, in_two: Result<Plan, Tile>) -> Result<CutTiles, Tile> {
    let work = |plan: &Plan| plan.tiles.iter().map(|tile| tile.cost as f64).sum::<f64>();
    match (in_one, in_two) {
        (Ok(one), Ok(two)) if work(&one) <= WORK_OF_TWO_ROUNDS * work(&two) => {
            Ok(CutTiles::in_one_round(one))
        }
        (Ok(one), Err(_)) => Ok(CutTiles::in_one_round(one)),
        (_, two) => two.map(CutTiles::in_two_rounds),
    }
}

/// Cuts the plane into tiles with a halo of the width `halo` (CRS units); the error is a tile that
/// does not fit the memory.
fn cut(
    cloud: &ScatteredCloud<'_>,
    squares: &[Square],
    options: &SolverOptions,
    halo: f64,
) -> Result<Plan, Tile> {
    let (quantization, most_cost) = (cloud.quantization(), cloud.budget().tile());
    let tile_size = cloud.run.job.settings.tiling.tile_size;
    let square = cloud.spill.grid().square();
    let plan_options = PlanOptions {
        halo: quantization.units(halo),
        margin: quantization.units(options.farthest_seed()),
        tile_edge: tile_size.map(|edge| quantization.units(edge)),
        most_cost,
    };
    let check = |costliest: Option<&Tile>| match costliest.filter(|tile| tile.cost > most_cost) {
        Some(tile) => Err(*tile),
        None => Ok(()),
    };
    if tile_size.is_none() {
        check(Plan::costliest_place(squares, square, &plan_options).as_ref())?;
    }
    let plan = Plan::make(squares, square, &plan_options);
    check(plan.tiles.iter().max_by_key(|tile| tile.cost))?;
    Ok(plan)
}

/// The error of a job whose memory is too little for `tile`.
fn too_little_memory(cloud: &ScatteredCloud<'_>, tile: &Tile) -> JobError {
    let budget = cloud.budget();
    let scattered = cloud.spill.bytes() + cloud.spill.resident_bytes();
    let (total, needed) = (
        budget.total,
        budget.needed_beside(tile.cost as f64, scattered),
    );
    let points = tile.points_seen;
    JobError::Resources(match cloud.run.job.settings.tiling.tile_size {
        Some(_) => format!(
            "--tile-size makes a tile of {points} points, which takes about {}, and --memory is \
             {}; give smaller tiles or more memory",
            mebibytes(needed),
            mebibytes(total)
        ),
        None => format!(
            "--memory {} is too little: the densest place holds {points} points with what a tile \
             sees around it; give at least {}",
            mebibytes(total),
            mebibytes(needed)
        ),
    })
}
