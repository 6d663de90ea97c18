//! The options of a job as flags, in groups, and the choices that flags and a configuration
//! file make together.
//!
//! An option has the same name and the same notation in both, and a flag wins over the file.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::{Deserialize, Serialize};

use crate::{
    config::{
        Bytes, Choices, ClassRule, ColorRule, Computed, ConfigError, Count, Length, OnBadFile,
        Places, Share, Sides, TransientRule,
    },
    geometry::PatchKind,
    las::{OctreeLevels, PcdEncoding, PointOrder, ReprojectionTarget, TileFormat},
    lloyd::{Acceleration, EdgeRule, IsolatedRule, SeedRule},
    mesh::MeshedPoints,
};

/// Options of a job.
#[derive(Args, Clone, Debug, Default)]
pub(super) struct JobOptions {
    #[command(flatten)]
    density: DensityOptions,
    #[command(flatten)]
    resources: ResourceOptions,
    #[command(flatten)]
    solver: SolverFlags,
    #[command(flatten)]
    tiling: TilingOptions,
    #[command(flatten)]
    input: InputOptions,
    #[command(flatten)]
    attributes: AttributeOptions,
    #[command(flatten)]
    output: OutputOptions,
}

/// How dense the output is to be: exactly one of these.
#[derive(Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
struct DensityOptions {
    /// Spacing of the output: 0.05 (in CRS units), 5cm, 0.2ft
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    spacing: Option<Length>,
    /// Number of points of the output: 100K, 2M, 1500000
    #[arg(long, value_name = "N")]
    count: Option<Count>,
    /// Points of the output for each point of the input: 2% or 0.02
    #[arg(long, value_name = "SHARE")]
    ratio: Option<Share>,
    /// File with rules for the spacing, by class, attribute, area, line, height above ground or curvature;
    /// --spacing holds where no rule applies
    #[arg(long, value_name = "FILE")]
    density: Option<PathBuf>,
    /// Spacing of classes: class=2:0.5,6:0.1; of other points: intensity=0..100:5cm,
    /// height=0.3..4:0.1, polygon=site.geojson:0.1; the smallest holds
    #[arg(long, value_name = "RULES", value_delimiter = ',')]
    spacing_of: Option<Vec<String>>,
    /// How many times as long a cell may be as its neighbour where the spacing follows rules:
    /// 1.05 to 2 [default: 1.15]
    #[arg(long, value_name = "FACTOR")]
    gradation: Option<f64>,
    /// Meet --count or --ratio exactly [default: within 0.3 %]
    #[arg(long)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    exact: bool,
}

/// What the job may use of the machine.
#[derive(Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
struct ResourceOptions {
    /// Peak memory: 512MiB, 4GiB [default: ¾ of what the cgroup or machine allows]
    #[arg(long, value_name = "SIZE")]
    memory: Option<Bytes>,
    /// Worker threads [default: one per core]
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Directory for temporary files; a job found in it is resumed
    /// [default: OUT.job beside the output]
    #[arg(long, value_name = "DIR")]
    job: Option<PathBuf>,
    /// Keep the job directory after success
    #[arg(long)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    keep_job: bool,
}

