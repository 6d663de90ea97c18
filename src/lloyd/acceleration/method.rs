//! The accelerations to choose from.

use serde::{Deserialize, Serialize};

/// How an iteration leads from the centroids to the next positions of the sites.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Acceleration {
    /// Plain Lloyd: every site moves to its centroid (paper, section IV-B).
    None,
    /// Over-relaxation: every site moves beyond its centroid, with a local safeguard.
    #[default]
    Relaxation,
    /// Anderson mixing with a uniformity check, both by neighbourhood. The result depends on the tiling a little: a comparison
    /// decides for a whole block, and the last bit of a number can turn it.
    Anderson,
    /// Anderson mixing with a uniformity check, both of all sites at once: the paper's section
    /// IV-C to the letter. The result depends on the tiling.
    AndersonGlobal,
}

impl Acceleration {
    /// Whether the state of a site says all that the next iteration knows of the last: Anderson
    /// mixing remembers whole blocks.
    pub(crate) fn has_rounds(self) -> bool {
        matches!(self, Self::None | Self::Relaxation)
    }
}
