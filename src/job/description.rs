//! The description of a job: inputs, output and settings, validated.

use std::{
    fs::{self, File},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};

use super::{
    directory::{InputStamps, PLAN_FILE, Stamp},
    error::JobError,
    resources::Budget,
};
use crate::{
    config::{ConfigError, ResourceSettings, Settings},
    las::{Format, LasError, MeshFormat, PointOrder, TileFormat, read_trajectory},
    store::{Destination, is_remote, serialize_without_secrets, without_secrets},
};

/// A job: which scans are resampled, how, and to which output. Its JSON is handed over to other
/// processes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct JobDescription {
    /// Input files, directories and patterns, and addresses, which are written without their secrets.
    #[serde(serialize_with = "serialize_without_secrets")]
    pub(crate) inputs: Vec<PathBuf>,
    /// The output file, or the output directory of a tiled output.
    pub(crate) output: PathBuf,
    /// The address of the output, if it is uploaded when it is complete.
    #[serde(default)]
    pub(crate) destination: Option<PathBuf>,
    /// The file for a mesh of the output, if one is written.
    #[serde(default)]
    pub(crate) mesh: Option<PathBuf>,
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
    /// [`ConfigError::Named`] if the name has no ending of a known format, or has one but tiles are requested, or if
    /// the format has no order of points and one is requested.
    pub(crate) fn format(&self) -> Result<Format, ConfigError> {
        let format = self.format_by_name()?;
        match self.settings.order {
            PointOrder::Progressive if !format.keeps_order() => Err(self.misnamed(
                "cannot have --order progressive: that is for .laz, .las and .ply; the octree of .copc.laz has levels \
                 without it",
            )),
            _ => Ok(format),
        }
    }

    fn format_by_name(&self) -> Result<Format, ConfigError> {
        let of_file = Format::of_path(&self.output);
        let settings = &self.settings;
        match (settings.output_tiles, of_file) {
            (None, of_file) => of_file.map_err(|error| self.misnamed(error.problem)),
            (Some(edge), Err(_))
                if settings.tile_format == TileFormat::Pcd && edge.fract() != 0.0 =>
            {
                Err(self.misnamed(format!(
                    "cannot have PCD tiles of {edge} units: their index has whole numbers only; choose a whole \
                     --output-tiles"
                )))
            }
            (Some(_), Err(_)) => Ok(Format::Tiles(settings.tile_format)),
            (Some(_), Ok(_)) => Err(
                self.misnamed("is the name of a file; --output-tiles wants that of a directory")
            ),
        }
    }

    /// The error that the name of the output does not go with the options.
    fn misnamed(&self, problem: impl Into<String>) -> ConfigError {
        misnamed("--output", &self.shown_output(), problem)
    }

    /// Whether the points of the output are sorted before they are written.
    pub(crate) fn is_sorted(&self) -> bool {
        self.is_progressive() || self.format().is_ok_and(|format| !format.keeps_order())
    }

    fn is_progressive(&self) -> bool {
        self.settings.order == PointOrder::Progressive
    }

    /// The edge of the tiles of the mesh (CRS units), if it is written as tiles: where the cloud is, and the name of the
    /// mesh has no ending.
    pub(crate) fn mesh_tile_edge(&self) -> Option<f64> {
        let is_directory = self
            .mesh
            .as_ref()
            .is_some_and(|mesh| mesh.extension().is_none());
        self.settings.output_tiles.filter(|_| is_directory)
    }

    /// The number of copies of the records that lie on the disk while the output is sorted. For a mesh they are sorted
    /// first and then put in order, and its triangles take about as much.
    pub(crate) fn sorted_copies(&self) -> u64 {
        let for_mesh = if self.mesh.is_some() { 3 } else { 0 };
        // In progressive order they are sorted by position, and then by their places in the file.
        u64::from(self.is_sorted()) + u64::from(self.is_progressive()) + for_mesh
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
    /// [`JobError::Config`] if the output or its mesh cannot have its name, [`JobError::Las`] if a file beside one of them
    /// cannot be created, or if the output is a directory with other files in it.
    pub(crate) fn check_output(&self) -> Result<Format, JobError> {
        let format = self.format()?;
        format.check_replaceable(&self.output)?;
        match &self.destination {
            None => try_beside(&self.output)?,
            Some(address) => {
                Destination::of(address).map_err(|e| LasError::new(address, e.to_string()))?;
            }
        }
        if let Some(mesh) = &self.mesh {
            self.check_name_of_mesh(mesh)?;
            try_beside(mesh)?;
        }
        let of_mesh = (self.settings.mesh.as_ref()).and_then(|mesh| mesh.trajectory.as_ref());
        if let Some(path) = of_mesh.or(self.trajectory_of_transients()) {
            read_trajectory(path)?;
        }
        Ok(format)
    }

    /// Checks that the name of the `mesh` is one of a mesh, on this machine, and not that of the output.
    fn check_name_of_mesh(&self, mesh: &Path) -> Result<(), ConfigError> {
        let wrong = |problem: &str| Err(misnamed("--mesh", &without_secrets(mesh), problem));
        if self.mesh_tile_edge().is_none()
            && let Err(error) = MeshFormat::of_path(mesh)
        {
            return wrong(&error.problem);
        }
        if is_remote(mesh) {
            return wrong(
                "cannot be written: a mesh is a file of this machine; copy it when it is complete",
            );
        }
        if *mesh == self.output {
            return wrong("is the name of the cloud and of its mesh; give two names");
        }
        Ok(())
    }

    /// The file with the way of the scanner, if points are left out by it.
    fn trajectory_of_transients(&self) -> Option<&PathBuf> {
        let settings = self.settings.input.transients.as_ref()?;
        Some(&settings.trajectory)
    }

    /// Checks that the output does not exist, or may be replaced.
    ///
    /// # Errors
    ///
    /// [`JobError::Las`] if it exists and must not be replaced.
    pub(crate) fn check_free(&self) -> Result<(), JobError> {
        self.check_destination()?;
        // A run that was killed between the mesh and the cloud has left the mesh.
        let mesh = self.mesh.as_ref().filter(|_| !self.has_begun());
        match [Some(&self.output), mesh]
            .into_iter()
            .flatten()
            .find(|path| path.exists())
        {
            Some(path) if !self.overwrite => {
                let problem = "exists already; give another name, or --overwrite";
                Err(LasError::new(path, problem).into())
            }
            _ => Ok(()),
        }
    }

    /// Checks that none of the `inputs` is replaced by what the job writes.
    ///
    /// # Errors
    ///
    /// [`JobError::Las`] with the first that would be.
    pub(crate) fn check_inputs_stay<'a>(
        &self,
        mut inputs: impl Iterator<Item = &'a Path>,
    ) -> Result<(), JobError> {
        let written = [Some(&self.output), self.mesh.as_ref()];
        // What does not exist yet is no input.
        let written = written.into_iter().flatten();
        let written: Vec<PathBuf> = written
            .filter_map(|path| path.canonicalize().ok())
            .collect();
        let is_written = |input: &&Path| {
            let input = input.canonicalize();
            input.is_ok_and(|input| written.contains(&input))
        };
        match inputs.find(is_written) {
            Some(input) => {
                let problem = "is an input and would be replaced; give the output another name, outside of the directories and patterns of the inputs";
                Err(LasError::new(input, problem).into())
            }
            None => Ok(()),
        }
    }

    /// Whether an earlier run of the job has planned its tiles.
    fn has_begun(&self) -> bool {
        !self.restart && self.dir.join(PLAN_FILE).exists()
    }

    /// The identity of the job: the program's version, the `inputs` as they are now, the settings that decide the
    /// result, and the file by which points are left out. Memory and threads do not.
    pub(crate) fn identity(&self, inputs: &InputStamps) -> serde_json::Value {
        let settings = Settings {
            resources: ResourceSettings::UNSTATED,
            ..self.settings.clone()
        };
        let mut identity = serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "inputs": inputs.by_name(),
            "settings": settings,
        });
        if let Some(trajectory) = self.trajectory_of_transients() {
            identity["trajectory"] = serde_json::json!(Stamp::of(trajectory).ok());
        }
        identity
    }
}

/// The error that the file at `path`, which `option` names, cannot have its name.
fn misnamed(option: &'static str, path: &Path, problem: impl Into<String>) -> ConfigError {
    ConfigError::Named {
        option,
        value: path.display().to_string(),
        problem: problem.into(),
    }
}

/// The peak memory in bytes of a job that requests this much, or nothing.
pub(crate) fn memory_budget(requested: Option<u64>) -> u64 {
    Budget::new(requested, 1).total
}

/// Creates and removes a file beside `path`.
fn try_beside(path: &Path) -> Result<(), LasError> {
    let wrong = |e| LasError::new(path, format!("cannot be written: {e}"));
    let trial = path.with_extension("lloydar-trial");
    File::create(&trial).map_err(wrong)?;
    fs::remove_file(&trial).map_err(wrong)
}
