//! The scans of a job with its options, as arguments, and the job that they describe.

use std::path::{Path, PathBuf};

use clap::Args;

use super::{allocator, inputs::Inputs, options::JobOptions, terminal::Display};
use crate::{
    config::{Choices, OnBadFile},
    job::{JobDescription, JobError, Placement, memory_budget},
    las::{Crs, InputFile, PointFilter, ReprojectionTarget, expand_inputs},
};

/// Inputs and options of a job.
#[derive(Args)]
pub(super) struct Scans {
    #[command(flatten)]
    pub(super) inputs: Inputs,
    /// Options from a TOML file; flags win
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    progress: ProgressFlags,
    #[command(flatten)]
    options: JobOptions,
}

/// How progress is shown.
#[derive(Args)]
pub(super) struct ProgressFlags {
    /// Show nothing but errors
    #[arg(short, long)]
    quiet: bool,
    /// `json`: progress as JSON lines on standard error
    #[arg(long, value_name = "FORMAT", value_parser = ["json", "text"], default_value = "text")]
    log: String,
}

impl ProgressFlags {
    pub(super) fn display(&self) -> Display {
        Display::choose(self.quiet, self.log == "json")
    }
}

impl Scans {
    pub(super) fn display(&self) -> Display {
        self.progress.display()
    }

    /// Returns the choices that flags and file make together.
    ///
    /// # Errors
    ///
    /// If the file cannot be used.
    pub(super) fn choices(&self) -> Result<Choices, JobError> {
        Ok(self.options.choices(self.config.as_deref())?)
    }

    /// Returns the name of the output: `given`, or one that follows from the inputs.
    pub(super) fn output(&self, given: Option<&Path>) -> PathBuf {
        given.map_or_else(|| self.inputs.default_output(), Path::to_owned)
    }

    /// Returns the job that writes `output`.
    ///
    /// # Errors
    ///
    /// If the options cannot be used, the list of inputs cannot be read, or no input is found whose unit
    /// could be read where a length has a unit.
    pub(super) fn job(&self, output: &Path) -> Result<JobDescription, JobError> {
        self.job_of(&self.choices()?, output)
    }

    /// Returns the job that writes `output` by `choices`.
    ///
    /// # Errors
    ///
    /// As for [`job`](Self::job).
    pub(super) fn job_of(
        &self,
        choices: &Choices,
        output: &Path,
    ) -> Result<JobDescription, JobError> {
        // Before a list is read from standard input: what starts the program anew could not read it again.
        let memory = choices.memory.map(|bytes| bytes.0);
        allocator::return_freed_memory(memory_budget(memory));
        let inputs = self.inputs.paths()?;
        let metres = match choices.has_units() {
            true => {
                let filter = PointFilter {
                    bounds: choices.bounds.map(|sides| sides.0),
                    ..PointFilter::default()
                };
                metres_per_unit(&inputs, choices.crs()?.as_ref(), choices.reproject, &filter)?
            }
            false => None,
        };
        let placement = Placement::of(output, choices.job.as_deref());
        let job = JobDescription {
            inputs,
            output: placement.output,
            destination: placement.destination,
            mesh: choices.mesh.clone(),
            dir: placement.dir,
            scratch: None,
            settings: choices.settings(metres)?,
            overwrite: choices.overwrite,
            keep: choices.keep_job,
            skip_bad_files: choices.on_bad_file == Some(OnBadFile::Skip),
            restart: false,
        };
        // A name that stands for no format is refused where the output is checked: a plan has none.
        if let Ok(format) = job.format() {
            choices.check_pcd(format.is_pcd())?;
        }
        Ok(job)
    }
}

/// Returns the length in metres of the unit of the CRS to which the inputs are reprojected, or else of `crs`, or
/// else of the CRS of the first input that states one; `None` if that is not known.
///
/// # Errors
///
/// If `inputs` name no file.
fn metres_per_unit(
    inputs: &[PathBuf],
    crs: Option<&Crs>,
    reproject: Option<ReprojectionTarget>,
    filter: &PointFilter,
) -> Result<Option<f64>, JobError> {
    match reproject {
        Some(ReprojectionTarget::Auto) => return Ok(Some(1.0)),
        Some(ReprojectionTarget::Epsg(code)) => {
            let target = Crs::of_epsg(code);
            return Ok(target.and_then(|crs| crs.metres_per_unit()));
        }
        None => {}
    }
    if let Some(crs) = crs {
        return Ok(crs.metres_per_unit());
    }
    // The survey of the job reports the files that cannot be read, all together.
    let files = expand_inputs(inputs, filter)?;
    let stated = files
        .iter()
        .find_map(|path| InputFile::survey(path).ok()?.crs);
    Ok(stated.and_then(|crs| crs.metres_per_unit()))
}

/// Returns the name of the unit in which lengths of `job` are printed: "m", "ft", or "CRS
/// units" if the CRS is not known.
pub(super) fn length_unit(job: &JobDescription) -> &'static str {
    let input = &job.settings.input;
    let metres = metres_per_unit(
        &job.inputs,
        input.crs.as_ref(),
        input.reproject,
        &input.filter,
    );
    unit_name(metres.unwrap_or_default())
}

/// Returns the name of a unit of a CRS by its length in metres.
fn unit_name(metres: Option<f64>) -> &'static str {
    // Headers state the lengths of feet to seven digits and more.
    let is = |unit: f64| metres.is_some_and(|metres| (metres / unit - 1.0).abs() < 1e-7);
    if is(1.0) {
        "m"
    } else if is(0.3048) {
        "ft"
    } else if is(1200.0 / 3937.0) {
        "us-ft"
    } else {
        "CRS units"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_feet_are_told_apart() {
        let names = [1.0, 0.3048, 0.304_800_609_601_219].map(|metres| unit_name(Some(metres)));
        assert_eq!(names, ["m", "ft", "us-ft"]);
        assert_eq!(unit_name(Some(0.9144)), "CRS units");
        assert_eq!(unit_name(None), "CRS units");
    }
}
