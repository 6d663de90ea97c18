//! What the points of a spill are asked for where the spacing of the output varies.

use std::fmt::Debug;

use crate::{geometry::Stored, lloyd::PointTag};

/// Rules for the spacing that is wanted at the points of a spill.
pub(crate) trait SpacingRules: Debug + Send + Sync {
    /// What the rules that look at one point alone say of the point of `record`.
    fn tag(&self, record: &[u8]) -> PointTag;

    /// The spacing that is wanted at each of `points`, as a share of the coarsest `spacing` (CRS units), by their `tags` and
    /// by the points around each. The order of the points does not show in it.
    fn shares(&self, points: &[Stored], tags: &[PointTag], spacing: f64) -> Vec<f32>;
}
