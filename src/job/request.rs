//! The request for a job, as a program makes it: a builder with a method for each setting.

use std::{path::PathBuf, sync::atomic::AtomicBool, thread};

use super::{
    description::JobDescription,
    error::JobError,
    outcome::Outcome,
    placement::Placement,
    progress::{Progress, Quiet},
};
use crate::{
    config::{
        AttributeSettings, Computed, ConfigError, InputSettings, MeshSettings, ResourceSettings,
        Settings, TilingSettings,
    },
    las::{PcdOptions, PointOrder, TileFormat},
    resample::{Options, ResampleError},
};

/// A job that resamples scans larger than memory: LAS, LAZ, COPC or PLY files in, one even cloud out.
///
/// A job begins with inputs and an output, and needs a density: [`spacing`](Self::spacing),
/// [`count`](Self::count), [`ratio`](Self::ratio), or [`options`](Self::options) for every option of
/// [`resample`](crate::resample). Lengths are in the unit of the inputs' CRS. Values are
/// checked when the job runs.
///
/// ```no_run
/// use lloydar::Job;
///
/// let outcome = Job::new(["scans/*.laz"], "even.copc.laz")
///     .spacing(0.05)
///     .memory(4 << 30)
///     .run()?;
/// println!("{} points", outcome.map_or(0, |outcome| outcome.points()));
/// # Ok::<(), lloydar::JobError>(())
/// ```
///
/// A job that is stopped or killed leaves its work in the [job directory](Self::job_directory), and the same
/// job continues from there.
#[derive(Clone, Debug)]
#[must_use]
pub struct Job {
    inputs: Vec<PathBuf>,
    output: PathBuf,
    mesh: Option<PathBuf>,
    options: Option<Options>,
    memory: Option<u64>,
    threads: Option<usize>,
    directory: Option<PathBuf>,
    overwrites: bool,
    restarts: bool,
}

/// The largest number of worker threads.
const MAX_THREADS: usize = 1024;

impl Job {
    /// A job from `inputs` to `output`. Inputs are files, directories and patterns such as
    /// `scans/*.laz`. The ending of the output decides its format: `.copc.laz`, `.laz`, `.las`, `.ply` or
    /// `.pcd`.
    pub fn new<P: Into<PathBuf>>(
        inputs: impl IntoIterator<Item = P>,
        output: impl Into<PathBuf>,
    ) -> Self {
        Self {
            inputs: inputs.into_iter().map(Into::into).collect(),
            output: output.into(),
            mesh: None,
            options: None,
            memory: None,
            threads: None,
            directory: None,
            overwrites: false,
            restarts: false,
        }
    }

    /// Sets the distance between neighbouring points of the output (CRS units). Replaces
    /// [`options`](Self::options), as do [`count`](Self::count) and [`ratio`](Self::ratio).
    pub fn spacing(self, spacing: f64) -> Self {
        self.options(Options::with_spacing(spacing))
    }

    /// Sets the approximate number of points of the output.
    pub fn count(self, count: u64) -> Self {
        self.options(Options::with_count(count))
    }

    /// Sets the approximate number of output points per input point.
    pub fn ratio(self, ratio: f64) -> Self {
        self.options(Options::with_ratio(ratio))
    }

    /// Sets the density of the output and how the cloud is solved. The [scale](Options::scale) of the
    /// options is not used: a job has the smallest scale of its inputs, or a smaller one if the spacing
    /// requires it.
    pub fn options(mut self, options: Options) -> Self {
        self.options = Some(options);
        self
    }

    /// Writes a mesh of the output, too. The ending of its name decides its format: `.ply`, `.obj` or `.glb`. The
    /// cloud has normals then, on the side of their triangles.
    pub fn mesh(mut self, path: impl Into<PathBuf>) -> Self {
        self.mesh = Some(path.into());
        self
    }

    /// Sets the peak memory in bytes; three quarters of what the machine or its cgroup allows by default.
    pub fn memory(mut self, bytes: u64) -> Self {
        self.memory = Some(bytes);
        self
    }

    /// Sets the number of worker threads, at most 1024; one per core by default.
    pub fn threads(mut self, threads: usize) -> Self {
        self.threads = Some(threads);
        self
    }

    /// Sets the directory for temporary files; `OUTPUT.job` beside the output by default. It must be
    /// empty, missing, or of the same job, which continues then.
    pub fn job_directory(mut self, directory: impl Into<PathBuf>) -> Self {
        self.directory = Some(directory.into());
        self
    }