/// How each tile is solved.
#[derive(Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
struct SolverFlags {
    /// Lloyd iterations [default: 20]
    #[arg(long, value_name = "K")]
    iterations: Option<u32>,
    /// Extrapolation of the iterations: none, relaxation, anderson or anderson-global; with the last
    /// two the points depend on the tiles a little [default: relaxation]
    #[arg(long, value_name = "METHOD", value_parser = by_name::<Acceleration>)]
    accelerate: Option<Acceleration>,
    /// Choice of the seeds: hexagonal, poisson, area or random [default: hexagonal]
    #[arg(long, value_name = "RULE", value_parser = by_name::<SeedRule>)]
    seeds: Option<SeedRule>,
    /// Surface that is fitted around each point: quadratic or plane [default: quadratic]
    #[arg(long, value_name = "KIND", value_parser = by_name::<PatchKind>)]
    patch: Option<PatchKind>,
    /// Greatest distance between a point of the output and the scan, one length for the whole
    /// cloud [default: the input's spacing around the point]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    restrict: Option<Length>,
    /// Radius of the surface fit: larger than the default smooths
    /// noise away first, smaller keeps finer detail [default: 1.2 spacings]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    smooth: Option<Length>,
    /// Width of the widest hole to close; 0 for none [default: 4 spacings of the output, or
    /// of the scan if that is coarser]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    fill: Option<Length>,
    /// Points at sharp edges: smooth, on fitted surfaces that round an edge a little; sharp, on the planes that
    /// meet there; or on, and those next to the edge on the edge itself [default: smooth]
    #[arg(long, value_name = "RULE", value_parser = by_name::<EdgeRule>)]
    edges: Option<EdgeRule>,
    /// Isolated returns, such as rain, birds and echoes: keep, drop, or mark (class 7, noise) [default: keep]
    #[arg(long, value_name = "RULE", value_parser = by_name::<IsolatedRule>)]
    isolated: Option<IsolatedRule>,
    /// Seed of every random choice [default: 0]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    seed: Option<u64>,
}

/// How the plane is cut into tiles.
#[derive(Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
struct TilingOptions {
    /// Edge of square tiles [default: by points and memory]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    tile_size: Option<Length>,
    /// Width of the margin around a tile's core whose points are read with it [default: by
    /// spacing, iterations and fit radius]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    halo: Option<Length>,
}

/// Which points of the inputs take part, and where they lie.
#[derive(Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
struct InputOptions {
    /// Classes to keep: 2,6 [default: all]
    #[arg(long, value_name = "CLASSES", value_delimiter = ',')]
    keep_class: Option<Vec<u8>>,
    /// Classes to leave out: 7,18
    #[arg(long, value_name = "CLASSES", value_delimiter = ',')]
    drop_class: Option<Vec<u8>>,
    /// Leave out points with the flag "withheld"
    #[arg(long)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    drop_withheld: bool,
    /// Keep only the points in a rectangle: xmin,ymin,xmax,ymax
    #[arg(long, value_name = "SIDES", allow_hyphen_values = true)]
    bounds: Option<Sides>,
    /// Keep only the points in the polygons of a file: well-known text or GeoJSON, in the CRS
    /// of the data
    #[arg(long, value_name = "FILE")]
    polygon: Option<PathBuf>,
    /// Cars and people that one pass saw and others looked through: keep, or drop, which needs GPS times and --trajectory
    /// [default: keep]
    #[arg(long, value_name = "RULE", value_parser = by_name::<TransientRule>)]
    transients: Option<TransientRule>,
    /// CRS of all inputs, in place of the one that their headers state: EPSG:32633, or a file
    /// of well-known text [default: the one that the headers state]
    #[arg(long, value_name = "CRS")]
    crs: Option<String>,
    /// CRS to which inputs are reprojected as they are read: EPSG:32633, or auto for the UTM zone of their middle; all
    /// lengths, --bounds and --polygon are in it [default: the one that the inputs have]
    #[arg(long, value_name = "CRS")]
    reproject: Option<ReprojectionTarget>,
    /// Levels of octrees (COPC) that are read: all, or auto, the upper ones that are dense enough for the spacing
    /// [default: all]
    #[arg(long, value_name = "LEVELS", value_parser = by_name::<OctreeLevels>)]
    levels: Option<OctreeLevels>,
    /// What to do with inputs that cannot be read: stop, or skip them and say so in
    /// the report [default: stop]
    #[arg(long, value_name = "POLICY", value_parser = by_name::<OnBadFile>)]
    on_bad_file: Option<OnBadFile>,
}

/// Which attributes the points of the output have.
#[derive(Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
struct AttributeOptions {
    /// Source of colour, near infrared and intensity: nearest (input point) or mean (of the
    /// input points that are nearer to this point of the output than to any other)
    /// [default: nearest]
    #[arg(long, value_name = "RULE", value_parser = by_name::<ColorRule>)]
    color: Option<ColorRule>,
    /// Source of the class: nearest (input point) or majority (of the input points that are
    /// nearer to this point of the output than to any other) [default: nearest]
    #[arg(long, value_name = "RULE", value_parser = by_name::<ClassRule>)]
    class: Option<ClassRule>,
    /// Extra attributes: normals, curvature, area, density, distance, spacing
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = by_name::<Computed>)]
    with: Option<Vec<Computed>>,
}

