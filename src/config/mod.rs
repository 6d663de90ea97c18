//! What the user asked for: as written, and as meant.
//!
//! [`Choices`] is what stands on the command line or in a TOML file: every
//! value optional, the same names in both, flags over file. [`Settings`] is
//! what the pipeline works by: checked, complete, with units.

mod quantity;

pub(crate) use quantity::{Bytes, Count, Length, Share, Sides};

use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};

use crate::{
    geometry::PatchKind,
    las::{Crs, Ground, PointFilter},
    lloyd::{Acceleration, Restriction, SeedRule, SolverSettings},
    spacing::Target,
};

/// Options of a job as written. Lengths are CRS units.
#[derive(Args, Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Choices {
    /// Spacing of the output: 0.05 (in CRS units), 5cm, 0.2ft
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) spacing: Option<Length>,
    /// About how many points to put out: 100K, 2M, 1500000
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<Count>,
    /// Points out to points in: 2% or 0.02
    #[arg(long, value_name = "SHARE")]
    pub(crate) ratio: Option<Share>,
    /// Peak memory: 512MiB, 4GiB [default: ¾ of what the cgroup or machine allows]
    #[arg(long, value_name = "SIZE")]
    pub(crate) memory: Option<Bytes>,
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Directory for temporary files; a job found in it is resumed
    /// [default: OUT.job beside the output]
    #[arg(long, value_name = "DIR")]
    pub(crate) job: Option<PathBuf>,
    /// Keep the job directory after success
    #[arg(long)]
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) keep_job: bool,
    /// Lloyd iterations [default: 20]
    #[arg(long, value_name = "K")]
    pub(crate) iterations: Option<u32>,
    /// none, relaxation, anderson or anderson-global [default: relaxation]
    #[arg(long, value_name = "HOW", value_parser = by_name::<Acceleration>)]
    pub(crate) accelerate: Option<Acceleration>,
    /// hexagonal, poisson, area or random [default: hexagonal]
    #[arg(long, value_name = "RULE", value_parser = by_name::<SeedRule>)]
    pub(crate) seeds: Option<SeedRule>,
    /// quadratic or plane [default: quadratic]
    #[arg(long, value_name = "KIND", value_parser = by_name::<PatchKind>)]
    pub(crate) patch: Option<PatchKind>,
    /// How far from the scan a point may go: the paper's global threshold [default: the input's spacing around the point]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) restrict: Option<Length>,
    /// Radius of the surface fit: larger than the default smooths
    /// noise away first, smaller keeps finer detail [default: 1.2 spacings]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) smooth: Option<Length>,
    /// Widest hole to close; 0 for none [default: 4 spacings, or
    /// of the scan's own where more points are asked for than it has]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) fill: Option<Length>,
    /// Edge of square tiles [default: by points and memory]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) tile_size: Option<Length>,
    /// What a tile sees around its core [default: by spacing, iterations and fit
    /// radius]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) halo: Option<Length>,
    /// Seed of the choice of points
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Classes to keep: 2,6 [default: all]
    #[arg(long, value_name = "CLASSES", value_delimiter = ',')]
    pub(crate) keep_class: Option<Vec<u8>>,
    /// Classes to leave out: 7,18
    #[arg(long, value_name = "CLASSES", value_delimiter = ',')]
    pub(crate) drop_class: Option<Vec<u8>>,
    /// Leave out points that are withheld
    #[arg(long)]
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) drop_withheld: bool,
    /// Keep what lies in a rectangle: xmin,ymin,xmax,ymax
    #[arg(long, value_name = "SIDES", allow_hyphen_values = true)]
    pub(crate) bounds: Option<Sides>,
    /// Keep what lies in the polygons of a file: well-known text or GeoJSON, in the CRS
    /// of the data
    #[arg(long, value_name = "FILE")]
    pub(crate) polygon: Option<PathBuf>,
    /// The CRS of all inputs, whatever they say: EPSG:32633, or a file of well-known
    /// text [default: what they say]
    #[arg(long, value_name = "CRS")]
    pub(crate) crs: Option<String>,
    /// Colour, near infrared and intensity: those of the nearest input point, or the mean
    /// of the points that are nearer to this point than to any other: nearest or mean
    /// [default: nearest]
    #[arg(long, value_name = "RULE", value_parser = by_name::<ColorRule>)]
    pub(crate) color: Option<ColorRule>,
    /// Class: that of the nearest input point, or of most of the points that are nearer
    /// to this point than to any other: nearest or majority [default: nearest]
    #[arg(long, value_name = "RULE", value_parser = by_name::<ClassRule>)]
    pub(crate) class: Option<ClassRule>,
    /// Extra attributes: normals, curvature, area, density, distance
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = by_name::<Computed>)]
    pub(crate) with: Option<Vec<Computed>>,
    /// Write a directory of square tiles with this edge, and an index, in place of one
    /// file
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(crate) output_tiles: Option<Length>,
    /// What to do with inputs that cannot be read: stop, or skip them and say so in
    /// the report [default: stop]
    #[arg(long, value_name = "POLICY", value_parser = by_name::<OnBadFile>)]
    pub(crate) on_bad_file: Option<OnBadFile>,
    /// Replace an existing output
    #[arg(long)]
    #[serde(skip_serializing_if = "is_false")]
    pub(crate) overwrite: bool,
}

