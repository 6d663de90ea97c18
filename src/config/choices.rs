//! Options of a job as written.

use std::path::PathBuf;

use serde::{Deserialize, Deserializer, Serialize};

use super::{
    length::Length,
    places::Places,
    quantity::{Bytes, Count, Share},
    rectangle::Sides,
    rules::{ClassRule, ColorRule, Computed},
};
use crate::{
    geometry::PatchKind,
    las::{OctreeLevels, PcdEncoding, PointOrder, ReprojectionTarget, TileFormat},
    lloyd::{Acceleration, EdgeRule, IsolatedRule, SeedRule},
    mesh::MeshedPoints,
};

/// What the job does about an input that cannot be read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum OnBadFile {
    /// The job fails and names all such inputs.
    #[default]
    Stop,
    /// The job leaves the input out and says so in its report.
    Skip,
}

/// What becomes of points that one pass saw and others looked through.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum TransientRule {
    /// They stay.
    #[default]
    Keep,
    /// They are left out.
    Drop,
}

/// Reads one text, or a list of them.
fn texts<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Vec<String>>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a text in quotes, or a list of texts")]
    enum Texts {
        One(String),
        Several(Vec<String>),
    }
    Ok(Some(match Texts::deserialize(from)? {
        Texts::One(text) => vec![text],
        Texts::Several(texts) => texts,
    }))
}

/// Options of a job as written: a configuration file, one field to an option, under the names
/// of the flags without their dashes. `None` stands for an option that is not given.
///
/// The fields are not grouped: a file is flat, and an unknown name in it must be refused,
/// which serde does for a flat struct only.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", default)]
pub(crate) struct Choices {
    /// The spacing of the output.
    pub(crate) spacing: Option<Length>,
    /// The number of points of the output.
    pub(crate) count: Option<Count>,
    /// The number of points of the output over that of the input.
    pub(crate) ratio: Option<Share>,
    /// Whether the count is met exactly.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) exact: bool,
    /// The file with rules for the spacing.
    pub(crate) density: Option<PathBuf>,
    /// Short rules for the spacing, separated by commas in one text or several.
    #[serde(deserialize_with = "texts")]
    pub(crate) spacing_of: Option<Vec<String>>,
    /// How many times as long a cell may be as its neighbour.
    pub(crate) gradation: Option<f64>,
    /// The peak memory.
    pub(crate) memory: Option<Bytes>,
    /// The number of worker threads.
    pub(crate) threads: Option<usize>,
    /// The job directory.
    pub(crate) job: Option<PathBuf>,
    /// Whether the job directory stays after success.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) keep_job: bool,
    /// The number of Lloyd iterations.
    pub(crate) iterations: Option<u32>,
    /// How centroids are extrapolated.
    pub(crate) accelerate: Option<Acceleration>,
    /// The rule by which seeds are chosen.
    pub(crate) seeds: Option<SeedRule>,
    /// The kind of surface that is fitted near each site.
    pub(crate) patch: Option<PatchKind>,
    /// How far from the scan a point may move.
    pub(crate) restrict: Option<Length>,
    /// The radius of the surface fit.
    pub(crate) smooth: Option<Length>,
    /// The width of the widest hole to close.
    pub(crate) fill: Option<Length>,
    /// Where points next to a sharp edge end.
    pub(crate) edges: Option<EdgeRule>,
    /// What becomes of isolated returns.
    pub(crate) isolated: Option<IsolatedRule>,
    /// The edge of square tiles.
    pub(crate) tile_size: Option<Length>,
    /// The width of the halo of a tile.
    pub(crate) halo: Option<Length>,
    /// The seed of every hash.
    pub(crate) seed: Option<u64>,
    /// The classes to keep.
    pub(crate) keep_class: Option<Vec<u8>>,
    /// The classes to leave out.
    pub(crate) drop_class: Option<Vec<u8>>,
    /// Whether points with the flag "withheld" are left out.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) drop_withheld: bool,
    /// The rectangle whose points are kept.
    pub(crate) bounds: Option<Sides>,
    /// The file of polygons whose points are kept.
    pub(crate) polygon: Option<PathBuf>,
    /// What becomes of points that one pass saw and others looked through.
    pub(crate) transients: Option<TransientRule>,
    /// The CRS of all inputs: a code, or a file of well-known text.
    pub(crate) crs: Option<String>,
    /// The CRS to which the inputs are reprojected.
    pub(crate) reproject: Option<ReprojectionTarget>,
    /// Which levels of octrees are read.
    pub(crate) levels: Option<OctreeLevels>,
    /// Where colour, near infrared and intensity are taken from.
    pub(crate) color: Option<ColorRule>,
    /// Where the class is taken from.
    pub(crate) class: Option<ClassRule>,
    /// Attributes to compute.
    pub(crate) with: Option<Vec<Computed>>,
    /// The edge of the tiles that are written.
    pub(crate) output_tiles: Option<Length>,
    /// The format of the tiles that are written.
    pub(crate) format: Option<TileFormat>,
    /// The order of the points in the output.
    pub(crate) order: Option<PointOrder>,
    /// The encoding of PCD files.
    pub(crate) pcd: Option<PcdEncoding>,
    /// The place with the coordinates 0, 0, 0 in PCD files.
    pub(crate) pcd_origin: Option<String>,
    /// The file for a mesh of the output.
    pub(crate) mesh: Option<PathBuf>,
    /// Which points have triangles.
    pub(crate) mesh_of: Option<MeshedPoints>,
    /// The places where scanners stood.
    pub(crate) scanner: Option<Places>,
    /// The file with the way of a moving scanner.
    pub(crate) trajectory: Option<PathBuf>,
    /// What the job does about inputs that cannot be read.
    pub(crate) on_bad_file: Option<OnBadFile>,
    /// Whether an existing output is replaced.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub(crate) overwrite: bool,
}

#[cfg(test)]
impl Choices {
    /// The choice of a spacing alone, in CRS units.
    pub(super) fn with_spacing(spacing: f64) -> Self {
        Self {
            spacing: Some(Length::plain(spacing)),
            ..Self::default()
        }
    }
}
