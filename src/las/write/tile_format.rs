//! The formats of tiles.

use serde::{Deserialize, Serialize};

/// The format of the tiles of an output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum TileFormat {
    /// Compressed LAS.
    #[default]
    Laz,
    /// PCD, with an index for driving software beside them.
    Pcd,
}

impl TileFormat {
    /// All formats.
    pub(super) const ALL: [Self; 2] = [Self::Laz, Self::Pcd];

    /// The ending of the names of tiles.
    pub(super) fn ending(self) -> &'static str {
        match self {
            Self::Laz => ".laz",
            Self::Pcd => ".pcd",
        }
    }
}
