//! From inputs to complete files, not yet under their names: the order of the stages.

use super::{
    cluster::{SharedStitch, Worker, files_of_others},
    context::RunContext,
    error::JobError,
    outcome::Outcome,
    stages::{
        mesh_tiles::MeshTiles,
        output::{CompleteOutput, complete_output},
        plan::JobPlan,
        planned_job::PlannedJob,
        preparation::prepare,
        scatter::SpillReaders,
        solve::solve_missing,
        stitchers::Stitchers,
    },
};
use crate::las::Format;

/// Approximate share of the first of two rounds in the time of solving.
const SHARE_OF_FIRST_ROUND: f64 = 0.55;
/// Expected seconds of the stages after the tiles are solved, per million points of the output.
const STITCH_SECONDS_PER_MILLION: f64 = 0.2;
const WRITE_SECONDS_PER_MILLION: f64 = 0.5;
const SORT_SECONDS_PER_MILLION: f64 = 0.7;
/// Expected seconds of the mesh, per million points of the output.
const MESH_SECONDS_PER_MILLION: f64 = 4.0;
/// Expected seconds of the coarser levels of a mesh, per million points of the output.
const LEVELS_SECONDS_PER_MILLION: f64 = 20.0;
/// Expected seconds of the views of the result.
const VIEW_SECONDS: f64 = 0.2;

/// A job of which everything is done except that its files have their names.
pub(super) struct CompletedJob {
    pub(super) planned: PlannedJob,
    pub(super) outcome: Outcome,
    pub(super) output: CompleteOutput,
}

/// Does everything of a job that earlier runs have not done, except that its files get their names. If the mesh is
/// written as `tiles`, they are the next level there. Other processes may help to stitch a job that `shared` works on. Returns `None` if an earlier run had delivered the output.
///
/// # Errors
///
/// See [`JobError`].
pub(super) fn complete_job(
    run: &RunContext<'_>,
    format: Format,
    tiles: Option<&mut MeshTiles>,
    shared: Option<&Worker>,
) -> Result<Option<CompletedJob>, JobError> {
    // Survey the headers, scatter the points, choose the spacing, plan the tiles.
    let worker = Worker::until_all_is_done(run.budget.threads);
    let readers = SpillReaders::ThisProcess;
    let Some(planned) = run.pool.install(|| prepare(run, &worker, readers))? else {
        return Ok(None);
    };
    run.progress
        .expect(&seconds_ahead(run, &planned.solver.plan));

    // Solve the tiles that no earlier run has solved.
    let others = files_of_others(planned.directory.path())?;
    let solved = solve_missing(run, &planned, others)?;
    run.clock.end_stage("solve");

    // Stitch the tiles and write the cloud and its mesh, aside.
    let dir = planned.directory.path();
    let shared = shared.map(|&worker| SharedStitch::new(worker, dir, run.cancel, true));
    let shared = shared.as_ref().map(|shared| shared as &dyn Stitchers);
    let complete = || complete_output(run, &planned, &solved, format, tiles, shared);
    let (outcome, output) = run.pool.install(complete)?;
    Ok(Some(CompletedJob {
        planned,
        outcome,
        output,
    }))
}

/// The stages from the solving of tiles on, with the expected seconds of each.
fn seconds_ahead(run: &RunContext<'_>, plan: &JobPlan) -> [(&'static str, f64); 7] {
    let million = 1e-6 * plan.points_out as f64;
    let sort = match run.job.is_sorted() {
        true => SORT_SECONDS_PER_MILLION,
        false => 0.0,
    };
    let mesh = match run.job.mesh {
        Some(_) => MESH_SECONDS_PER_MILLION * million,
        None => 0.0,
    };
    let levels = match run.job.mesh_tile_edge() {
        Some(_) => LEVELS_SECONDS_PER_MILLION * million,
        None => 0.0,
    };
    let to_start = match plan.has_two_rounds {
        true => SHARE_OF_FIRST_ROUND * plan.seconds_to_solve,
        false => 0.0,
    };
    [
        ("start", to_start),
        ("solve", plan.seconds_to_solve - to_start),
        ("stitch", STITCH_SECONDS_PER_MILLION * million),
        ("write", WRITE_SECONDS_PER_MILLION * million),
        ("mesh", mesh),
        ("sort", VIEW_SECONDS + sort * million),
        ("levels", levels),
    ]
}
