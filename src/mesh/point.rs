//! A point of a cloud as the mesh sees it.

use crate::geometry::{Local, Stored};

/// A point of a cloud as the mesh sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeshPoint {
    /// The position.
    pub(crate) point: Stored,
    /// The unit normal, of either side; `None` where the scan describes no surface.
    pub(crate) normal: Option<Local>,
    /// The place from which the point was scanned (local coordinates), if it is known.
    pub(crate) scanner: Option<Local>,
    /// The index of the point in the whole cloud.
    pub(crate) index: u32,
    /// The part in which the point is at home.
    pub(crate) home: u32,
    /// The row and the column of the cell in which the point is. Parts consist of whole cells.
    pub(crate) cell: [i32; 2],
}
