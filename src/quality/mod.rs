//! The quality of a cloud: figures of uniformity, accuracy and coverage.
//!
//! Tallies take one site at a time and have a fixed number of bins, whatever
//! the size of the cloud; they can be added, part by part.

mod deviation;
mod distances;
mod spacings;
mod surroundings;
mod uniformity;

pub(crate) use deviation::{DistanceSums, delta_squared};
pub use distances::{DistanceFigures, DistanceTally};
pub(crate) use spacings::{SpacingClass, SpacingTally};
pub(crate) use surroundings::{SumsBySurroundings, Surroundings};
pub(crate) use uniformity::HEXAGON_ENERGY;
pub use uniformity::{CellFigures, Uniformity, UniformityTally};
