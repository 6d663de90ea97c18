//! Coarser levels of a mesh in tiles, for viewers that see it from afar.
//!
//! ```text
//!   level 2   ┌───────────────┐     Each level is the mesh of a cloud with twice the spacing, made from
//!   level 1   ├───────┬───────┤     the points of the level below as any cloud is made from a scan; its
//!   level 0   ├───┬───┼───┬───┤     tiles are twice as wide. The last level has one tile.
//!             └───┴───┴───┴───┘
//! ```

use std::{fs, path::Path};

use super::{
    complete::{CompletedJob, complete_job},
    context::RunContext,
    description::JobDescription,
    error::JobError,
    outcome::MeshLevel,
    progress::{Progress, Quiet, Unit},
    stages::mesh_tiles::MeshTiles,
};
use crate::{
    config::{
        AttributeSettings, Computed, InputSettings, MeshSettings, ResourceSettings, Settings,
        TilingSettings,
    },
    las::{Format, PcdOptions, PointOrder, TileFormat},
    spacing::Target,
};

/// There is no coarser level of fewer points.
const LEAST_POINTS: u64 = 1000;
/// A coarser level has a quarter of the points, the next one a quarter of these, and so on: all levels are
/// made from 4/3 of the points.
const POINTS_OF_ALL_LEVELS: f64 = 4.0 / 3.0;

/// Adds to `tiles`, which have the finest level of the mesh of the `finest` cloud, all coarser levels, and returns them.
///
/// # Errors
///
/// See [`JobError`].
pub(super) fn add_coarser_levels(
    run: &RunContext<'_>,
    finest: &CompletedJob,
    tiles: &mut MeshTiles,
) -> Result<Vec<MeshLevel>, JobError> {
    let directory = finest.planned.directory.for_levels()?;
    let solver = &finest.planned.solver;
    // What the finest level holds in memory stays there.
    let budget = run.budget;
    let memory = budget.total.saturating_sub(solver.spill.resident_bytes());
    let memory = memory.max(budget.least());
    let mesh = finest.planned.mesh_settings(&run.job.settings);
    let mut cloud = finest.output.cloud.part().to_owned();
    let (mut points, mut spacing) = (finest.output.cloud.points(), solver.options.spacing);
    let all_points = (POINTS_OF_ALL_LEVELS * points as f64) as u64;
    run.progress.begin("levels", all_points, 0, Unit::Points);
    let mut levels = Vec::new();
    while tiles.tiles_of_coarsest() > 1 && points >= LEAST_POINTS {
        spacing *= 2.0;
        let output = directory.join(format!("level{}.las", tiles.levels()));
        let job = level_job(run.job, &mesh, &cloud, &output, spacing, memory);
        let completed = RunContext::with(&job, budget.threads, &Quiet, run.cancel, |run| {
            complete_job(run, Format::Las, Some(tiles), None)
        })?;
        let Some(CompletedJob {
            planned,
            outcome,
            output: files,
        }) = completed
        else {
            let problem = "a level of the mesh was complete before it began; please report this";
            return Err(JobError::Refused(problem.into()));
        };
        run.progress.advance(points);
        points = files.cloud.points();
        levels.push(MeshLevel {
            spacing,
            points,
            triangles: outcome.mesh.map_or(0, |figures| figures.triangles),
            tiles: tiles.tiles_of_coarsest() as u64,
        });
        files.cloud.deliver()?;
        planned.directory.clear();
        if cloud.starts_with(&directory) {
            fs::remove_file(&cloud).map_err(|e| JobError::io("remove", &cloud, e))?;
        }
        cloud = output;
    }
    fs::remove_dir_all(&directory).map_err(|e| JobError::io("remove", &directory, e))?;
    run.progress.end();
    run.clock.end_stage("levels");
    Ok(levels)
}

/// The job that makes a level of the `mesh` of `job` with this `spacing` (CRS units) from the `cloud` below, within so
/// many bytes of `memory`. Its points go to `output`.
fn level_job(
    job: &JobDescription,
    mesh: &MeshSettings,
    cloud: &Path,
    output: &Path,
    spacing: f64,
    memory: u64,
) -> JobDescription {
    let settings = &job.settings;
    JobDescription {
        destination: None,
        inputs: vec![cloud.to_owned()],
        output: output.to_owned(),
        // The tiles of a level are written to those of the other levels.
        mesh: job.mesh.clone(),
        dir: output.with_extension("job"),
        scratch: job.scratch.clone(),
        settings: Settings {
            target: Target::Spacing(spacing),
            density: None,
            exact: false,
            resources: ResourceSettings {
                memory: Some(memory),
                ..settings.resources
            },
            solver: settings.solver,
            tiling: TilingSettings::default(),
            // The cloud has no other points than those that take part.
            input: InputSettings::default(),
            attributes: AttributeSettings {
                with: vec![Computed::Normals],
                ..AttributeSettings::default()
            },
            output_tiles: None,
            tile_format: TileFormat::default(),
            order: PointOrder::default(),
            pcd: PcdOptions::default(),
            mesh: Some(mesh.clone()),
        },
        overwrite: true,
        keep: false,
        skip_bad_files: false,
        restart: true,
    }
}
