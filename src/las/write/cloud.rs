//! What a cloud is written with: the contents of its header, and the means to sort it.

use std::sync::Arc;

use ::las::Vlr;

use super::{
    pcd_options::PcdOptions,
    point_order::PointOrder,
    store::{RecordSorter, SortingSpace},
};
use crate::{
    geometry::Quantization,
    las::{
        error::LasError,
        format::{crs::Crs, record_format::RecordFormat},
    },
    tiling::CellGrid,
};

/// The edge of the cells by which points are sorted first, in spacings.
const SORTING_CELL_IN_SPACINGS: f64 = 512.0;

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

/// What a writer needs that sorts its points.
#[derive(Clone, Debug)]
pub(crate) struct Workspace {
    /// The approximate distance of neighbouring points (CRS units).
    pub(crate) spacing: f64,
    /// The edge of the tiles (CRS units), if tiles are written.
    pub(crate) tile_edge: f64,
    /// How PCD files are written.
    pub(crate) pcd: PcdOptions,
    /// The order of the points in LAS, LAZ and PLY files.
    pub(crate) order: PointOrder,
    /// The space for temporary files.
    pub(crate) sorting: Arc<dyn SortingSpace>,
    /// The memory for points that are sorted, in bytes.
    pub(crate) sort_bytes: usize,
}

impl Workspace {
    /// Begins to sort the records of a cloud with this `header`.
    ///
    /// # Errors
    ///
    /// If no temporary file can be made.
    pub(super) fn begin_sorting(
        &self,
        header: &CloudHeader,
        path: &std::path::Path,
    ) -> Result<Box<dyn RecordSorter>, LasError> {
        let cell = header
            .quantization
            .units(SORTING_CELL_IN_SPACINGS * self.spacing);
        self.sorting
            .begin("octree", CellGrid::new(cell), header.record.record_length())
            .map_err(|e| LasError::unwritable(path, e))
    }
}
