//! From input files to records of the run.
//!
//! ```text
//!   arguments ─► survey (headers) ─► parts ─► streams: decode, convert, filter
//! ```

pub(super) mod arguments;
mod bounds;
mod byte_ranges;
mod catalogue;
mod chunk_reader;
pub(super) mod counts;
mod decoder;
#[cfg(feature = "e57")]
mod e57;
mod geometry_file;
pub(super) mod guard;
pub(super) mod input;
mod las_reader;
mod las_survey;
pub(super) mod line_filter;
pub(super) mod list;
pub(super) mod octree_nodes;
mod parts;
mod placement;
pub(super) mod ply;
mod ply_header;
pub(super) mod point_filter;
pub(super) mod polygon_filter;
mod run_format;
pub(super) mod stream;
mod survey;
pub(super) mod trajectory;
mod vertex_survey;
