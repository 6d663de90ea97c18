//! What choices mean: defaults for options that are not given, ranges, units, and the files
//! that options name.

use std::path::PathBuf;

use super::{
    choices::{Choices, TransientRule},
    crs_unit::CrsUnit,
    density::DensitySettings,
    error::ConfigError,
    length::Length,
    places::Places,
    rules::Computed,
    settings::{
        AttributeSettings, InputSettings, MeshSettings, ResourceSettings, Settings, TilingSettings,
        TransientSettings,
    },
};
use crate::{
    las::{
        Crs, OctreeLevels, PcdOptions, PcdOrigin, PointFilter, PointOrder, PolygonFilter,
        TileFormat,
    },
    lloyd::{Restriction, SolverSettings},
    transients::VOXEL_EDGE,
};

/// The greatest number of worker threads.
const MOST_THREADS: usize = 1024;
/// The greatest number of Lloyd iterations.
const MOST_ITERATIONS: u32 = 1000;

impl Choices {
    /// Returns whether a length has a unit of its own: then the unit of the CRS must be known.
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
        let has_unit = |length: &Length| length.unit.is_some();
        // Rules that cannot be read are reported with the settings.
        lengths.iter().flatten().any(has_unit)
            || self
                .rules()
                .is_ok_and(|rules| rules.lengths().iter().any(has_unit))
    }

    /// Returns what these choices mean, for a CRS whose unit has this length in metres, if
    /// that is known.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Target`] unless there is exactly one target, [`ConfigError::Value`] for
    /// a value out of its range, or with a unit where that of the CRS is not known,
    /// [`ConfigError::Named`] for a file that cannot be used.
    pub(crate) fn settings(&self, metres: Option<f64>) -> Result<Settings, ConfigError> {
        let unit = CrsUnit { metres };
        let density = self.density(unit)?;
        if density.is_some() {
            self.check_with_rules()?;
        }
        let solver = SolverSettings {
            grading: density.as_ref().and_then(DensitySettings::grading),
            ..self.solver(unit)?
        };
        Ok(Settings {
            target: self.target(unit, density.as_ref())?,
            density,
            exact: self.exact()?,
            resources: self.resources()?,
            solver,
            tiling: TilingSettings {
                tile_size: unit.positive("--tile-size", self.tile_size)?,
                halo: unit.positive("--halo", self.halo)?,
            },
            input: InputSettings {
                filter: self.filter()?,
                crs: self.crs()?,
                reproject: self.reproject,
                levels: self.levels()?,
                transients: self.transient_settings(unit)?,
            },
            attributes: self.attributes(),
            mesh: self.mesh_settings()?,
            output_tiles: unit.positive("--output-tiles", self.output_tiles)?,
            tile_format: self.tile_format()?,
            order: self.order()?,
            pcd: PcdOptions {
                encoding: self.pcd.unwrap_or_default(),
                origin: self.pcd_origin()?,
            },
        })
    }

    fn resources(&self) -> Result<ResourceSettings, ConfigError> {
        if let Some(threads) = self.threads
            && !(1..=MOST_THREADS).contains(&threads)
        {
            return Err(ConfigError::Value {
                option: "--threads",
                value: threads.to_string(),
                remedy: "must be from 1 to 1024",
            });
        }
        let cores = || std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        Ok(ResourceSettings {
            memory: self.memory.map(|bytes| bytes.0),
            threads: self.threads.unwrap_or_else(cores),
        })
    }

    fn solver(&self, unit: CrsUnit) -> Result<SolverSettings, ConfigError> {
        if let Some(iterations) = self.iterations
            && iterations > MOST_ITERATIONS
        {
            return Err(ConfigError::Value {
                option: "--iterations",
                value: iterations.to_string(),
                remedy: "must be at most 1000; twenty are usual",
            });
        }
        let defaults = SolverSettings::default();
        Ok(SolverSettings {
            iterations: self.iterations.unwrap_or(defaults.iterations),
            acceleration: self.accelerate.unwrap_or(defaults.acceleration),
            seeds: self.seeds.unwrap_or(defaults.seeds),
            patch: self.patch.unwrap_or(defaults.patch),
            restriction: unit
                .positive("--restrict", self.restrict)?
                .map_or(defaults.restriction, Restriction::Global),
            smooth: unit.positive("--smooth", self.smooth)?,
            fill: match self.fill {
                Some(Length { value: 0.0, .. }) => Some(0.0),
                fill => unit.positive("--fill", fill)?,
            },
            seed: self.seed.unwrap_or(defaults.seed),
            edges: self.edges.unwrap_or(defaults.edges),
            isolated: self.isolated.unwrap_or(defaults.isolated),
            ..defaults
        })
    }

    fn filter(&self) -> Result<PointFilter, ConfigError> {
        let ground = |path: &PathBuf| {
            PolygonFilter::from_file(path).map_err(|problem| ConfigError::Named {
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

    fn levels(&self) -> Result<OctreeLevels, ConfigError> {
        match (self.levels.unwrap_or_default(), self.spacing) {
            (OctreeLevels::Auto, None) => Err(ConfigError::Words(
                "--levels auto goes by the spacing; give --spacing, or leave --levels auto out"
                    .into(),
            )),
            (levels, _) => Ok(levels),
        }
    }

    /// Returns the CRS that is given for all inputs, if one is.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Named`] if it is neither a known code nor a file of text.
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
            let unknown =
                || wrong("is not a known code; give a file of well-known text instead".into());
            return known.map(Some).ok_or_else(unknown);
        }
        let content = std::fs::read_to_string(text).map_err(|e| {
            wrong(format!(
                "is neither EPSG:… nor a file that can be read: {e}"
            ))
        })?;
        Ok(Some(Crs::Wkt(content.trim().to_owned())))
    }

    fn tile_format(&self) -> Result<TileFormat, ConfigError> {
        match (self.format, self.output_tiles) {
            (Some(_), None) => Err(ConfigError::Words(
                "--format is that of tiles; give --output-tiles, too, or choose the format of one file by its name"
                    .into(),
            )),
            (format, _) => Ok(format.unwrap_or_default()),
        }
    }

    /// Returns the order of the points in the output.
    fn order(&self) -> Result<PointOrder, ConfigError> {
        let order = self.order.unwrap_or_default();
        let words = |words: &str| Err(ConfigError::Words(words.into()));
        match order {
            PointOrder::Progressive if self.mesh.is_some() => words(
                "--order progressive does not go with --mesh: with a mesh, the points of the cloud stand in the order of \
                 its vertices; run the job twice, once with each",
            ),
            PointOrder::Progressive if self.output_tiles.is_some() => words(
                "--order progressive is for one file; leave out --output-tiles, or write .copc.laz, whose octree has \
                 levels",
            ),
            order => Ok(order),
        }
    }

    /// Checks that the options of PCD files are given only if the output is PCD.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Words`] if one is given, and the output is not.
    pub(crate) fn check_pcd(&self, is_pcd: bool) -> Result<(), ConfigError> {
        let says_how = self.pcd.is_some() || self.pcd_origin.is_some();
        match says_how && !is_pcd {
            true => Err(ConfigError::Words(
                "--pcd and --pcd-origin say how PCD is written; name the output .pcd, or give --output-tiles with --format \
                 pcd"
                    .into(),
            )),
            false => Ok(()),
        }
    }

    fn pcd_origin(&self) -> Result<PcdOrigin, ConfigError> {
        let Some(text) = &self.pcd_origin else {
            return Ok(PcdOrigin::Near);
        };
        if text.eq_ignore_ascii_case("mgrs") {
            return Ok(PcdOrigin::Mgrs);
        }
        match text
            .parse::<Places>()
            .as_ref()
            .map(|places| places.0.as_slice())
        {
            Ok(&[place]) => Ok(PcdOrigin::At(place)),
            _ => Err(ConfigError::Named {
                option: "--pcd-origin",
                value: text.clone(),
                problem: "is neither mgrs nor a place like 431000,5400000,0".into(),
            }),
        }
    }

    fn mesh_settings(&self) -> Result<Option<MeshSettings>, ConfigError> {
        if self.scanner.is_some() && self.trajectory.is_some() {
            return Err(ConfigError::Words(
                "--scanner and --trajectory both say where the scanner was; give one".into(),
            ));
        }
        let is_for_mesh_alone = self.transients != Some(TransientRule::Drop);
        let says_how = self.mesh_of.is_some()
            || self.scanner.is_some()
            || self.trajectory.is_some() && is_for_mesh_alone;
        if self.mesh.is_none() && says_how {
            return Err(ConfigError::Words(
                "--mesh-of, --scanner and --trajectory say how a mesh is made; give --mesh, too (--trajectory goes with \
                 --transients drop as well)"
                    .into(),
            ));
        }
        Ok(self.mesh.as_ref().map(|_| MeshSettings {
            points: self.mesh_of.unwrap_or_default(),
            scanners: self
                .scanner
                .clone()
                .map_or_else(Vec::new, |places| places.0),
            trajectory: self.trajectory.clone(),
        }))
    }

    fn transient_settings(&self, unit: CrsUnit) -> Result<Option<TransientSettings>, ConfigError> {
        match (self.transients.unwrap_or_default(), &self.trajectory) {
            (TransientRule::Keep, _) => Ok(None),
            (TransientRule::Drop, None) => Err(ConfigError::Words(
                "--transients drop has to know from where each point was seen; give --trajectory, a file with the time and \
                 place of the scanner"
                    .into(),
            )),
            (TransientRule::Drop, Some(trajectory)) => Ok(Some(TransientSettings {
                trajectory: trajectory.clone(),
                voxel_edge: VOXEL_EDGE / unit.metres.unwrap_or(1.0),
            })),
        }
    }

    fn attributes(&self) -> AttributeSettings {
        let mut with = self.with.clone().unwrap_or_default();
        if self.mesh.is_some() {
            // The normals of the cloud are those of its mesh.
            with.push(Computed::Normals);
        }
        with.sort_unstable();
        with.dedup();
        AttributeSettings {
            color: self.color.unwrap_or_default(),
            class: self.class.unwrap_or_default(),
            with,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spacing::Target;

    #[test]
    fn a_spacing_that_is_no_length_is_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let error = Choices::with_spacing(bad).settings(None).unwrap_err();
            assert!(error.to_string().starts_with("--spacing"), "{error}");
        }
    }

    #[test]
    fn units_are_those_of_the_crs() {
        let choices = Choices {
            spacing: "0.2ft".parse().ok(),
            fill: Some(Length::plain(3.0)),
            ..Choices::default()
        };
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
}