/// What becomes of a job with an input that cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum OnBadFile {
    /// It fails, with the names of all such inputs.
    #[default]
    Stop,
    /// It leaves the input out, and says so.
    Skip,
}

/// What becomes of colour, near infrared and intensity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ColorRule {
    /// Those of the nearest input point.
    #[default]
    Nearest,
    /// The mean of the input points in the cell.
    Mean,
}

/// What becomes of the class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ClassRule {
    /// That of the nearest input point.
    #[default]
    Nearest,
    /// That of most input points in the cell; of equally many the nearest point's if it
    /// is among them, else the least.
    Majority,
}

/// An attribute that the solver knows and the scan does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Computed {
    /// Of the surface, upwards: three numbers.
    Normals,
    /// Mean curvature of the surface (1 / CRS unit).
    Curvature,
    /// Of the point's cell (square CRS units).
    Area,
    /// Input points in the cell, to the square CRS unit.
    Density,
    /// To the nearest input point (CRS units).
    Distance,
}

fn is_false(flag: &bool) -> bool {
    !flag
}

/// Reads a choice by the name that it has in a configuration file.
///
/// # Errors
///
/// What is wrong with the name, and which there are.
pub(crate) fn by_name<T: for<'a> Deserialize<'a>>(name: &str) -> Result<T, String> {
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
    /// A file or text that an option names is not what it should be.
    #[error("{option} {value}: {problem}")]
    Named {
        /// The option, as written.
        option: &'static str,
        /// What it names.
        value: String,
        /// What is wrong with it.
        problem: String,
    },
    /// Not one of `--spacing`, `--count`, `--ratio`, or several of them.
    #[error("give one of --spacing, --count and --ratio ({given} given)")]
    Target {
        /// How many were given.
        given: usize,
    },
}

/// Options of a job as meant. Lengths are CRS units.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Settings {
    /// How dense the output is to be.
    pub(crate) target: Target,
    /// Peak memory in bytes; `None`: by the machine.
    pub(crate) memory: Option<u64>,
    /// Worker threads.
    pub(crate) threads: usize,
    /// How each tile is solved.
    #[serde(flatten)]
    pub(crate) solver: SolverSettings,
    /// Edge of square tiles; `None`: by points and memory.
    pub(crate) tile_size: Option<f64>,
    /// What a tile sees around its core; `None`: by the solver's reach.
    pub(crate) halo: Option<f64>,
    /// Which input points take part.
    pub(crate) filter: PointFilter,
    /// The CRS of all inputs; `None`: what they say.
    pub(crate) crs: Option<Crs>,
    /// What becomes of colour, near infrared and intensity.
    pub(crate) color: ColorRule,
    /// What becomes of the class.
    pub(crate) class: ClassRule,
    /// Attributes to add, in order, each once.
    pub(crate) with: Vec<Computed>,
    /// Edge of the tiles that are written; `None`: one file.
    pub(crate) output_tiles: Option<f64>,
}

