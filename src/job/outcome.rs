//! The outcome of a job: everything that the report says.

use serde::Serialize;

use super::{
    resources::{ResourceSample, StageCost},
    stages::{InputCount, plan::JobPlan, views::ResultViews, write::Stitched},
    tile_figures::TileFigures,
};
use crate::{
    las::{CloudLevels, NearestFigures, PointOrder},
    lloyd::IsolatedRule,
    mesh::MeshFigures,
    quality::{Uniformity, UniformityTally},
    transients::TransientCounts,
};

/// The outcome of a job.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The plan.
    pub(crate) plan: JobPlan,
    /// Numbers of points of each input.
    pub(crate) inputs: Vec<InputCount>,
    /// Figures of each tile, in the order of the plan.
    pub(crate) tiles: Vec<TileFigures>,
    /// Figures of the whole cloud, across seams.
    pub(crate) stitched: Stitched,
    /// The cloud that was written.
    pub(crate) written: WrittenCloud,
    /// The figures of the mesh, if one was written.
    pub(crate) mesh: Option<MeshFigures>,
    /// The coarser levels of a mesh in tiles.
    pub(crate) mesh_levels: Vec<MeshLevel>,
    /// Pictures and samples of input and output.
    pub(crate) views: ResultViews,
    /// Time, memory and disk of the run, once it has ended.
    pub(crate) costs: RunCosts,
    /// What became of the isolated returns.
    pub(crate) isolated: IsolatedRule,
    /// How many points were left out because one pass saw them and others looked through, if that was asked for.
    pub(crate) transients: Option<TransientCounts>,
    /// Facts about inputs and points that are worth a line.
    pub(crate) notes: Vec<String>,
}

impl Outcome {
    /// Number of points of the output.
    pub fn points(&self) -> u64 {
        self.written.points
    }

    /// Whether the output has the number of points that was asked for, if that is to be met exactly.
    pub(crate) fn meets_count(&self, is_exact: bool) -> bool {
        !is_exact || self.points() == self.plan.points_out
    }

    /// Spacing of the output (CRS units).
    pub fn spacing(&self) -> f64 {
        self.plan.spacing
    }

    /// Uniformity of the output: distances as written, across seams, and cells as their tiles saw them.
    pub fn uniformity(&self) -> Uniformity {
        let mut cells = UniformityTally::new(self.plan.spacing);
        for tile in &self.tiles {
            cells.add(&tile.uniformity());
        }
        self.stitched.all.figures().with_cells_of(&cells.figures())
    }
}

/// Size and tiles of a cloud that was written.
#[derive(Clone, Debug)]
pub(crate) struct WrittenCloud {
    /// Number of points.
    pub(crate) points: u64,
    /// Length of the file in bytes.
    pub(crate) bytes: u64,
    /// δ of the points of each tile, in the order of the plan.
    pub(crate) delta_by_tile: Vec<f64>,
    /// The figures of its levels, if it has any.
    pub(crate) levels: Option<ReportedLevels>,
}

/// The figures of the levels of an octree but the last, each with those above it, or of the beginnings of a file in
/// progressive order. Lengths are CRS units.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct ReportedLevels {
    /// What the levels are.
    pub(crate) order: PointOrder,
    /// The figures of each level or beginning.
    pub(crate) figures: Vec<NearestFigures>,
}

impl ReportedLevels {
    /// The figures of `levels`.
    pub(crate) fn of(levels: &CloudLevels) -> Self {
        Self {
            order: levels.order,
            figures: levels.figures.clone(),
        }
    }
}

/// A coarser level of a mesh in tiles.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct MeshLevel {
    /// The spacing of its points (CRS units).
    pub(crate) spacing: f64,
    /// The number of points.
    pub(crate) points: u64,
    /// The number of triangles.
    pub(crate) triangles: u64,
    /// The number of tiles.
    pub(crate) tiles: u64,
}

/// Time, memory and disk of a run.
#[derive(Clone, Debug, Default)]
pub(crate) struct RunCosts {
    /// Time and memory of each stage.
    pub(crate) stages: Vec<StageCost>,
    /// Memory and temporary files over time.
    pub(crate) samples: Vec<ResourceSample>,
}
