//! From records of the run to files that are complete under their names or not there at all.
//!
//! LAS, LAZ and COPC are version 1.4 with the run's point format; PLY is binary, little
//! endian, with the attributes that its readers know. LAS, LAZ and PLY are written in the
//! order of the records; COPC, PCD and tiles are written of records that are sorted in temporary files.

pub(super) mod cloud;
pub(super) mod cloud_levels;
mod columns;
mod copc;
mod copc_nodes;
pub(super) mod create;
mod election;
mod kept_set;
mod las;
mod las_header;
mod leveled_records;
mod lzf;
pub(super) mod mesh;
pub(super) mod nearest_figures;
mod nested_sets;
mod node_bytes;
mod octree;
mod ordered_records;
pub(super) mod output_format;
mod part_file;
mod pcd;
pub(super) mod pcd_fields;
pub(super) mod pcd_options;
mod pcd_tiles;
pub(super) mod pieces;
mod ply;
pub(super) mod point_order;
mod point_set;
mod progressive;
mod radius_search;
mod sink;
pub(super) mod squares;
pub(super) mod store;
#[cfg(test)]
mod stored_in_memory;
mod tile_catalogue;
pub(super) mod tile_format;
mod tile_names;
mod tiles;
pub(super) mod writer;
