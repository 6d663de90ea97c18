//! The figures of any cloud, by parts that fit in memory: what `lloydar measure` reports.
//!
//! The cloud and the scans it is compared with are scattered into one spill of bare coordinates
//! with a mark of their cloud, so that each part contains both.

mod cloud_spacing;
mod cloud_tally;
mod far_neighbors;
mod marked_points;
mod measured_cloud;
mod measurement;
mod parts;
mod surface_distances;

pub(crate) use measured_cloud::{Measured, measure};
pub(crate) use surface_distances::measure_against_surface;
