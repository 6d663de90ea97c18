//! The neighbours of a cell that are remembered from one iteration to the next.

use crate::geometry::MOST_EDGES;

/// Stands for no neighbour.
const NO_LINK: u32 = u32::MAX;

/// The sites whose cells share an edge with that of a site, counter-clockwise; of a cell with
/// more edges than are remembered the first ones.
#[derive(Clone, Copy)]
pub(crate) struct Links([u32; MOST_EDGES]);

impl Links {
    /// No links.
    pub(super) const NONE: Self = Self([NO_LINK; MOST_EDGES]);

    /// Links to `neighbors`.
    pub(crate) fn new(neighbors: impl Iterator<Item = u32>) -> Self {
        let mut links = Self::NONE;
        for (link, neighbor) in links.0.iter_mut().zip(neighbors) {
            *link = neighbor;
        }
        links
    }

    /// The linked sites.
    #[inline]
    pub(crate) fn sites(&self) -> impl Iterator<Item = u32> + Clone {
        self.0.iter().copied().take_while(|&link| link != NO_LINK)
    }
}

impl Default for Links {
    fn default() -> Self {
        Self::NONE
    }
}
