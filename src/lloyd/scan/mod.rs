//! The scan as the solver sees it: its points by voxel, thinned, smoothed and with its holes
//! closed, and one sample for each voxel.

mod filling;
mod nearest;
mod points;
mod preparation;
mod smoothing;
mod surroundings;
mod thinned;
mod thinning;
mod voxel;
mod voxel_points;

pub use points::Scan;
pub(crate) use thinned::{PointSum, PointTag, ThinnedPoints};
pub(crate) use thinning::Thinning;
pub(crate) use voxel_points::{PointsByIndex, VoxelPoints};
