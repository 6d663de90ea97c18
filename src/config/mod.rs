//! What the user asked for: as written, and as meant.
//!
//! [`Choices`] is what stands on the command line or in a TOML file: every
//! value optional, the same names in both, flags over file. [`Settings`] is
//! what the pipeline works by: checked, complete, with units.

mod quantity;

pub use quantity::{Bytes, Count, Share};

use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};

use crate::{
    geometry::PatchKind,
    lloyd::{Acceleration, Options, Restriction, SeedRule},
};

/// Options of a job as written. Lengths are CRS units.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub struct Choices {
    /// Spacing of the output, in CRS units (metres in practice)
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub spacing: Option<f64>,
    /// About how many points to put out: 100K, 2M, 1500000
    #[arg(long, value_name = "N")]
    pub count: Option<Count>,
    /// Points out to points in: 2% or 0.02
    #[arg(long, value_name = "SHARE")]
    pub ratio: Option<Share>,
    /// Peak memory: 512MiB, 4GiB [default: ¾ of what the cgroup or machine allows]
    #[arg(long, value_name = "SIZE")]
    pub memory: Option<Bytes>,
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Directory for temporary files; a job found in it is resumed
    /// [default: OUT.job beside the output]
    #[arg(long, value_name = "DIR")]
    pub job: Option<PathBuf>,
    /// Keep the job directory after success
    #[arg(long)]
    #[serde(skip_serializing_if = "is_false")]
    pub keep_job: bool,
    /// Lloyd iterations [default: 20]
    #[arg(long, value_name = "K")]
    pub iterations: Option<u32>,
    /// none, relaxation, anderson or anderson-global [default: relaxation]
    #[arg(long, value_name = "HOW", value_parser = by_name::<Acceleration>)]
    pub accelerate: Option<Acceleration>,
    /// hexagonal, poisson, area or random [default: hexagonal]
    #[arg(long, value_name = "RULE", value_parser = by_name::<SeedRule>)]
    pub seeds: Option<SeedRule>,
    /// quadratic or plane [default: quadratic]
    #[arg(long, value_name = "KIND", value_parser = by_name::<PatchKind>)]
    pub patch: Option<PatchKind>,
    /// How far from the scan a point may go, in CRS units: the paper's global
    /// threshold [default: the input's spacing around the point]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub restrict: Option<f64>,
    /// Radius of the surface fit, in CRS units: larger than the default smooths
    /// noise away first, smaller keeps finer detail [default: 1.2 spacings]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub smooth: Option<f64>,
    /// Widest hole to close, in CRS units; 0 for none [default: 4 spacings, or
    /// of the scan's own where more points are asked for than it has]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub fill: Option<f64>,
    /// Edge of square tiles, in CRS units [default: by points and memory]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub tile_size: Option<f64>,
    /// What a tile sees around its core, in CRS units [default: by spacing,
    /// iterations and fit radius]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub halo: Option<f64>,
    /// Seed of the choice of points
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// What to do with inputs that cannot be read: stop, or skip them and say so in
    /// the report [default: stop]
    #[arg(long, value_name = "POLICY", value_parser = by_name::<OnBadFile>)]
    pub on_bad_file: Option<OnBadFile>,
    /// Replace an existing output
    #[arg(long)]
    #[serde(skip_serializing_if = "is_false")]
    pub overwrite: bool,
}

/// What becomes of a job with an input that cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OnBadFile {
    /// It fails, with the names of all such inputs.
    #[default]
    Stop,
    /// It leaves the input out, and says so.
    Skip,
}

fn is_false(flag: &bool) -> bool {
    !flag
}

/// Reads a choice by the name that it has in a configuration file.
fn by_name<T: for<'a> Deserialize<'a>>(name: &str) -> Result<T, String> {
    T::deserialize(serde::de::value::StrDeserializer::<serde::de::value::Error>::new(name))
        .map_err(|error| error.to_string())
}

