//! From solved tiles to a complete cloud: stitch, write, views, sort.

use super::{
    cloud_output::{CloudOutput, OrderedCloud, sorting, workspace},
    mesh_ordering::Ordering,
    mesh_tiles::MeshTiles,
    no_points::all_isolated,
    planned_job::PlannedJob,
    stitch::stitch,
    stitchers::Stitchers,
    tile_solver::TileSolver,
    transients::transient_counts,
    views::ResultViews,
    write::{Measured, measure_tiles},
};
use crate::{
    job::{
        context::RunContext,
        directory::{Scratch, SolvedTiles},
        error::JobError,
        numbers::{counted, thousands},
        outcome::{Outcome, ReportedLevels, RunCosts, WrittenCloud},
        progress::{Progress, Unit},
        tile_figures::TileFigures,
    },
    las::{
        CloudHeader, CompleteCloud, CompleteMesh, Format, RecordFormat, SortedRecords,
        help_write_sorted,
    },
    tile::{OneProcess, SettledTiles},
    views::{CloudPair, UniformityMap},
};

/// The files of an output, complete but not yet under their names.
pub(crate) struct CompleteOutput {
    pub(crate) cloud: CompleteCloud,
    /// The mesh, if it is one file.
    pub(crate) mesh: Option<CompleteMesh>,
}

/// Stitches the `solved` tiles and writes the cloud, and its mesh if there is one, complete but not yet under their
/// names. A mesh in `tiles` is the next level there. If other processes help, they are `shared` with them.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn complete_output(
    run: &RunContext<'_>,
    planned: &PlannedJob,
    solved: &SolvedTiles,
    format: Format,
    tiles_of_mesh: Option<&mut MeshTiles>,
    shared: Option<&dyn Stitchers>,
) -> Result<(Outcome, CompleteOutput), JobError> {
    let (job, solver) = (run.job, &planned.solver);
    let plan = &solver.plan.plan;
    let notes_on_points = planned.notes_on_points();
    let note = |note: &String| run.progress.note(note);
    notes_on_points.iter().for_each(note);
    let scratch = Scratch::choose(
        job.scratch.as_deref(),
        planned.directory.path(),
        planned.settled_bytes(job.sorted_copies()),
        run.progress,
    )?;
    let alone = OneProcess {
        directory: scratch.path().to_owned(),
        cancel: run.cancel,
    };
    let stitchers = shared.unwrap_or(&alone);

    // Stitch: settle the position of every site.
    let settled = settle(run, solver, solved, stitchers)?;
    let tiles: Vec<TileFigures> = (plan.tiles.iter())
        .map(|tile| solved.figures(tile.id))
        .collect::<Result<_, JobError>>()?;
    let isolated = tiles.iter().flat_map(|tile| &tile.isolated);
    if tiles.iter().all(|tile| tile.sites == 0) {
        return Err(all_isolated(isolated.count() as u64, solver.plan.spacing));
    }
    let cloud = cloud_pair(solver, &settled);
    let mut map = UniformityMap::of_input(&solver.spill);
    isolated.for_each(|&place| map.push_isolated(place));
    // The square of the viewer lies in the tile of most sites.
    let largest = tiles.iter().max_by_key(|tile| tile.sites);
    let largest = largest.map_or(0, |figures| figures.tile.id);
    let mut seen = cloud.viewer_square(largest)?;

    // Measure the distances between the points, and write or sort the records.
    let output = CloudOutput::new(run, planned, format, &alone);
    let mut way = Way::begin(run, planned, &scratch, &output)?;
    let mut write = |tile| way.push(run, &settled, tile);
    run.progress
        .begin("write", plan.tiles.len() as u64, 0, Unit::Tiles);
    let colors = colors_of(solver, format);
    let measured = measure_tiles(
        run,
        &cloud,
        colors,
        &mut map,
        stitchers.workforce(),
        &mut write,
    )?;
    let Measured {
        stitched,
        delta_by_tile,
        brightest,
        ..
    } = measured;
    run.progress.end();

    // Complete the file, and the mesh if there is one.
    let (complete, mesh_figures, mesh) = match way {
        Way::ByPosition => {
            let sorted = sort(run, solver, &settled, stitchers)?;
            run.clock.end_stage("write");
            let workforce = match format.is_made_by_many() {
                true => stitchers.workforce(),
                false => alone.workforce(),
            };
            let seen = seen.square.as_ref();
            let complete = output.write_sorted(sorted, brightest, seen, workforce)?;
            (complete, None, None)
        }
        Way::InOrder(ordered) => {
            run.clock.end_stage("write");
            let seen = seen.square.as_ref();
            (output.complete(ordered, brightest, seen)?, None, None)
        }
        Way::ByMesh(ordering) => {
            run.clock.end_stage("write");
            let source = ordering.complete(run, planned, &scratch)?;
            let mut ordered = output.begin()?;
            let write = &mut |records: &[u8]| ordered.write(records);
            let (figures, mesh) = source.write(scratch.path(), write, tiles_of_mesh, &mut seen)?;
            let seen = seen.square.as_ref();
            let complete = output.complete(ordered, brightest, seen)?;
            (complete, Some(figures), mesh)
        }
    };

    // Make the views for the report.
    let levels = complete.levels();
    let views = ResultViews::new(&cloud, map, complete.points(), largest, &seen, levels)?;
    // Reports and scripts know the stage by this name.
    run.clock.end_stage("look");

    // Check conservation: every site is a point of the output.
    let sites: u64 = tiles.iter().map(|tile| tile.sites).sum();
    check_conservation(sites, complete.points())?;

    // Collect what the report says.
    let missed = missed_count(solver, complete.points());
    missed.iter().for_each(note);
    let notes = planned.survey.notes.iter().cloned();
    let notes = notes.chain(notes_on_points).chain(missed);
    let outcome = Outcome {
        plan: solver.plan.clone(),
        inputs: planned.inputs.clone(),
        tiles,
        stitched,
        written: WrittenCloud {
            points: complete.points(),
            bytes: complete.bytes(),
            delta_by_tile: delta_by_tile
                .into_iter()
                .map(|delta| delta.unwrap_or(f64::NAN))
                .collect(),
            levels: complete.levels().map(ReportedLevels::of),
        },
        mesh: mesh_figures,
        mesh_levels: Vec::new(),
        views,
        costs: RunCosts::default(),
        isolated: run.job.settings.solver.isolated,
        transients: transient_counts(&run.job.dir),
        notes: notes.collect(),
    };
    let cloud = complete;
    Ok((outcome, CompleteOutput { cloud, mesh }))
}

