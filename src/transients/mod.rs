//! What only one pass of a scanner saw, and others looked through: cars and people that have gone.
//!
//! ```text
//!   points ─► visits:  of each voxel, how many points it has, where, and from when to when they were seen
//!          ─► doubtful voxels:  those whose points are of one visit
//!   points with the scanner's place ─► sight lines:  how many passed by those points, in that visit and in others
//!          ─► verdict:  things whose points others looked through, as a whole
//! ```
//!
//! Two visits of a place are more than a minute apart. A sight line is the line from the scanner to a point that it
//! saw: what it passed on its way was not there, or has gaps. How many gaps a thing has is known from the visit that
//! saw it, so that a hedge, through which its own visit looked as well, needs many sight lines to be doubted, and a car few.
//!
//! Everything is counted in whole numbers, so that no order of the points and no number of threads shows in the result.

mod doubtful;
mod sight_line;
#[cfg(test)]
mod tests;
mod verdict;
mod visits;
mod voxel;

pub(crate) use doubtful::DoubtfulVoxels;
pub(crate) use sight_line::SightLine;
pub(crate) use verdict::{TransientCounts, TransientVoxels};
pub(crate) use visits::{Moment, Visits};
pub(crate) use voxel::{VOXEL_EDGE, VoxelGrid};