impl Choices {
    /// Reads a TOML file.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Read`] and [`ConfigError::Parse`], with the file's name.
    pub(crate) fn from_file(path: &Path) -> Result<Self, ConfigError> {
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
    ///
    /// # Panics
    ///
    /// Never: options that were read can be written.
    #[must_use]
    pub(crate) fn or(self, file: Self) -> Self {
        let table = |choices| toml::Table::try_from(choices).expect("options are plain values");
        let (flags, mut merged) = (table(self), table(file));
        // A target on the command line replaces the file's, whatever its kind.
        const TARGETS: [&str; 3] = ["spacing", "count", "ratio"];
        if TARGETS.iter().any(|name| flags.contains_key(*name)) {
            merged.retain(|name, _| !TARGETS.contains(&name));
        }
        merged.extend(flags);
        merged.try_into().expect("each was read from such a table")
    }

    /// Whether a length has a unit of its own: the CRS must be known then.
    pub(crate) fn has_units(&self) -> bool {
        let lengths = [
            self.spacing,
            self.restrict,
            self.smooth,
            self.fill,
            self.tile_size,
            self.halo,
            self.output_tiles,
        ];
        lengths.iter().flatten().any(|length| length.unit.is_some())
    }

    /// The CRS that is given for all inputs, if one is.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Named`] if it is no code that is known, nor a file of text.
    pub(crate) fn crs(&self) -> Result<Option<Crs>, ConfigError> {
        let Some(text) = &self.crs else {
            return Ok(None);
        };
        let wrong = |problem: String| ConfigError::Named {
            option: "--crs",
            value: text.clone(),
            problem,
        };
        let code = text.to_ascii_uppercase();
        if let Some(code) = code.strip_prefix("EPSG:") {
            let known = code.parse().ok().and_then(Crs::of_epsg);
            let unknown = || wrong("is no code that is known; give a file of its text".into());
            return known.map(Some).ok_or_else(unknown);
        }
        let content = std::fs::read_to_string(text)
            .map_err(|e| wrong(format!("is neither EPSG:… nor a file: {e}")))?;
        Ok(Some(Crs::Wkt(content.trim().to_owned())))
    }

    fn filter(&self) -> Result<PointFilter, ConfigError> {
        let ground = |path: &PathBuf| {
            Ground::from_file(path).map_err(|problem| ConfigError::Named {
                option: "--polygon",
                value: path.display().to_string(),
                problem,
            })
        };
        Ok(PointFilter {
            keep_classes: self.keep_class.clone(),
            drop_classes: self.drop_class.clone().unwrap_or_default(),
            drop_withheld: self.drop_withheld,
            bounds: self.bounds.map(|sides| sides.0),
            polygons: self.polygon.as_ref().map(ground).transpose()?,
        })
    }

    /// What these choices mean where a unit of the CRS is so many `metres`, if that is
    /// known.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Target`] unless there is exactly one target,
    /// [`ConfigError::Value`] for a value out of its range, or with a unit where that of
    /// the CRS is not known, [`ConfigError::Named`] for a file that is not what it should
    /// be.
    pub(crate) fn settings(&self, metres: Option<f64>) -> Result<Settings, ConfigError> {
        let length = |option, length: Option<Length>| {
            let Some(Length { value, unit }) = length else {
                return Ok(None);
            };
            let Some(unit) = unit else {
                return Ok(Some(value));
            };
            let wrong = |remedy| ConfigError::Value {
                option,
                value: Length {
                    value,
                    unit: Some(unit),
                }
                .to_string(),
                remedy,
            };
            let metres = metres.ok_or_else(|| {
                wrong("the inputs state no CRS, and so no unit; give --crs, or a plain number")
            })?;
            Ok(Some(value * unit.metres() / metres))
        };
        let positive = |option, given: Option<Length>| match length(option, given)? {
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
            solver: SolverSettings {
                iterations: self.iterations.unwrap_or(20),
                acceleration: self.accelerate.unwrap_or_default(),
                seeds: self.seeds.unwrap_or_default(),
                patch: self.patch.unwrap_or_default(),
                restriction: positive("--restrict", self.restrict)?
                    .map_or(Restriction::Local, Restriction::Global),
                smooth: positive("--smooth", self.smooth)?,
                fill: match self.fill {
                    Some(Length { value: 0.0, .. }) => Some(0.0),
                    fill => positive("--fill", fill)?,
                },
                seed: self.seed.unwrap_or(0),
            },
            tile_size: positive("--tile-size", self.tile_size)?,
            halo: positive("--halo", self.halo)?,
            filter: self.filter()?,
            crs: self.crs()?,
            color: self.color.unwrap_or_default(),
            class: self.class.unwrap_or_default(),
            with: {
                let mut with = self.with.clone().unwrap_or_default();
                with.sort_unstable();
                with.dedup();
                with
            },
            output_tiles: positive("--output-tiles", self.output_tiles)?,
        })
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
        let settings = flags.or(file).settings(None).unwrap();
        assert_eq!(settings.target, Target::Count(2_000_000));
        assert_eq!(settings.threads, 2);
        assert_eq!(settings.memory, Some(4 << 30));
    }

    #[test]
    fn a_spacing_that_is_no_length_is_refused() {
        for bad in ["0.0", "-1.0", "nan", "inf"] {
            let error = parsed(&format!("spacing = {bad}"))
                .settings(None)
                .unwrap_err();
            assert!(error.to_string().starts_with("--spacing"), "{error}");
        }
    }

    #[test]
    fn exactly_one_target_is_wanted() {
        assert!(parsed("").settings(None).is_err());
        assert!(parsed("spacing = 1\nratio = 0.5").settings(None).is_err());
    }

    #[test]
    fn units_are_those_of_the_crs() {
        let choices = parsed("spacing = \"0.2ft\"\nfill = 3");
        let settings = choices.settings(Some(1.0)).unwrap();
        assert_eq!(settings.target, Target::Spacing(0.2 * 0.3048));
        assert_eq!(settings.solver.fill, Some(3.0));
        let settings = choices.settings(Some(0.3048)).unwrap();
        assert_eq!(settings.target, Target::Spacing(0.2));
        let error = choices.settings(None).unwrap_err().to_string();
        assert!(
            error.contains("0.2ft") && error.contains("--crs"),
            "{error}"
        );
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
        assert!(by_name::<SeedRule>("quantization").is_err());
    }
}