/// What becomes of the output.
#[derive(Args, Clone, Debug, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
struct OutputOptions {
    /// Write a directory of square tiles with this edge, and an index, in place of one
    /// file
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    output_tiles: Option<Length>,
    /// Format of the tiles: laz, or pcd with the index of Autoware [default: laz]
    #[arg(long, value_name = "FORMAT", value_parser = by_name::<TileFormat>)]
    format: Option<TileFormat>,
    /// Order of the points in .laz, .las and .ply: nearby, near points together; or progressive, so that the first points
    /// of the file, however many, are a coarser cloud [default: nearby]
    #[arg(long, value_name = "ORDER", value_parser = by_name::<PointOrder>)]
    order: Option<PointOrder>,
    /// Encoding of PCD files: binary or compressed [default: binary]
    #[arg(long, value_name = "ENCODING", value_parser = by_name::<PcdEncoding>)]
    pcd: Option<PcdEncoding>,
    /// Place with the coordinates 0, 0, 0 in PCD files, whose coordinates have 24 bits: x,y,z, or
    /// mgrs, the corner of the square of 100 km [default: near the middle if that is far]
    #[arg(long, value_name = "PLACE", allow_hyphen_values = true)]
    pcd_origin: Option<String>,
    /// Write a mesh of the points, too: .ply, .obj or .glb
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,
    /// Points that have triangles: surfaces, or all, on wires and leaves, too [default: surfaces]
    #[arg(long, value_name = "POINTS", value_parser = by_name::<MeshedPoints>)]
    mesh_of: Option<MeshedPoints>,
    /// Places where scanners stood, towards which the mesh looks: x,y,z or
    /// x,y,z;x,y,z [default: the poses of E57 scans, else it looks upwards, or outwards]
    #[arg(long, value_name = "PLACES", allow_hyphen_values = true)]
    scanner: Option<Places>,
    /// Way of a moving scanner, towards which the mesh looks, and from which --transients are found: a CSV file with the
    /// columns time, x, y, z, in the GPS time and the CRS of the inputs
    #[arg(long, value_name = "FILE")]
    trajectory: Option<PathBuf>,
    /// Replace an existing output
    #[arg(long)]
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    overwrite: bool,
}

/// Reads a choice between rules by the name that it has in a configuration file.
///
/// # Errors
///
/// A text that says that the name is unknown, and lists the names.
pub(super) fn by_name<T: for<'a> Deserialize<'a>>(name: &str) -> Result<T, String> {
    T::deserialize(serde::de::value::StrDeserializer::<serde::de::value::Error>::new(name))
        .map_err(|error| error.to_string())
}

/// Options by name, in the notation of a configuration file. Options that are not given are
/// missing.
pub(super) type OptionTable = toml::Table;

/// Returns the entries of `options`: flags of one group, or choices.
///
/// # Panics
///
/// Never: options are numbers, texts and lists.
pub(super) fn table(options: &impl Serialize) -> OptionTable {
    OptionTable::try_from(options).expect("options are numbers, texts and lists")
}

impl JobOptions {
    /// Returns the options that are given as flags.
    pub(super) fn table(&self) -> OptionTable {
        let groups = [
            table(&self.density),
            table(&self.resources),
            table(&self.solver),
            table(&self.tiling),
            table(&self.input),
            table(&self.attributes),
            table(&self.output),
        ];
        groups.into_iter().flatten().collect()
    }

    /// Returns the choices that these flags make together with `file`.
    ///
    /// # Errors
    ///
    /// The errors of [`choices_in`].
    pub(super) fn choices(&self, file: Option<&Path>) -> Result<Choices, ConfigError> {
        let of_file = match file {
            Some(path) => choices_in(path)?,
            None => Choices::default(),
        };
        Ok(merged(self.table(), table(&of_file)))
    }
}

