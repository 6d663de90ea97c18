//! The order of the points in a file.

use serde::{Deserialize, Serialize};

/// The order of the points in a LAS, LAZ or PLY file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum PointOrder {
    /// Near points stand near each other in the file: tile by tile, or as the format sorts them.
    #[default]
    Nearby,
    /// The first points of the file, however many, are a coarser cloud.
    Progressive,
}
