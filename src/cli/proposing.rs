//! A density for jobs that are asked for none, and the densities beside that of a plan.

use std::{path::Path, sync::atomic::AtomicBool};

use serde::Serialize;

use super::scans::{Scans, length_unit};
use crate::{
    config::{Choices, Length},
    job::{JobDescription, JobError, JobPlan, Progress},
    report::{counted, thousands},
    spacing::{RoundSpacing, RoundSpacings, Target},
};

/// The spacing of a scan without points, for which nothing can be proposed. The job says why there are none.
const ANY_SPACING: f64 = 1.0;

/// A job whose density is chosen.
pub(super) struct ChosenJob {
    /// The job.
    pub(super) job: JobDescription,
    /// What round spacings give, if they were counted to propose one.
    spacings: Option<RoundSpacings>,
}

/// What a job would take, and what other spacings would give.
#[derive(Serialize)]
pub(super) struct PlannedSpacings {
    /// The plan of the job.
    #[serde(flatten)]
    pub(super) plan: JobPlan,
    /// Round spacings near that of the plan, finest first.
    pub(super) spacings: Vec<RoundSpacing>,
}

/// Returns the job of `scans` that writes `output`. If no density is asked for, a spacing is proposed from the points of
/// the scans, and `progress` is told which and why: the job is the same as if it were asked for.
///
/// # Errors
///
/// See [`JobError`].
pub(super) fn chosen_job(
    scans: &Scans,
    output: Option<&Path>,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Result<ChosenJob, JobError> {
    chosen_by(scans.choices()?, scans, output, progress, cancel)
}

/// Returns the job of `scans` that is only planned: nothing is written, so that an output which exists already is no matter unless
/// it was named. Otherwise as [`chosen_job`].
///
/// # Errors
///
/// See [`JobError`].
pub(super) fn chosen_plan(
    scans: &Scans,
    output: Option<&Path>,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Result<ChosenJob, JobError> {
    let mut choices = scans.choices()?;
    choices.overwrite |= output.is_none();
    chosen_by(choices, scans, output, progress, cancel)
}

/// Returns the job of `scans` that writes `output` by `choices`, as [`chosen_job`].
fn chosen_by(
    mut choices: Choices,
    scans: &Scans,
    output: Option<&Path>,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Result<ChosenJob, JobError> {
    let named = scans.output(output);
    if choices.has_density() {
        let job = scans.job_of(&choices, &named)?;
        return Ok(ChosenJob {
            job,
            spacings: None,
        });
    }

    // What can be refused at once is refused before the scans are read.
    choices.spacing = Some(Length::plain(ANY_SPACING));
    let mut job = scans.job_of(&choices, &named)?;
    job.check_output()?;
    if !job.dir.exists() {
        job.check_free()?;
    }

    // Choose a spacing, and say so.
    let spacings = job.round_spacings(progress, cancel)?;
    if let Some(proposed) = spacings.proposed() {
        job.settings.target = Target::Spacing(proposed.spacing);
        progress.note(&reason(&spacings, proposed, length_unit(&job)));
    }
    if output.is_none() {
        let name = named.display();
        progress.note(&format!("the output is {name}; -o gives it another name"));
    }
    Ok(ChosenJob {
        job,
        spacings: Some(spacings),
    })
}

/// Says which spacing was `proposed`, why, and how to ask for another one.
fn reason(spacings: &RoundSpacings, proposed: RoundSpacing, unit: &str) -> String {
    let RoundSpacing {
        spacing,
        points_out,
    } = proposed;
    let to_one = spacings.points as f64 / points_out.max(1) as f64;
    let wanted = spacings.points_to_one_wanted();
    let rule = match to_one >= wanted {
        true => format!("the finest round one that leaves {wanted:.0} or more points to one"),
        false => "the widest round one, because the scan has so few points".to_owned(),
    };
    format!(
        "spacing {spacing} {unit}, proposed because none was given: {rule} (about {} out of {}, {to_one:.0} to \
         one); --spacing, --count or --ratio ask for another, `lloydar plan` lists some",
        counted(points_out, "point"),
        thousands(spacings.points),
    )
}

impl ChosenJob {
    /// Plans the job, and lists round spacings beside its own if it is one everywhere; `None` if the output is complete already.
    ///
    /// # Errors
    ///
    /// See [`JobError`].
    pub(super) fn plan(
        self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<Option<PlannedSpacings>, JobError> {
        let Some(plan) = self.job.plan(progress, cancel)? else {
            return Ok(None);
        };
        let spacings = match self.spacings {
            // What other spacings would give with the rules is not known.
            _ if self.job.settings.density.is_some() => Vec::new(),
            Some(spacings) => spacings.beside(plan.spacing),
            None => self
                .job
                .round_spacings(progress, cancel)?
                .beside(plan.spacing),
        };
        Ok(Some(PlannedSpacings { plan, spacings }))
    }
}
