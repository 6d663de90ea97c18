//! The description of a job: inputs, output and settings, validated.

use std::{
    fs::{self, File},
    path::PathBuf,
};

use serde::{Deserialize, Serialize};

use super::{directory::InputStamps, error::JobError, resources::Budget};
use crate::{
    config::{ResourceSettings, Settings},
    las::{Format, LasError},
};

/// A job: which scans are resampled, how, and to which output. Its JSON is handed over to other
/// processes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct JobDescription {
    /// Input files, directories and patterns.
    pub(crate) inputs: Vec<PathBuf>,
    /// The output file, or the output directory of a tiled output.
    pub(crate) output: PathBuf,
    /// The job directory, which contains the temporary files.
    pub(crate) dir: PathBuf,
    /// A directory for temporary files that only the last stage reads, used if it has room; `None`
    /// puts them in the job directory.
    #[serde(skip)]
    pub(crate) scratch: Option<PathBuf>,
    /// The settings, validated.
    pub(crate) settings: Settings,
    /// Whether an existing output is replaced.
    pub(crate) overwrite: bool,
    /// Whether the job directory is kept after success.
    pub(crate) keep: bool,
    /// Whether inputs that cannot be read are left out; otherwise they end the job.
    pub(crate) skip_bad_files: bool,
    /// Whether the files of an earlier run are removed first.
    pub(crate) restart: bool,
}

impl JobDescription {
    /// The format of the output, by its name and by the settings.
    ///
    /// # Errors
    ///
    /// [`LasError`] if the name has no ending of a known format, or has one but tiles are requested.
    pub(crate) fn format(&self) -> Result<Format, LasError> {
        let of_file = Format::of_path(&self.output);
        match (self.settings.output_tiles, of_file) {
            (None, of_file) => of_file,
            (Some(_), Err(_)) => Ok(Format::Tiles),
            (Some(_), Ok(_)) => Err(LasError::new(
                &self.output,
                "is the name of a file; --output-tiles wants that of a directory",
            )),
        }
    }

    /// Whether the points of the output are sorted by position before they are written.
    pub(crate) fn is_sorted(&self) -> bool {
        matches!(self.format(), Ok(Format::Copc | Format::Tiles))
    }

    /// The memory and the threads of the job.
    pub(crate) fn budget(&self) -> Budget {
        Budget::new(
            self.settings.resources.memory,
            self.settings.resources.threads,
        )
    }

    /// The peak memory in bytes: the requested memory, or three quarters of what the system allows.
    pub(crate) fn memory(&self) -> u64 {
        self.budget().total
    }

    /// Checks that the output can be written, before hours of work; returns its format.
    ///
    /// # Errors
    ///
    /// [`JobError::Las`] if a file beside the output cannot be created, or if the output is a
    /// directory with other files in it.
    pub(crate) fn check_output(&self) -> Result<Format, JobError> {
        let format = self.format()?;
        format.check_replaceable(&self.output)?;
        let wrong = |e| LasError::new(&self.output, format!("cannot be written: {e}"));
        let trial = self.output.with_extension("lloydar-trial");
        File::create(&trial).map_err(wrong)?;
        fs::remove_file(&trial).map_err(wrong)?;
        Ok(format)
    }

    /// Checks that the output does not exist, or may be replaced.
    ///
    /// # Errors
    ///
    /// [`JobError::Las`] if it exists and must not be replaced.
    pub(crate) fn check_free(&self) -> Result<(), JobError> {
        match self.output.exists() && !self.overwrite {
            true => {
                let problem = "exists already; give another name, or --overwrite";
                Err(LasError::new(&self.output, problem).into())
            }
            false => Ok(()),
        }
    }

    /// The identity of the job: the program's version, the `inputs` as they are now, and the
    /// settings that decide the result. Memory and threads do not.
    pub(crate) fn identity(&self, inputs: &InputStamps) -> serde_json::Value {
        let settings = Settings {
            resources: ResourceSettings::UNSTATED,
            ..self.settings.clone()
        };
        serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "inputs": inputs.by_name(),
            "settings": settings,
        })
    }
}