/// Does parts of the work of [`complete_output`], which another process completes.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn help_with_output(
    run: &RunContext<'_>,
    solver: &TileSolver,
    solved: &SolvedTiles,
    format: Format,
    header: &CloudHeader,
    stitchers: &dyn Stitchers,
) -> Result<(), JobError> {
    let plan = &solver.plan.plan;
    let settled = settle(run, solver, solved, stitchers)?;
    let cloud = cloud_pair(solver, &settled);
    let mut map = UniformityMap::of_input(&solver.spill);
    run.progress
        .begin("write", plan.tiles.len() as u64, 0, Unit::Tiles);
    measure_tiles(
        run,
        &cloud,
        colors_of(solver, format),
        &mut map,
        stitchers.workforce(),
        &mut |_| Ok(()),
    )?;
    run.progress.end();
    if run.job.mesh.is_some() || !run.job.is_sorted() {
        return Ok(());
    }
    let sorted = sort(run, solver, &settled, stitchers)?;
    run.progress.begin("sort", sorted.points(), 0, Unit::Points);
    let (memory, workforce) = (solver.plan.budget, stitchers.workforce());
    let spacing = solver.options.finest_spacing();
    let workspace = workspace(run, spacing, memory, stitchers, workforce);
    let helped = help_write_sorted(format, header, &workspace, &*sorted);
    run.check_cancelled()?;
    helped.map_err(JobError::of_store)?;
    run.progress.end();
    Ok(())
}

