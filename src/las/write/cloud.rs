//! What a cloud is written with: the contents of its header, and the means to sort it.

use std::sync::Arc;

use ::las::Vlr;

use super::{pcd_options::PcdOptions, pieces::Workforce, store::SortingSpace};
use crate::{
    geometry::Quantization,
    las::format::{crs::Crs, record_format::RecordFormat},
};

/// What the header of an output says.
#[derive(Clone, Debug)]
pub(crate) struct CloudHeader {
    /// The format of the records.
    pub(crate) record: RecordFormat,
    /// The scale and the offset.
    pub(crate) quantization: Quantization,
    /// The coordinate reference system.
    pub(crate) crs: Option<Crs>,
    /// The variable length records of the inputs that are as true of the output.
    pub(crate) carried_records: Vec<Vlr>,
    /// Whether GPS times are adjusted standard times.
    pub(crate) has_standard_time: bool,
    /// How the cloud was made, as JSON.
    pub(crate) provenance: String,
}

/// What is needed to write a cloud whose points are sorted.
#[derive(Clone)]
pub(crate) struct Workspace<'a> {
    /// The approximate distance of neighbouring points (CRS units).
    pub(crate) spacing: f64,
    /// The edge of the tiles (CRS units), if tiles are written.
    pub(crate) tile_edge: f64,
    /// How PCD files are written.
    pub(crate) pcd: PcdOptions,
    /// The largest value of a colour.
    pub(crate) brightest: u16,
    /// The space for temporary files.
    pub(crate) sorting: Arc<dyn SortingSpace>,
    /// The process or the processes that do the work.
    pub(crate) workforce: &'a dyn Workforce,
    /// The memory for points that are sorted, in bytes.
    pub(crate) sort_bytes: usize,
}
