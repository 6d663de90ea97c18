//! The parts in which a cloud is measured: tiles that fit the memory budget.

use crate::{
    job::{
        JobError,
        resources::{Budget, mebibytes},
    },
    tile::Spill,
    tiling::{Plan, PlanOptions},
};

/// The number of points in a part, at most.
const MEASURED_PART_POINTS: u64 = 500_000;
/// Bytes of memory per point of a part. Nearly all points are seeds.
const BYTES_PER_MEASURED_POINT: f64 = 1200.0;

/// Divides the cloud in `spill` into parts that fit `budget`, each with the points within `halo`
/// (stored units) of its core.
///
/// # Errors
///
/// [`JobError::Resources`] if the points of one counting square and its halo do not fit.
pub(super) fn parts(spill: &Spill, budget: &Budget, halo: i64) -> Result<Plan, JobError> {
    let options = PlanOptions {
        halo,
        margin: 0,
        tile_edge: None,
        most_cost: MEASURED_PART_POINTS.min(budget.points(BYTES_PER_MEASURED_POINT)),
    };
    let plan = Plan::by_points(spill.squares(), spill.grid().square(), &options);
    let needed = budget.needed(plan.most_cost() as f64 * BYTES_PER_MEASURED_POINT);
    if needed > budget.total {
        return Err(JobError::Resources(format!(
            "--memory {} is too little: the densest place contains {} points; give at least {}",
            mebibytes(budget.total),
            plan.most_cost(),
            mebibytes(needed)
        )));
    }
    Ok(plan)
}
