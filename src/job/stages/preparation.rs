//! Everything that precedes the solving of tiles: survey, scatter, spacing, plan.

use std::{
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
};

use super::{
    checksums::checksums,
    density::spacing_rules,
    input_counts::input_counts,
    no_points::no_points,
    pcd_precision::note_on_pcd,
    plan::{JobPlan, plan_tiles},
    planned_job::PlannedJob,
    scatter::{SpillReaders, scatter_readable},
    scattered_cloud::ScatteredCloud,
    spacing::choose_spacing,
    survey::Survey,
    tile_solver::TileSolver,
    transfer::Transfer,
};
use crate::job::{
    cluster::Worker,
    context::RunContext,
    directory::{InputStamps, JobDirectory, check_room},
    error::JobError,
    progress::Progress,
    resources::mebibytes,
};
use crate::{
    config::ConfigError,
    lloyd::Thinning,
    spacing::{Target, dominant_normals},
    tile::Spill,
};

/// Brings the job to the point where its tiles can be solved, from where earlier runs stopped.
/// Returns `None` if an earlier run has delivered the output. If several processes have begun to
/// scatter the job, this one joins them as `worker`. `readers` will read the scattered points.
///
/// # Errors
///
/// See [`JobError`]. An error that the same job would meet again removes the files of this run.
pub(crate) fn prepare(
    run: &RunContext<'_>,
    worker: &Worker,
    readers: SpillReaders,
) -> Result<Option<PlannedJob>, JobError> {
    let job = run.job;

    // Read the headers, and lock the job directory.
    let (survey, inputs) = survey_inputs(run)?;
    let directory = JobDirectory::open(&job.dir, job.identity(&inputs), job.restart)?;

    // End here if the output is complete, or must not be replaced.
    if directory.has_delivered(&job.output) {
        job.upload(run.cancel)?;
        if !job.keep {
            directory.clear();
        }
        return Ok(None);
    }
    if let Err(error) = job.check_free() {
        directory.abandon();
        return Err(error);
    }
    if job.destination.is_some() {
        directory.for_upload()?;
    }
    run.clock.end_stage("survey");

    // Scatter and plan.
    match scatter_and_plan(run, &directory, survey, &inputs, worker, readers) {
        Ok((survey, checksums, solver)) => Ok(Some(PlannedJob {
            inputs: input_counts(&survey, &solver.spill),
            directory,
            survey,
            checksums,
            solver,
        })),
        Err(error) => {
            if !error.is_resumable() {
                // The next try, with other inputs or settings, is another job.
                directory.abandon();
            }
            Err(error)
        }
    }
}

/// Scatters the groups of scans that no other process scatters, as `worker` among several, without
/// locking the job directory.
///
/// # Errors
///
/// See [`JobError`].
pub(crate) fn join_scatter(run: &RunContext<'_>, worker: &Worker) -> Result<(), JobError> {
    let job = run.job;
    job.format()?;
    let (survey, inputs) = survey_inputs(run)?;
    if !JobDirectory::join(&job.dir, job.identity(&inputs), &job.output)? {
        return Ok(());
    }
    job.check_free()?;
    let scatter = super::scatter::Scatter {
        run,
        survey: &survey,
        readers: SpillReaders::Others,
    };
    check_room(&[scatter.disk_need()])?;
    scatter.share(worker)?;
    inputs.check()
}

/// Reads the headers of the inputs, and their stamps as they are now.
fn survey_inputs(run: &RunContext<'_>) -> Result<(Survey, InputStamps), JobError> {
    let (job, budget) = (run.job, run.budget);
    if budget.total < budget.least() {
        let problem = format!(
            "--memory {} is too little for any job; give at least {}",
            mebibytes(budget.total),
            mebibytes(budget.least())
        );
        return Err(match job.settings.resources.memory {
            Some(_) => ConfigError::Words(problem).into(),
            None => JobError::Resources(problem),
        });
    }
    let mut survey = Survey::of(&job.inputs, &job.settings, job.skip_bad_files)?;
    survey.notes.extend(note_on_pcd(job, &survey));
    let paths = survey.inputs.iter().map(|input| input.path.as_path());
    job.check_inputs_stay(paths)?;
    for note in &survey.notes {
        run.progress.note(note);
    }
    let left_out = survey.left_out.iter().map(|bad| PathBuf::from(&bad.path));
    let inputs = InputStamps::of(survey.inputs.iter(), left_out);
    Ok((survey, inputs))
}

/// Scatters the points, chooses the spacing, and plans the tiles. Returns the survey without the
/// inputs that turned out to be damaged, the checksums of the inputs, and the solver of the tiles.
fn scatter_and_plan(
    run: &RunContext<'_>,
    directory: &JobDirectory,
    survey: Survey,
    inputs: &InputStamps,
    worker: &Worker,
    readers: SpillReaders,
) -> Result<(Survey, Vec<Option<String>>, TileSolver), JobError> {
    let settings = &run.job.settings;

    // Scatter every point to the spill of its cell. Rules that no record can follow are refused before.
    let rules = spacing_rules(settings, &survey.record, &survey.quantization)?;
    let (survey, mut spill) = scatter_readable(run, directory, survey, worker, readers)?;
    run.clock.end_stage("scatter");
    if spill.points() == 0 {
        return Err(no_points(&survey, &spill));
    }

    // Choose spacing and tiles while the inputs are named by their checksums. Without a plan none is needed.
    spill.set_rules(rules);
    let has_failed = AtomicBool::new(false);
    let is_stopped = || has_failed.load(Ordering::Relaxed) || run.cancel.load(Ordering::Relaxed);
    let (plan, checksums) = rayon::join(
        || {
            let plan = choose_plan(run, directory, &survey, &mut spill, readers);
            has_failed.store(plan.is_err(), Ordering::Relaxed);
            plan
        },
        || checksums(&survey, directory, &is_stopped),
    );
    let plan = plan?;
    run.clock.end_stage("plan");
    run.check_cancelled()?;

    // Check that the inputs are still those of the survey.
    inputs.check()?;
    let solver = TileSolver::new(spill, plan, &survey.record, settings);
    Ok((survey, checksums?, solver))
}

/// Chooses the spacing for the points in `spill`, and plans the tiles.
fn choose_plan(
    run: &RunContext<'_>,
    directory: &JobDirectory,
    survey: &Survey,
    spill: &mut Spill,
    readers: SpillReaders,
) -> Result<JobPlan, JobError> {
    let settings = &run.job.settings;

    // Choose one spacing for the whole cloud, the coarsest one if it varies.
    let cloud = ScatteredCloud {
        run,
        directory,
        survey,
        spill,
    };
    let (spacing, points_out) = choose_spacing(&cloud)?;
    let sites_per_point = points_out as f64 / spill.points() as f64;
    let mut options = settings.solver.at(spacing, sites_per_point);

    // Points in memory that no tile will use make room. With a known spacing they did as they came.
    let transfer = Transfer::new(&survey.record, settings);
    let is_thinned = matches!(settings.target, Target::Spacing(_));
    let is_graded = options.grading.is_some();
    if !is_thinned && !is_graded && !transfer.needs_cells() {
        spill.thin(&Thinning::new(&survey.quantization, &options));
    }

    // Find the directions that many of its planes face.
    options.dominant_normals = dominant_normals(&*spill, &survey.quantization, &options)?;

    // Cut the plane into tiles that fit the memory.
    let cloud = ScatteredCloud {
        run,
        directory,
        survey,
        spill,
    };
    plan_tiles(&cloud, &options, points_out, readers)
}
