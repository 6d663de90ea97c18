//! What becomes of the sites next to a sharp edge.

use serde::{Deserialize, Serialize};

/// Where sites next to a sharp edge end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum EdgeRule {
    /// On the surfaces that meet there, as evenly as elsewhere.
    #[default]
    Free,
    /// On the edge itself, as far apart as the output is elsewhere, so that a mesh keeps it.
    On,
}

/// Sites nearer to an edge than this are moved onto it. Of sites as dense as the hexagonal lattice one lies within
/// 0.433 spacings of a line for each spacing of its length.
const CAPTURE_IN_SPACINGS: f64 = 0.42;

impl EdgeRule {
    /// Whether this is the default, which records do not state.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Distance (CRS units) from an edge within which sites are moved onto it, at a `spacing`.
    pub(super) fn capture(self, spacing: f64) -> f64 {
        match self {
            Self::Free => 0.0,
            Self::On => CAPTURE_IN_SPACINGS * spacing,
        }
    }
}
