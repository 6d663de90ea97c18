//! The figures of one tile, which are written beside its result.

use serde::{Deserialize, Serialize};

use crate::{
    geometry::Stored,
    quality::{DistanceTally, SumsBySurroundings, UniformityTally},
    tiling::Tile,
};

/// The figures of one tile. Lengths are CRS units.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct TileFigures {
    /// The tile.
    pub(crate) tile: Tile,
    /// Seconds from the points of the tile in memory to its result on the disk.
    pub(crate) seconds: f64,
    /// Number of sites at home in the core.
    pub(crate) sites: u64,
    /// Number of these sites that never left the position of their seed.
    #[serde(rename = "held")]
    pub(crate) fixed: u64,
    /// Number of these sites for which the tile contained every point that they depend on.
    pub(crate) exact: u64,
    /// The identities of the isolated seeds in the core, whatever became of them.
    pub(crate) isolated: Vec<Stored>,
    /// Nearest distances among points of the input, of approximately as many as there are sites.
    pub(crate) input: UniformityTally,
    /// Uniformity of the seeds.
    pub(crate) seeds: UniformityTally,
    /// Uniformity of the sites where the scan describes a surface.
    pub(crate) on_surfaces: UniformityTally,
    /// Uniformity of the others: on leaves, wires and clutter.
    pub(crate) elsewhere: UniformityTally,
    /// Distances of the sites to their nearest input points.
    pub(crate) accuracy: DistanceTally,
    /// Distances of input points to their nearest sites.
    pub(crate) coverage: DistanceTally,
    /// Sums of the nearest distances at the start of every iteration, and after the last one.
    pub(crate) convergence: Vec<SumsBySurroundings>,
}

impl TileFigures {
    /// Uniformity of all sites.
    pub(crate) fn uniformity(&self) -> UniformityTally {
        let mut all = self.on_surfaces.clone();
        all.add(&self.elsewhere);
        all
    }
}
