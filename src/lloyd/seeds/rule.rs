//! The rules by which seeds are chosen.

use serde::{Deserialize, Serialize};

/// How seeds are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SeedRule {
    /// Nodes of hexagonal lattices on the surfaces, then points of the scan that are not too
    /// near to a seed, until a seed covers every point.
    #[default]
    Hexagonal,
    /// Poisson-disk election: points of the scan in the order of a hash (dart throwing).
    Poisson,
    /// Random points of the scan, then in the cell of each as many seeds as its area owes
    /// (paper, section IV-A).
    Area,
    /// Random points of the scan: the paper's baseline.
    Random,
}

impl SeedRule {
    /// Whether seeds are elected. Those of the other rules start in clumps, and spread as their cells let them.
    pub(crate) fn is_election(self) -> bool {
        matches!(self, Self::Hexagonal | Self::Poisson)
    }
}
