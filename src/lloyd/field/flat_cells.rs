//! Cells in which the spacing is the same everywhere: most of a cloud, where it need not be searched.

use rayon::prelude::*;

use super::sources::{Source, Sources};
use crate::geometry::{ITEMS_PER_TASK, LayeredCells, Local};

/// Half of the diagonal of a cube, in edges, rounded up.
const HALF_DIAGONAL_IN_EDGES: f64 = 0.867;

/// The cells of sources, and the spacing of those in which it is the same everywhere.
#[derive(Debug)]
pub(super) struct FlatCells {
    cells: LayeredCells,
    /// The spacing of each cell (CRS units); NaN if it varies there.
    spacings: Vec<f64>,
}

impl FlatCells {
    /// Examines the cells of `listed` sources, each of which fills the cell of its layer, one of `layers`; the cells of layer
    /// *k* have the edge `edges[k]`. The spacing grows by `slope` at most.
    pub(super) fn new(
        listed: &[Source],
        layers: &[u8],
        edges: &[f64],
        sources: &Sources,
        slope: f64,
    ) -> Self {
        let (cells, order) = LayeredCells::sort(listed, |source| source.middle, layers, edges);
        let spacing = |&index: &u32| {
            let source = &listed[index as usize];
            let radius = HALF_DIAGONAL_IN_EDGES * edges[usize::from(layers[index as usize])];
            let finest = sources.finest_around(source.middle, radius, slope);
            match finest >= source.spacing {
                true => source.spacing,
                false => f64::NAN,
            }
        };
        // One source to a cell: the order of the cells is that of the sources.
        let order = order.par_iter().with_max_len(ITEMS_PER_TASK);
        Self {
            spacings: order.map(spacing).collect(),
            cells,
        }
    }

    /// The spacing at `position`, if it is known to be the same around it.
    #[inline]
    pub(super) fn spacing_at(&self, position: Local) -> Option<f64> {
        let cells = self.cells.containing(position);
        cells
            .map(|cell| self.spacings[cell])
            .find(|spacing| !spacing.is_nan())
    }
}
