//! Plan: the plane is cut into tiles by true counts, so that each tile fits the memory.

use serde::{Deserialize, Serialize};

use super::{
    cut_tiles::{CutTiles, cut_tiles},
    scatter::SpillReaders,
    scattered_cloud::ScatteredCloud,
    transfer::Transfer,
};
use crate::{
    config::Settings,
    geometry::Quantization,
    job::{
        directory::{DiskNeed, bytes_in, check_room, directory_of, is_of_tiles},
        error::JobError,
        numbers::counted,
        progress::Progress,
        resources::{mebibytes, peak_resident, resident},
    },
    lloyd::{DominantNormals, SolverOptions},
    tiling::Plan,
};

/// What a job will do, and what it will take.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct JobPlan {
    /// Points of the input.
    pub(crate) points: u64,
    /// Spacing of the output (CRS units).
    pub(crate) spacing: f64,
    /// Approximate number of points of the output.
    pub(crate) points_out: u64,
    /// The directions that many planes of the scan face.
    #[serde(default)]
    pub(crate) dominant_normals: DominantNormals,
    /// The tiles.
    pub(crate) plan: Plan,
    /// Whether all tiles do a part of the iterations before any tile does the rest.
    #[serde(default)]
    pub(crate) has_two_rounds: bool,
    /// Width of the halo around the core of a tile (CRS units).
    pub(crate) halo: f64,
    /// Expected peak memory in bytes.
    pub(crate) memory: u64,
    /// The memory budget in bytes.
    pub(crate) budget: u64,
    /// Expected bytes of temporary files.
    pub(crate) temporary: u64,
    /// Expected seconds of the job.
    pub(crate) seconds: f64,
    /// Expected seconds of the solving of tiles, which are a part of `seconds`.
    pub(crate) seconds_to_solve: f64,
    /// Scale and offset of the output.
    pub(crate) quantization: Quantization,
}

impl JobPlan {
    /// The options of the solver at the spacing of this plan, by `settings`.
    pub(crate) fn options(&self, settings: &Settings) -> SolverOptions {
        let sites_per_point = self.points_out as f64 / self.points as f64;
        SolverOptions {
            dominant_normals: self.dominant_normals,
            ..settings.solver.at(self.spacing, sites_per_point)
        }
    }
}

/// Seconds in which one core decodes and spills a million points; a rough value for the estimate.
const SCATTER_SECONDS_PER_MILLION: f64 = 0.7;
/// Seconds in which one core moves a million sites once; a rough value for the estimate.
const STEP_SECONDS_PER_MILLION: f64 = 3.2;
/// Solving takes this many times as long where rules vary the spacing, most of it before the first iteration: 9 times on airborne tiles by
/// height, 15 on a terrestrial scan by curvature, 4 on a handheld scan by intensity.
const GRADED_TIMES: f64 = 7.0;
/// Bytes of a site in a band, and of its identity, beside its record.
const SITE_BYTES: u64 = 48;
/// Bytes of the state of a site between two rounds.
const STATE_BYTES: u64 = 700;

/// Plans tiles for approximately `points_out` sites, and estimates what they will take.
///
/// # Errors
///
/// [`JobError::Resources`] if memory or a disk is too small.
pub(super) fn plan_tiles(
    cloud: &ScatteredCloud<'_>,
    options: &SolverOptions,
    points_out: u64,
    readers: SpillReaders,
) -> Result<JobPlan, JobError> {
    let ScatteredCloud { run, spill, .. } = *cloud;

    // Cut the plane, or keep the tiles of an earlier run.
    let CutTiles {
        plan,
        has_two_rounds,
    } = cut_tiles(cloud, options, points_out, readers)?;
    let halo = plan.halo as f64 * cloud.quantization().scale;

    // Check that the results of the tiles have room on the disk. Each record is written as its tile
    // leaves it and again as it is settled, and once more for each time that the output is sorted.
    let transfer = Transfer::new(&cloud.survey.record, &run.job.settings);
    let records = points_out * transfer.record().record_length() as u64;
    let sorted = run.job.sorted_copies() * records;
    let states = match has_two_rounds {
        true => STATE_BYTES * points_out,
        false => 0,
    };
    let solved = 2 * records + sorted + SITE_BYTES * points_out + states;
    check_disks(cloud, solved, records)?;

    // Estimate memory and time.
    // Before there are tiles, decoders and batches may have held more than a tile will.
    let held = peak_resident().unwrap_or(0);
    let costs: Vec<u64> = plan.tiles.iter().map(|tile| tile.cost).collect();
    let budget = cloud.budget();
    let tiles = budget.most_held(&costs) as f64;
    let needed = held.max(budget.held_with(resident().unwrap_or(0), tiles));
    run.progress.note(&format!(
        "{}{}; memory up to {} of {}, temporary files up to {}",
        counted(plan.tiles.len() as u64, "tile"),
        if has_two_rounds { " in two rounds" } else { "" },
        mebibytes(needed),
        mebibytes(run.budget.total),
        mebibytes(spill.bytes() + solved)
    ));
    let (seconds, seconds_to_solve) = expected_seconds(cloud, options, points_out, &plan);
    Ok(JobPlan {
        points: spill.points(),
        spacing: options.spacing,
        points_out,
        dominant_normals: options.dominant_normals,
        halo,
        memory: needed.max(run.budget.least()),
        budget: run.budget.total,
        temporary: spill.bytes() + solved,
        seconds,
        seconds_to_solve,
        plan,
        has_two_rounds,
        quantization: *cloud.quantization(),
    })
}

/// Expected seconds of the job, and of the solving of its tiles.
fn expected_seconds(
    cloud: &ScatteredCloud<'_>,
    options: &SolverOptions,
    points_out: u64,
    plan: &Plan,
) -> (f64, f64) {
    let spill = cloud.spill;
    let points_seen: u64 = plan.tiles.iter().map(|tile| tile.points_seen).sum();
    let overlap = points_seen as f64 / spill.points().max(1) as f64;
    let million = 1e-6 / cloud.run.job.settings.resources.threads as f64;
    let iterations = f64::from(options.iterations);
    let times = match options.grading {
        None => 1.0,
        Some(_) => GRADED_TIMES,
    };
    let moved = points_out as f64 * million * iterations * overlap;
    let to_solve = times * moved * STEP_SECONDS_PER_MILLION;
    let scattered = spill.points() as f64 * million;
    let seconds = scattered * SCATTER_SECONDS_PER_MILLION * (1.0 + overlap) + to_solve;
    (seconds, to_solve)
}

/// Checks that the disks have room for `solved` bytes of solved tiles, and for an output of at most
/// `records` bytes.
fn check_disks(cloud: &ScatteredCloud<'_>, solved: u64, records: u64) -> Result<(), JobError> {
    let (directory, output) = (cloud.directory.path(), &cloud.run.job.output);
    let present = bytes_in(directory, is_of_tiles);
    let is_compressed = output
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("laz"));
    check_room(&[
        DiskNeed {
            what: "solved tiles".to_owned(),
            dir: directory,
            bytes: solved.saturating_sub(present),
        },
        DiskNeed {
            what: "the output".to_owned(),
            dir: &directory_of(output),
            bytes: if is_compressed { records / 2 } else { records },
        },
    ])
}
