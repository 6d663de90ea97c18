//! Options of a job as meant.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{
    density::DensitySettings,
    rules::{ClassRule, ColorRule, Computed},
};
use crate::{
    las::{Crs, OctreeLevels, PcdOptions, PointFilter, PointOrder, ReprojectionTarget, TileFormat},
    lloyd::{SolverSettings, WantedCount},
    mesh::MeshedPoints,
    spacing::Target,
};

/// Options of a job as meant: complete, and within their ranges. Lengths are CRS units.
///
/// The record of how a cloud was made, which every cloud carries, has them as JSON. There the
/// groups do not show: all options stand side by side, under the names of their fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Settings {
    /// How dense the output is to be.
    pub(crate) target: Target,
    /// The rules that the spacing follows; `None` stands for one spacing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) density: Option<DensitySettings>,
    /// Whether a count is met exactly.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub(crate) exact: bool,
    /// The memory and the threads that the job may use.
    #[serde(flatten)]
    pub(crate) resources: ResourceSettings,
    /// How each tile is solved.
    #[serde(flatten)]
    pub(crate) solver: SolverSettings,
    /// How the plane is cut into tiles.
    #[serde(flatten)]
    pub(crate) tiling: TilingSettings,
    /// Which points of the inputs take part, and where they lie.
    #[serde(flatten)]
    pub(crate) input: InputSettings,
    /// Which attributes the points of the output have.
    #[serde(flatten)]
    pub(crate) attributes: AttributeSettings,
    /// The edge of the tiles that are written; `None` stands for one file.
    pub(crate) output_tiles: Option<f64>,
    /// The format of the tiles that are written.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(crate) tile_format: TileFormat,
    /// The order of the points in the output.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(crate) order: PointOrder,
    /// How PCD files are written.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(crate) pcd: PcdOptions,
    /// How the mesh is made, if one is written beside the cloud.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) mesh: Option<MeshSettings>,
}

/// Whether an option has the value that it has where nothing is said.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The memory and the threads that a job may use. They do not change its output.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ResourceSettings {
    /// The peak memory in bytes; `None` stands for a share of what the machine has.
    pub(crate) memory: Option<u64>,
    /// The number of worker threads.
    pub(crate) threads: usize,
}

/// How the plane is cut into tiles. The default is chosen by the plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TilingSettings {
    /// The edge of square tiles; `None` stands for tiles that fit the memory.
    pub(crate) tile_size: Option<f64>,
    /// The width of the margin around the core of a tile whose points are read, too; `None`
    /// stands for the reach of the solver.
    pub(crate) halo: Option<f64>,
}

/// Which points of the inputs take part, and where they lie.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct InputSettings {
    /// Which points take part.
    pub(crate) filter: PointFilter,
    /// The CRS of all inputs; `None` stands for the one that they state.
    pub(crate) crs: Option<Crs>,
    /// The CRS to which the inputs are reprojected; `None` stands for their own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) reproject: Option<ReprojectionTarget>,
    /// Which levels of octrees are read.
    #[serde(default, skip_serializing_if = "is_default")]
    pub(crate) levels: OctreeLevels,
    /// How points are found that one pass saw and others looked through, if they are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) transients: Option<TransientSettings>,
}

/// How points are found that one pass saw and others looked through.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct TransientSettings {
    /// The file with the way of the scanner.
    pub(crate) trajectory: PathBuf,
    /// The edge of the voxels in which points are gathered.
    pub(crate) voxel_edge: f64,
}

/// Which attributes the points of the output have.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct AttributeSettings {
    /// Where colour, near infrared and intensity are taken from.
    pub(crate) color: ColorRule,
    /// Where the class is taken from.
    pub(crate) class: ClassRule,
    /// Attributes to compute, in order, each once.
    pub(crate) with: Vec<Computed>,
}

/// How the mesh of the output is made.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct MeshSettings {
    /// Which points have triangles.
    pub(crate) points: MeshedPoints,
    /// The places where scanners stood (world coordinates).
    pub(crate) scanners: Vec<[f64; 3]>,
    /// The file with the way of a moving scanner.
    pub(crate) trajectory: Option<PathBuf>,
}

impl Settings {
    /// The number of points that was asked for, which is `points_out`; `None` if a spacing was.
    pub(crate) fn wanted_count(&self, points_out: u64) -> Option<WantedCount> {
        self.target
            .wanted_count(points_out, self.exact, &self.solver)
    }
}

impl ResourceSettings {
    /// The value for records of the settings that decide the output of a job, which resources
    /// do not.
    pub(crate) const UNSTATED: Self = Self {
        memory: None,
        threads: 1,
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        Settings {
            target: Target::Spacing(0.25),
            density: None,
            exact: false,
            resources: ResourceSettings {
                memory: None,
                threads: 1,
            },
            solver: SolverSettings::default(),
            tiling: TilingSettings::default(),
            input: InputSettings::default(),
            attributes: AttributeSettings::default(),
            output_tiles: None,
            tile_format: TileFormat::default(),
            order: PointOrder::default(),
            pcd: PcdOptions::default(),
            mesh: None,
        }
    }

    #[test]
    fn groups_do_not_show_in_the_record_that_a_cloud_carries() {
        let text = serde_json::to_string(&settings()).unwrap();
        assert_eq!(text, DEFAULTS);
        assert_eq!(serde_json::from_str::<Settings>(&text).unwrap(), settings());
    }

    /// The default settings for a spacing of 0.25 as every version has written them.
    const DEFAULTS: &str = concat!(
        r#"{"target":{"spacing":0.25},"memory":null,"threads":1,"iterations":20,"#,
        r#""acceleration":"relaxation","seeds":"hexagonal","patch":"quadratic","#,
        r#""restriction":"local","smooth":null,"fill":null,"seed":0,"tile_size":null,"#,
        r#""halo":null,"filter":{"keep_classes":null,"drop_classes":[],"drop_withheld":false,"#,
        r#""bounds":null,"polygons":null},"crs":null,"color":"nearest","class":"nearest","#,
        r#""with":[],"output_tiles":null}"#,
    );
}
