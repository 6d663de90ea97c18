//! `run` and `plan`: one job by one process.

use std::{
    path::{Path, PathBuf},
    sync::atomic::AtomicBool,
};

use super::{
    exit::{DONE, INCOMPLETE},
    numbers::rounded,
    printing::result,
    proposing::{PlannedSpacings, chosen_job, chosen_plan},
    scans::{Scans, length_unit},
    signals::{CANCEL, stop_on_signals},
    terminal::{Display, Terminal},
};
use crate::{
    job::{InputCount, JobDescription, JobError, Progress, Worker, write_file},
    report::{REPORT_PAGE, Report, VIEWER_PAGE, thousands},
};

/// Does the job of `scans`.
pub(super) fn run_job(scans: &Scans, output: Option<&Path>, restart: bool) -> Result<u8, JobError> {
    stop_on_signals();
    let display = scans.display();
    let chosen = chosen_job(scans, output, &Terminal::new(display), &CANCEL)?;
    let job = JobDescription {
        restart,
        ..chosen.job
    };
    run_and_print(&job, None, display)
}

/// Does `job`, which other processes may help to stitch if it is `shared`, writes its report beside the output, and prints a
/// summary.
pub(super) fn run_and_print(
    job: &JobDescription,
    shared: Option<&Worker>,
    display: Display,
) -> Result<u8, JobError> {
    stop_on_signals();
    let Some(done) = run_and_report(job, &Terminal::new(display), &CANCEL, shared)? else {
        if display != Display::Nothing {
            result!("{} is complete already", job.shown_output().display());
        }
        return Ok(DONE);
    };
    if display != Display::Nothing {
        let mut summary = done.report.summary();
        for (name, path) in ["report", "viewer"].iter().zip(&done.pages) {
            summary += &format!("{name:<9} {path}\n");
        }
        result!("{}", summary.trim_end());
    }
    Ok(match done.is_complete {
        true => DONE,
        false => INCOMPLETE,
    })
}

/// A job that is done.
pub(super) struct Done {
    /// All figures.
    pub(super) report: Report,
    /// The names of the pages that were written beside the output.
    pages: Vec<String>,
    /// Whether every point of every input took part, unless the options exclude it, and a count that is to be met exactly
    /// is met.
    is_complete: bool,
}

/// Does `job` until it is done or `cancel` is set, and writes its report beside the output. If several processes stitch it,
/// `shared` is this one. Returns `None` if an earlier run had delivered the output.
pub(super) fn run_and_report(
    job: &JobDescription,
    progress: &dyn Progress,
    cancel: &AtomicBool,
    shared: Option<&Worker>,
) -> Result<Option<Done>, JobError> {
    let mut done = None;
    let is_complete = |input: &InputCount| input.rejected == 0 && input.left_out.is_none();
    job.run_and_report(progress, cancel, shared, |outcome| {
        let output = job.shown_output().display().to_string();
        let mesh = job.mesh.as_ref().map(|path| path.display().to_string());
        let report = Report::new(
            outcome,
            &output,
            mesh.as_deref(),
            settings(job),
            length_unit(job),
        );
        done = Some(Done {
            pages: write_report(job, &report)?,
            report,
            is_complete: outcome.inputs.iter().all(is_complete)
                && outcome.meets_count(job.settings.exact),
        });
        Ok(())
    })?;
    Ok(done)
}

/// Returns the job's settings: names, and values as JSON.
fn settings(job: &JobDescription) -> Vec<(String, String)> {
    let settings = serde_json::to_value(&job.settings).unwrap_or_default();
    let settings = settings.as_object().into_iter().flatten();
    settings
        .map(|(name, value)| (name.clone(), value.to_string()))
        .collect()
}

/// Returns `path` with `ending` after its name.
pub(super) fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.to_owned().into_os_string();
    name.push(ending);
    name.into()
}

/// The ending that the name of an output gets for its figures in JSON.
pub(super) const REPORT_FIGURES: &str = ".report.json";

/// Writes the report and the viewer beside the output, each complete or not at all. Returns
/// the names of the pages.
fn write_report(job: &JobDescription, report: &Report) -> Result<Vec<String>, JobError> {
    let write = |ending: &str, text: &str| {
        let path = with_ending(&job.output, ending);
        write_file(&path, text.as_bytes())?;
        Ok::<String, JobError>(
            with_ending(&job.shown_output(), ending)
                .display()
                .to_string(),
        )
    };
    write(REPORT_FIGURES, &report.to_json())?;
    let mut pages = vec![write(REPORT_PAGE, &report.to_html())?];
    if let Some(viewer) = report.to_viewer() {
        pages.push(write(VIEWER_PAGE, &viewer)?);
    }
    Ok(pages)
}

/// Prints what the job of `scans` would take.
pub(super) fn plan_job(scans: &Scans, output: Option<&Path>, json: bool) -> Result<u8, JobError> {
    let terminal = Terminal::new(scans.display());
    let chosen = chosen_plan(scans, output, &terminal, &CANCEL)?;
    let unit = length_unit(&chosen.job);
    match chosen.plan(&terminal, &CANCEL)? {
        None => result!("{} is complete already", scans.output(output).display()),
        Some(planned) if json => result!(
            "{}",
            serde_json::to_string_pretty(&planned).unwrap_or_default()
        ),
        Some(planned) => print_plan(&planned, unit),
    }
    Ok(DONE)
}

/// Prints a plan whose lengths are in `unit`.
fn print_plan(planned: &PlannedSpacings, unit: &str) {
    let plan = &planned.plan;
    let mebibytes = |bytes: u64| format!("{} MiB", thousands(bytes >> 20));
    let length = |length: f64| format!("{} {unit}", rounded(length, plan.quantization.scale));
    let tiles = thousands(plan.plan.tiles.len() as u64);
    let to_one = |points_out: u64| plan.points as f64 / points_out.max(1) as f64;
    let out = |points_out: u64| {
        let points = thousands(points_out);
        format!("approx. {points}, {:.0} to one", to_one(points_out))
    };
    let rows = [
        ("points in", thousands(plan.points)),
        ("points out", out(plan.points_out)),
        ("spacing", format!("{:.4} {unit}", plan.spacing)),
        (
            "tiles",
            match plan.has_two_rounds {
                true => format!("{tiles}, in two rounds"),
                false => tiles,
            },
        ),
        ("halo", length(plan.halo)),
        (
            "peak memory",
            format!("{} of {}", mebibytes(plan.memory), mebibytes(plan.budget)),
        ),
        ("temporary disk", mebibytes(plan.temporary)),
        ("time", format!("approx. {:.0} s", plan.seconds)),
    ];
    for (name, value) in rows {
        result!("{name:<16} {value}");
    }
    for (index, other) in planned.spacings.iter().enumerate() {
        let name = if index == 0 { "other spacings" } else { "" };
        let spacing = format!("{} {unit}:", other.spacing);
        result!("{name:<16} {spacing:<12} {}", out(other.points_out));
    }
}
