//! What becomes of the sites next to a sharp edge.

use serde::{Deserialize, Serialize};

/// Where sites next to a sharp edge end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum EdgeRule {
    /// On the fitted patches, which round an edge a little.
    #[default]
    Smooth,
    /// On the planes that meet there, where planes describe the scan better than a patch does.
    Sharp,
    /// As with `Sharp`, and those next to the edge on the edge itself, as far apart as the output is elsewhere, so that a mesh keeps it.
    On,
}

/// Sites nearer to an edge than this are moved onto it where there is room. Of sites as dense as the hexagonal lattice one lies
/// within 0.433 spacings of a line for each spacing of its length; but where the lattice has its rows at right angles to the
/// line, every other one of them can be half a spacing away.
const CAPTURE_IN_SPACINGS: f64 = 0.7;

impl EdgeRule {
    /// Whether this is the default, which records do not state.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Distance (CRS units) from an edge within which sites are moved onto it, at a `spacing`; `None` if patches may round
    /// edges.
    pub(super) fn capture(self, spacing: f64) -> Option<f64> {
        match self {
            Self::Smooth => None,
            Self::Sharp => Some(0.0),
            Self::On => Some(CAPTURE_IN_SPACINGS * spacing),
        }
    }
}