    /// Sets whether an existing output is replaced; by default it is an error.
    pub fn overwrite(mut self, overwrites: bool) -> Self {
        self.overwrites = overwrites;
        self
    }

    /// Sets whether the files of an earlier run are removed first; by default the job continues from them.
    pub fn restart(mut self, restarts: bool) -> Self {
        self.restarts = restarts;
        self
    }

    /// Runs the job in silence, and continues from what an earlier run of the same job completed. Returns
    /// `None` if an earlier run had written the output, and was stopped while it removed its temporary
    /// files.
    ///
    /// # Errors
    ///
    /// See [`JobError`]. There is no incomplete file under the name of the output.
    pub fn run(&self) -> Result<Option<Outcome>, JobError> {
        self.run_with_progress(&Quiet, &AtomicBool::new(false))
    }

    /// [`run`](Self::run)s the job, with reports to `progress`, until it is done or `cancel` is set.
    ///
    /// # Errors
    ///
    /// See [`JobError`]; once `cancel` is set, [`JobError::is_cancelled`] soon holds for the error.
    pub fn run_with_progress(
        &self,
        progress: &dyn Progress,
        cancel: &AtomicBool,
    ) -> Result<Option<Outcome>, JobError> {
        self.describe()?
            .run_and_report(progress, cancel, None, |_| Ok(()))
    }

    /// Validates the request.
    fn describe(&self) -> Result<JobDescription, JobError> {
        let options = self.options.as_ref();
        let options = options.ok_or(ConfigError::Target { given: 0 })?;
        options.check().map_err(refused_option)?;
        if let Some(threads) = self.threads
            && !(1..=MAX_THREADS).contains(&threads)
        {
            return Err(JobError::Config(ConfigError::Value {
                option: "threads",
                value: threads.to_string(),
                remedy: "must be from 1 to 1024",
            }));
        }
        let cores = || thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let placement = Placement::of(&self.output, self.directory.as_deref());
        Ok(JobDescription {
            inputs: self.inputs.clone(),
            dir: placement.dir,
            output: placement.output,
            destination: placement.destination,
            mesh: self.mesh.clone(),
            scratch: None,
            settings: Settings {
                target: options.target,
                density: None,
                exact: options.exact,
                resources: ResourceSettings {
                    memory: self.memory,
                    threads: self.threads.unwrap_or_else(cores),
                },
                solver: options.solver,
                tiling: TilingSettings::default(),
                input: InputSettings::default(),
                attributes: AttributeSettings {
                    with: self.mesh.iter().map(|_| Computed::Normals).collect(),
                    ..AttributeSettings::default()
                },
                output_tiles: None,
                tile_format: TileFormat::default(),
                order: PointOrder::default(),
                pcd: PcdOptions::default(),
                mesh: self.mesh.as_ref().map(|_| MeshSettings::default()),
            },
            overwrite: self.overwrites,
            keep: false,
            skip_bad_files: false,
            restart: self.restarts,
        })
    }
}

/// The error of a job with a value out of its range.
fn refused_option(error: ResampleError) -> JobError {
    match error {
        ResampleError::InvalidOption {
            option,
            value,
            remedy,
        } => JobError::Config(ConfigError::Value {
            option,
            value: value.to_string(),
            remedy,
        }),
        other => JobError::Refused(other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn error(job: &Job) -> String {
        let error = job.describe().unwrap_err();
        assert!(error.is_usage());
        error.to_string()
    }

    #[test]
    fn a_request_without_a_density_or_with_a_value_out_of_range_is_refused() {
        let job = || Job::new(["scan.laz"], "even.laz");
        assert!(error(&job()).contains("--spacing"));
        assert!(error(&job().spacing(-1.0)).starts_with("spacing -1"));
        assert!(error(&job().spacing(f64::NAN)).starts_with("spacing"));
        assert!(error(&job().count(0)).starts_with("count 0"));
        assert!(error(&job().ratio(0.1).threads(0)).starts_with("threads 0"));
    }

    #[test]
    fn the_last_density_counts_and_the_directory_stands_beside_the_output() {
        let job = Job::new(["scan.laz"], "out/even.laz").count(5).spacing(0.5);
        let description = job.describe().unwrap();
        assert_eq!(description.dir, Path::new("out/even.laz.job"));
        assert_eq!(
            description.settings.target,
            crate::spacing::Target::Spacing(0.5)
        );
    }
}