/// Reads the choices in a TOML file.
///
/// # Errors
///
/// [`ConfigError::Read`] and [`ConfigError::Parse`], with the file's name.
pub(super) fn choices_in(path: &Path) -> Result<Choices, ConfigError> {
    let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read {
        path: path.display().to_string(),
        source,
    })?;
    toml::from_str(&text).map_err(|error| ConfigError::Parse {
        path: path.display().to_string(),
        message: error.to_string(),
    })
}

/// Returns the choices of `flags`, and those of `file` for options without a flag. A density
/// among the flags replaces that of the file, whichever of the three it is.
fn merged(flags: OptionTable, mut file: OptionTable) -> Choices {
    const DENSITIES: [&str; 3] = ["spacing", "count", "ratio"];
    if DENSITIES.iter().any(|name| flags.contains_key(*name)) {
        file.retain(|name, _| !DENSITIES.contains(&name));
    }
    file.extend(flags);
    file.try_into()
        .expect("flags and files have the same names and notations")
}

/// Returns the flags that make these choices, one word each.
pub(super) fn flags_of(choices: &Choices) -> Vec<String> {
    let text = |value: &toml::Value| match value {
        toml::Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let flag = |(name, value): (String, toml::Value)| match &value {
        toml::Value::Boolean(true) => Some(format!("--{name}")),
        toml::Value::Boolean(false) => None,
        toml::Value::Array(items) => {
            let items: Vec<String> = items.iter().map(text).collect();
            Some(format!("--{name}={}", items.join(",")))
        }
        one => Some(format!("--{name}={}", text(one))),
    };
    table(choices).into_iter().filter_map(flag).collect()
}

#[cfg(test)]
mod tests {
    use clap::FromArgMatches;

    use super::*;
    use crate::spacing::Target;

    fn parsed(text: &str) -> Choices {
        toml::from_str(text).unwrap()
    }

    fn from_flags(flags: &[String]) -> Choices {
        let options = JobOptions::augment_args(clap::Command::new("options").no_binary_name(true));
        let options = JobOptions::from_arg_matches(&options.get_matches_from(flags)).unwrap();
        options.choices(None).unwrap()
    }

    #[test]
    fn flags_make_the_choices_that_they_were_made_of() {
        let flags = [
            "--spacing=5cm",
            "--memory=1GiB",
            "--keep-class=2,6",
            "--with=normals,area",
            "--bounds=-1,-2,3.5,4",
            "--overwrite",
            "--patch=plane",
            "--ratio=2%",
            "--polygon=a b.wkt",
            "--density=rules.toml",
            "--spacing-of=class=2:0.5,6:0.1",
            "--spacing-of=height=-0.3..4:5cm",
            "--gradation=1.3",
        ];
        let choices = from_flags(&flags.map(str::to_owned));
        assert_eq!(from_flags(&flags_of(&choices)), choices);
    }

    #[test]
    fn flags_win_over_the_file() {
        let file = parsed("spacing = 0.05\nmemory = \"4GiB\"\nthreads = 8");
        let flags = parsed("count = \"2M\"\nthreads = 2");
        let settings = merged(table(&flags), table(&file)).settings(None).unwrap();
        assert_eq!(settings.target, Target::Count(2_000_000));
        assert_eq!(settings.resources.threads, 2);
        assert_eq!(settings.resources.memory, Some(4 << 30));
    }

    #[test]
    fn an_unknown_name_is_refused() {
        assert!(toml::from_str::<Choices>("spaceing = 1").is_err());
    }

    #[test]
    fn names_are_the_same_in_flags_and_file() {
        let options = JobOptions::augment_args(clap::Command::new("options"));
        let names: Vec<&str> = options
            .get_arguments()
            .filter_map(|o| o.get_long())
            .collect();
        assert_eq!(names.len(), 46);
        for name in names {
            let known = toml::from_str::<Choices>(&format!("{name} = {{}}"));
            let error = known.unwrap_err().to_string();
            assert!(!error.contains("unknown field"), "{error}");
        }
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