/// The format of records in which the largest value of a colour is to be found for the output, if it is.
fn colors_of(solver: &TileSolver, format: Format) -> Option<&RecordFormat> {
    (format.is_pcd()).then(|| solver.transfer.record())
}

/// The way of the records from the settled tiles to the file.
enum Way<'a> {
    /// In the order of the tiles.
    InOrder(OrderedCloud),
    /// In the order of the mesh.
    ByMesh(Ordering<'a>),
    /// Sorted by position when all tiles are measured.
    ByPosition,
}

impl<'a> Way<'a> {
    fn begin(
        run: &'a RunContext<'_>,
        planned: &PlannedJob,
        scratch: &Scratch,
        output: &CloudOutput<'_>,
    ) -> Result<Self, JobError> {
        Ok(match Ordering::begin(run, planned, scratch)? {
            Some(ordering) => Self::ByMesh(ordering),
            None if run.job.is_sorted() => Self::ByPosition,
            None => Self::InOrder(output.begin()?),
        })
    }

    /// Adds the records of a `settled` tile.
    fn push(
        &mut self,
        run: &RunContext<'_>,
        settled: &SettledTiles,
        tile: u32,
    ) -> Result<(), JobError> {
        match self {
            Self::InOrder(ordered) => ordered.write(&settled.records(tile)?),
            Self::ByMesh(ordering) => ordering.push(run, &settled.records(tile)?),
            Self::ByPosition => Ok(()),
        }
    }
}

/// Share of the number that was asked for by which an output may miss it, if it need not be met exactly.
const LARGEST_MISS: f64 = 0.003;

/// The note on an output of so many `points` that misses the number that was asked for.
fn missed_count(solver: &TileSolver, points: u64) -> Option<String> {
    let wanted = solver.wanted?;
    let (name, allowed) = match wanted.is_exact {
        true => ("--exact: ", 0.0),
        false => ("", LARGEST_MISS * wanted.sites as f64),
    };
    (points.abs_diff(wanted.sites) as f64 > allowed).then(|| {
        format!(
            "{name}{} instead of {}: there are not enough places where points could come or leave",
            counted(points, "point"),
            thousands(wanted.sites)
        )
    })
}

/// Settles the position of every site, and reports the stage.
fn settle(
    run: &RunContext<'_>,
    solver: &TileSolver,
    solved: &SolvedTiles,
    stitchers: &dyn Stitchers,
) -> Result<SettledTiles, JobError> {
    let tiles = solver.plan.plan.tiles.len() as u64;
    run.progress.begin("stitch", tiles, 0, Unit::Tiles);
    let settled = stitch(run, solver, solved, stitchers.workforce())?;
    run.progress.end();
    run.clock.end_stage("stitch");
    run.check_cancelled()?;
    Ok(settled)
}

/// Sorts the records of the `settled` tiles by position.
fn sort(
    run: &RunContext<'_>,
    solver: &TileSolver,
    settled: &SettledTiles,
    stitchers: &dyn Stitchers,
) -> Result<Box<dyn SortedRecords>, JobError> {
    let tiles = &solver.plan.plan.tiles;
    let mut read = |tile: usize| Ok(settled.records(tiles[tile].id)?);
    stitchers.sort(&sorting(run, solver), tiles.len(), &mut read)
}

fn check_conservation(sites: u64, points: u64) -> Result<(), JobError> {
    match points == sites {
        true => Ok(()),
        false => Err(JobError::Refused(format!(
            "{sites} points were solved and {points} written; please report this"
        ))),
    }
}

/// The scattered input and the settled output, for measurements and views.
fn cloud_pair<'a>(solver: &'a TileSolver, settled: &'a SettledTiles) -> CloudPair<'a> {
    let record = solver.transfer.record();
    CloudPair {
        plan: &solver.plan.plan,
        spill: &solver.spill,
        settled,
        record_length: record.record_length(),
        has_color: record.has_color(),
        sites_per_point: solver.options.seeds_per_point,
        quantization: &solver.plan.quantization,
        spacing: solver.options.spacing,
        spacing_at_points: solver.transfer.spacing(),
    }
}
