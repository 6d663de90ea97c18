//! The figures of any cloud: what `lloydar measure` reports.
//!
//! The cloud is scattered into a spill of bare coordinates, and its uniformity is measured by parts that fit in memory.
//! For a comparison with scans the cloud is held in memory, and the scans pass by it once.

mod bare_points;
mod cloud_spacing;
mod cloud_tally;
mod comparison_plan;
mod far_neighbors;
mod measured_cloud;
mod measurement;
mod parts;
mod scan_comparison;
mod surface_distances;

pub(crate) use measured_cloud::{Measured, measure};
pub(crate) use surface_distances::measure_against_surface;
