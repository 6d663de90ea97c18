//! What stands where in the bytes of files and of records: every byte offset is here.

pub(super) mod attribute;
pub(super) mod chunk_table;
pub(super) mod conversion;
pub(super) mod copc;
pub(super) mod crs;
pub(super) mod display;
pub(super) mod extra_bytes;
pub(super) mod fields;
mod geotiff;
pub(super) mod header;
pub(super) mod ply;
pub(super) mod record;
pub(super) mod record_format;
pub(super) mod vertex_layout;
pub(super) mod vertex_properties;
pub(super) mod vertical;
pub(super) mod vlr;
mod wkt;
pub(super) mod wkt_node;
