//! What a job did.

use super::{InputCount, JobPlan, ResourceSample, StageCost, TileFigures, writing::Stitched};
use crate::views::{DetailView, UniformityMap, ViewerSample, WorstPlace};

/// What a job did.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// What was planned.
    pub(crate) plan: JobPlan,
    /// Points of each input.
    pub(crate) inputs: Vec<InputCount>,
    /// Figures of each tile, in the order of the plan.
    pub(crate) tiles: Vec<TileFigures>,
    /// What the stitch found.
    pub(crate) stitched: Stitched,
    /// Nearest distances by tile, as written.
    pub(crate) delta_by_tile: Vec<f64>,
    /// Points written.
    pub(crate) points: u64,
    /// Bytes written.
    pub(crate) bytes: u64,
    /// One place before and after.
    pub(crate) detail: DetailView,
    /// A square to be walked around.
    pub(crate) viewer_sample: ViewerSample,
    /// What came out, as a picture in PNG.
    pub(crate) overview: Vec<u8>,
    /// Figures square by square.
    pub(crate) uniformity_map: UniformityMap,
    /// Where the output is least even.
    pub(crate) worst: Vec<WorstPlace>,
    /// What each stage took.
    pub(crate) stages: Vec<StageCost>,
    /// What was held over time.
    pub(crate) held: Vec<ResourceSample>,
    /// What is worth a line.
    pub(crate) notes: Vec<String>,
}
