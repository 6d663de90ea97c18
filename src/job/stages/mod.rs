//! The stages of a job. Each leaves files in the job directory that the next one reads.
//!
//! ```text
//!   preparation   survey ─► scatter ─► spacing ─► plan
//!   solve         tile by tile: load, solve, transfer attributes
//!   output        stitch ─► write ─► mesh ─► sort ─► views
//! ```

mod all_points;
mod cell_attributes;
mod checksums;
pub(crate) mod cloud_header;
mod cloud_output;
mod compatibility;
mod cut_tiles;
pub(crate) mod density;
mod input_counts;
mod input_parts;
mod mesh;
mod mesh_cells;
mod mesh_ordering;
mod mesh_parts;
mod mesh_source;
pub(crate) mod mesh_tiles;
mod no_points;
mod ordered_points;
pub(crate) mod output;
mod pcd_precision;
pub(crate) mod plan;
pub(crate) mod planned_job;
pub(crate) mod preparation;
mod provenance;
mod reprojection;
mod round_spacings;
mod sampled_spill;
pub(crate) mod scan_groups;
mod scanner_way;
pub(crate) mod scatter;
mod scattered_cloud;
pub(crate) mod solve;
mod spacing;
pub(crate) mod stitch;
pub(crate) mod stitchers;
pub(crate) mod survey;
mod tile_costs;
pub(crate) mod tile_solver;
pub(crate) mod transfer;
mod transients;
pub(crate) mod views;
pub(crate) mod write;

pub(crate) use input_counts::InputCount;
