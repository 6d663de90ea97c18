//! From solved tiles to a complete cloud: stitch, write, views, sort.

use std::sync::Arc;

use super::{
    mesh_ordering::Ordering, mesh_tiles::MeshTiles, no_points::all_isolated,
    planned_job::PlannedJob, provenance::provenance, stitch::stitch, tile_solver::TileSolver,
    views::ResultViews, write::write_tiles,
};
use crate::{
    geometry::Rect,
    job::{
        context::RunContext,
        directory::{Scratch, SolvedTiles},
        error::JobError,
        outcome::{Outcome, ReportedLevels, RunCosts, WrittenCloud},
        progress::{Progress, Unit},
        tile_figures::TileFigures,
    },
    las::{CloudHeader, CloudWriter, CompleteCloud, CompleteMesh, Format, Workspace},
    tile::{SeamTally, SettledTiles, SpillSpace},
    views::{CloudPair, UniformityMap},
};

/// The files of an output, complete but not yet under their names.
pub(crate) struct CompleteOutput {
    pub(crate) cloud: CompleteCloud,
    /// The mesh, if it is one file.
    pub(crate) mesh: Option<CompleteMesh>,
}

/// Stitches the `solved` tiles and writes the cloud, and its mesh if there is one, complete but not yet under their
/// names. A mesh in `tiles` is the next level there.
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
) -> Result<(Outcome, CompleteOutput), JobError> {
    let (job, solver) = (run.job, &planned.solver);
    let plan = &solver.plan.plan;
    let notes_on_points = planned.notes_on_points();
    let note = |note: &String| run.progress.note(note);
    notes_on_points.iter().for_each(note);

    // Stitch: settle the position of every site.
    let tile_count = plan.tiles.len() as u64;
    run.progress.begin("stitch", tile_count, 0, Unit::Tiles);
    let scratch = Scratch::choose(
        job.scratch.as_deref(),
        planned.directory.path(),
        planned.settled_bytes(job.sorted_copies()),
        run.progress,
    )?;
    let mut settled = SettledTiles::create(scratch.path())?;
    let seams = settle(run, solver, solved, &mut settled)?;

    // Write the records, and measure the distances between the points as written.
    let tiles: Vec<TileFigures> = (plan.tiles.iter())
        .map(|tile| solved.figures(tile.id))
        .collect::<Result<_, JobError>>()?;
    let isolated = tiles.iter().flat_map(|tile| &tile.isolated);
    if tiles.iter().all(|tile| tile.sites == 0) {
        return Err(all_isolated(isolated.count() as u64, solver.plan.spacing));
    }
    let cloud = cloud_pair(planned, &settled);
    let mut map = UniformityMap::of_input(&solver.spill);
    isolated.for_each(|&place| map.push_isolated(place));
    run.progress.begin("write", tile_count, 0, Unit::Tiles);
    let mut writer = create_writer(run, planned, format, &scratch)?;
    let mut ordering = Ordering::begin(run, planned, &scratch)?;
    let mut write = |records: &[u8]| match &mut ordering {
        Some(ordering) => ordering.push(run, records),
        None => Ok(writer.write(records)?),
    };
    let (stitched, delta_by_tile) = write_tiles(&cloud, seams, &mut map, &mut write, run.progress)?;
    run.progress.end();
    run.clock.end_stage("write");

    // Choose the square of the viewer, in the tile of most sites.
    let largest = tiles.iter().max_by_key(|tile| tile.sites);
    let largest = largest.map_or(0, |figures| figures.tile.id);
    let mut seen = cloud.viewer_square(largest)?;

    // Find the triangles, and write the records in the order of the mesh.
    let mesh = match ordering {
        Some(ordering) => Some(ordering.complete(run, planned, &scratch)?),
        None => None,
    };
    let mesh = mesh.map(|mesh| mesh.write(scratch.path(), &mut writer, tiles_of_mesh, &mut seen));
    let (mesh_figures, mesh) = mesh.transpose()?.unzip();
    let mesh = mesh.flatten();

    // Sort the points, if the format or the order asks for it, and complete the file.
    let complete = sort(run, writer, seen.square.as_ref())?;

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
            delta_by_tile,
            levels: complete.levels().map(ReportedLevels::of),
        },
        mesh: mesh_figures,
        mesh_levels: Vec::new(),
        views,
        costs: RunCosts::default(),
        isolated: run.job.settings.solver.isolated,
        notes: notes.collect(),
    };
    let cloud = complete;
    Ok((outcome, CompleteOutput { cloud, mesh }))
}

/// The note on an output of so many `points` that misses the number that is to be met exactly.
fn missed_count(solver: &TileSolver, points: u64) -> Option<String> {
    let wanted = solver.wanted.filter(|wanted| wanted.is_exact)?;
    (points != wanted.sites).then(|| {
        format!(
            "--exact: {points} points instead of {}: there are not enough places where points could come or leave",
            wanted.sites
        )
    })
}

/// Settles the position of every site, and reports the end of the stage.
fn settle(
    run: &RunContext<'_>,
    solver: &TileSolver,
    solved: &SolvedTiles,
    settled: &mut SettledTiles,
) -> Result<SeamTally, JobError> {
    let seams = stitch(solver, solved, settled, run.progress)?;
    run.progress.end();
    run.clock.end_stage("stitch");
    run.check_cancelled()?;
    Ok(seams)
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
fn cloud_pair<'a>(planned: &'a PlannedJob, settled: &'a SettledTiles) -> CloudPair<'a> {
    let solver = &planned.solver;
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

/// Creates the writer of the output, with its temporary files in `scratch`.
fn create_writer(
    run: &RunContext<'_>,
    planned: &PlannedJob,
    format: Format,
    scratch: &Scratch,
) -> Result<CloudWriter, JobError> {
    let (job, survey, solver) = (run.job, &planned.survey, &planned.solver);
    let header = CloudHeader {
        record: solver.transfer.record().clone(),
        quantization: solver.plan.quantization,
        crs: survey.crs.clone(),
        carried_records: survey.carried_records(),
        has_standard_time: survey.has_standard_time,
        provenance: provenance(&job.settings, planned),
    };
    let workspace = Workspace {
        spacing: solver.options.spacing,
        tile_edge: job.settings.output_tiles.unwrap_or(0.0),
        order: job.settings.order,
        pcd: job.settings.pcd,
        sorting: Arc::new(SpillSpace {
            directory: scratch.path().to_owned(),
            buffer_bytes: run.budget.buffers(),
        }),
        sort_bytes: run.budget.tile() as usize / 2,
    };
    Ok(CloudWriter::create(
        &job.output,
        format,
        &header,
        Some(&workspace),
    )?)
}

/// Completes the file of `writer`, and reports the stage if that sorts the points. If the cloud has levels, those of the
/// points in `seen` are returned with it.
fn sort(
    run: &RunContext<'_>,
    writer: CloudWriter,
    seen: Option<&Rect>,
) -> Result<CompleteCloud, JobError> {
    let is_sorted = run.job.is_sorted();
    if is_sorted {
        run.progress.begin("sort", writer.points(), 0, Unit::Points);
    }
    let complete = writer.complete(seen, &|points| run.progress.advance(points))?;
    if is_sorted {
        run.progress.end();
        run.clock.end_stage("sort");
    }
    Ok(complete)
}
