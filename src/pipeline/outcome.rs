//! What a job did.

use super::{
    Excerpt, Field, Glimpse, Held, InputCount, JobPlan, StageCost, TileFigures, WorstPlace,
    writing::Stitched,
};

/// What a job did.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// What was planned.
    pub plan: JobPlan,
    /// Points of each input.
    pub inputs: Vec<InputCount>,
    /// Figures of each tile, in the order of the plan.
    pub tiles: Vec<TileFigures>,
    /// What the stitch found.
    pub stitched: Stitched,
    /// Nearest distances by tile, as written.
    pub delta_by_tile: Vec<f64>,
    /// Points written.
    pub points: u64,
    /// Bytes written.
    pub bytes: u64,
    /// One place before and after.
    pub glimpse: Glimpse,
    /// A square to be walked around.
    pub excerpt: Excerpt,
    /// What came out, as a picture in PNG.
    pub portrait: Vec<u8>,
    /// Figures square by square.
    pub field: Field,
    /// Where the output is least even.
    pub worst: Vec<WorstPlace>,
    /// What each stage took.
    pub stages: Vec<StageCost>,
    /// What was held over time.
    pub held: Vec<Held>,
    /// What is worth a line.
    pub notes: Vec<String>,
}
