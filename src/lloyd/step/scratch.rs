//! Memory that a thread reuses from site to site.

use std::ops::Range;

use super::{
    neighborhoods::{NEAR_IN_SPACINGS, Neighborhoods},
    samples::Samples,
};
use crate::geometry::{Cell, Local, Neighbor};

/// Memory that a thread reuses from site to site of a block.
pub(crate) struct Scratch {
    /// The cell that was clipped last.
    pub(crate) cell: Cell,
    /// The neighbours of the site.
    pub(crate) neighbors: Vec<Neighbor>,
    /// The neighbours with which the cell of the site shared edges.
    pub(super) ring: Vec<Neighbor>,
    /// The neighbours that are in the way of a step.
    pub(super) in_the_way: Vec<Neighbor>,
    pub(super) samples: Samples,
    /// Whether the samples are those of the whole block.
    pub(super) has_samples: bool,
    /// The strays around the block.
    pub(super) strays: Vec<u32>,
    /// The strays that can cut a large cell of the block, once they are needed.
    pub(super) far_strays: Option<Vec<u32>>,
    /// The sites that stood around the block when the lists were made, once they are needed.
    pub(super) listed: Option<Vec<(u32, Local)>>,
    /// All sites within `reach` of the block.
    pub(super) sites: Vec<(u32, Local)>,
    /// Distance from the block within which `sites` is complete (CRS units).
    pub(super) reach: f64,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self {
            cell: Cell::new(),
            neighbors: Vec::new(),
            ring: Vec::new(),
            in_the_way: Vec::new(),
            samples: Samples::default(),
            has_samples: false,
            strays: Vec::new(),
            far_strays: None,
            listed: None,
            sites: Vec::new(),
            reach: 0.0,
        }
    }

    /// Prepares for the sites of `block`.
    pub(crate) fn begin(&mut self, neighborhoods: &Neighborhoods, block: &Range<usize>) {
        self.has_samples = false;
        self.reach = 0.0;
        self.far_strays = None;
        self.listed = None;
        let radius = NEAR_IN_SPACINGS * neighborhoods.spacings().coarsest_of(block);
        neighborhoods.strays_around(block, radius, &mut self.strays);
    }

    /// Distance from the site to the nearest of its neighbours.
    pub(super) fn nearest(&self) -> Option<f64> {
        let squared = self.neighbors.iter().map(|n| n.distance_squared);
        squared.min_by(f64::total_cmp).map(f64::sqrt)
    }
}