/// What is wrong with the choices.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{path}: cannot read the configuration: {source}")]
    Read {
        /// The file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not what it should be.
    #[error("{path}: {message}")]
    Parse {
        /// The file.
        path: String,
        /// What is wrong, and where.
        message: String,
    },
    /// A value is out of its range.
    #[error("{option} {value}: {remedy}")]
    Value {
        /// The option, as written.
        option: &'static str,
        /// Its value.
        value: String,
        /// What it must be.
        remedy: &'static str,
    },
    /// Not one of `--spacing`, `--count`, `--ratio`, or several of them.
    #[error("give one of --spacing, --count and --ratio ({given} given)")]
    Target {
        /// How many were given.
        given: usize,
    },
}

/// How dense the output is to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Target {
    /// This far apart (CRS units).
    Spacing(f64),
    /// About so many points.
    Count(u64),
    /// About this share of the input's points.
    Ratio(f64),
}

/// Options of a job as meant. Lengths are CRS units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// How dense the output is to be.
    pub target: Target,
    /// Peak memory in bytes; `None`: by the machine.
    pub memory: Option<u64>,
    /// Worker threads.
    pub threads: usize,
    /// Lloyd iterations.
    pub iterations: u32,
    /// What is done with the centroids.
    pub acceleration: Acceleration,
    /// Where sites start.
    pub seeds: SeedRule,
    /// What is fitted.
    pub patch: PatchKind,
    /// How far from the scan a site may go.
    pub restriction: Restriction,
    /// Radius of the surface fit; `None`: by the spacing.
    pub smooth: Option<f64>,
    /// The widest hole to close; `None`: by the spacing.
    pub fill: Option<f64>,
    /// Edge of square tiles; `None`: by points and memory.
    pub tile_size: Option<f64>,
    /// What a tile sees around its core; `None`: by the solver's reach.
    pub halo: Option<f64>,
    /// Seed of every hash.
    pub seed: u64,
}

impl Choices {
    /// Reads a TOML file.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Read`] and [`ConfigError::Parse`], with the file's name.
    pub fn from_file(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read {
            path: path.display().to_string(),
            source,
        })?;
        toml::from_str(&text).map_err(|error| ConfigError::Parse {
            path: path.display().to_string(),
            message: error.to_string(),
        })
    }

    /// These choices where they are made, those of `file` where not.
    #[must_use]
    pub fn or(self, file: Self) -> Self {
        // A target on the command line replaces the file's, whatever its kind.
        let targets = self.spacing.is_some() || self.count.is_some() || self.ratio.is_some();
        let file = if targets {
            Self {
                spacing: None,
                count: None,
                ratio: None,
                ..file
            }
        } else {
            file
        };
        Self {
            spacing: self.spacing.or(file.spacing),
            count: self.count.or(file.count),
            ratio: self.ratio.or(file.ratio),
            memory: self.memory.or(file.memory),
            threads: self.threads.or(file.threads),
            job: self.job.or(file.job),
            keep_job: self.keep_job || file.keep_job,
            iterations: self.iterations.or(file.iterations),
            accelerate: self.accelerate.or(file.accelerate),
            seeds: self.seeds.or(file.seeds),
            patch: self.patch.or(file.patch),
            restrict: self.restrict.or(file.restrict),
            smooth: self.smooth.or(file.smooth),
            fill: self.fill.or(file.fill),
            tile_size: self.tile_size.or(file.tile_size),
            halo: self.halo.or(file.halo),
            seed: self.seed.or(file.seed),
            on_bad_file: self.on_bad_file.or(file.on_bad_file),
            overwrite: self.overwrite || file.overwrite,
        }
    }

    /// What these choices mean.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Target`] unless there is exactly one target,
    /// [`ConfigError::Value`] for a value out of its range.
    pub fn settings(&self) -> Result<Settings, ConfigError> {
        let positive = |option, value: Option<f64>| match value {
            // Written so that NaN fails.
            Some(v) if !(v > 0.0 && v.is_finite()) => Err(ConfigError::Value {
                option,
                value: v.to_string(),
                remedy: "must be a length above zero, in CRS units",
            }),
            other => Ok(other),
        };
        let targets: Vec<Target> = [
            positive("--spacing", self.spacing)?.map(Target::Spacing),
            self.count.map(|count| Target::Count(count.0)),
            self.ratio.map(|ratio| Target::Ratio(ratio.0)),
        ]
        .into_iter()
        .flatten()
        .collect();
        let &[target] = targets.as_slice() else {
            return Err(ConfigError::Target {
                given: targets.len(),
            });
        };
        if target == Target::Count(0) {
            return Err(ConfigError::Value {
                option: "--count",
                value: "0".into(),
                remedy: "must be at least 1",
            });
        }
        if let Some(value @ (0 | 1025..)) = self.threads {
            return Err(ConfigError::Value {
                option: "--threads",
                value: value.to_string(),
                remedy: "must be from 1 to 1024",
            });
        }
        if let Some(value @ 1001..) = self.iterations {
            return Err(ConfigError::Value {
                option: "--iterations",
                value: value.to_string(),
                remedy: "must be at most 1000; twenty are usual",
            });
        }
        Ok(Settings {
            target,
            memory: self.memory.map(|bytes| bytes.0),
            threads: self.threads.unwrap_or_else(|| {
                std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
            }),
            iterations: self.iterations.unwrap_or(20),
            acceleration: self.accelerate.unwrap_or_default(),
            seeds: self.seeds.unwrap_or_default(),
            patch: self.patch.unwrap_or_default(),
            restriction: positive("--restrict", self.restrict)?
                .map_or(Restriction::Local, Restriction::Global),
            smooth: positive("--smooth", self.smooth)?,
            fill: match self.fill {
                Some(0.0) => Some(0.0),
                fill => positive("--fill", fill)?,
            },
            tile_size: positive("--tile-size", self.tile_size)?,
            halo: positive("--halo", self.halo)?,
            seed: self.seed.unwrap_or(0),
        })
    }
}

impl Settings {
    /// What the solver is asked for at `spacing`, if about `seeds_per_point`
    /// points are to come out for each of the input's.
    pub fn solver(&self, spacing: f64, seeds_per_point: f64) -> Options {
        let defaults = Options::new(spacing);
        // Holes are a few spacings wide: of the output, or of the scan where that
        // is coarser.
        let scan_is_coarser = seeds_per_point.max(1.0).sqrt();
        Options {
            fill: self.fill.unwrap_or(defaults.fill * scan_is_coarser),
            fit_radius: self.smooth.unwrap_or(f64::MAX).min(defaults.fit_radius),
            smooth: self
                .smooth
                .filter(|&r| r > defaults.fit_radius)
                .unwrap_or(0.0),
            iterations: self.iterations,
            seeds: self.seeds,
            seeds_per_point,
            acceleration: self.acceleration,
            patch: self.patch,
            restriction: self.restriction,
            seed: self.seed,
            ..defaults
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Choices {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn flags_win_over_the_file() {
        let file = parsed("spacing = 0.05\nmemory = \"4GiB\"\nthreads = 8");
        let flags = parsed("count = \"2M\"\nthreads = 2");
        let settings = flags.or(file).settings().unwrap();
        assert_eq!(settings.target, Target::Count(2_000_000));
        assert_eq!(settings.threads, 2);
        assert_eq!(settings.memory, Some(4 << 30));
    }

    #[test]
    fn a_spacing_that_is_no_length_is_refused() {
        for bad in ["0.0", "-1.0", "nan", "inf"] {
            let error = parsed(&format!("spacing = {bad}")).settings().unwrap_err();
            assert!(error.to_string().starts_with("--spacing"), "{error}");
        }
    }

    #[test]
    fn exactly_one_target_is_wanted() {
        assert!(parsed("").settings().is_err());
        assert!(parsed("spacing = 1\nratio = 0.5").settings().is_err());
    }

    #[test]
    fn an_unknown_name_is_refused() {
        assert!(toml::from_str::<Choices>("spaceing = 1").is_err());
    }

    #[test]
    fn names_are_the_same_in_flags_and_file() {
        assert_eq!(
            by_name::<Acceleration>("anderson-global"),
            Ok(Acceleration::AndersonGlobal)
        );
        assert_eq!(
            parsed("spacing = 1\naccelerate = \"anderson-global\"").accelerate,
            Some(Acceleration::AndersonGlobal)
        );
        assert!(by_name::<SeedRule>("lattice").is_err());
    }
}
