//! Cells of several cubic grids, one upon the other.
//!
//! Where the spacing of the output varies, a grid for all of it would be too coarse for the fine places or too fine for the
//! coarse ones. So points come in layers, each with a grid of its own:
//!
//! ```text
//!   layer 1   ┌───────┬───────┐              ┌───────┐     a point lies in one layer; a search looks
//!   layer 0   └───────┴──┬─┬─┬┴┬─┬─┬─┬─┬─┬─┬─┴───────┘     through all of them, the finest first
//! ```
//!
//! With one layer this is [`OccupiedCells`].

use std::ops::{ControlFlow, Range};

use super::{Local, OccupiedCells, cell_of};

/// The occupied cells of several grids, and their points.
#[derive(Debug, Clone)]
pub(crate) struct LayeredCells {
    layers: Vec<Layer>,
}

#[derive(Debug, Clone)]
struct Layer {
    /// The edge of its cells (CRS units).
    edge: f64,
    /// The cells, with ranges among the points of all layers.
    cells: OccupiedCells,
    /// Number of occupied cells in the layers before this one.
    first_cell: usize,
}

impl LayeredCells {
    /// Sorts `points`, each at its `position`, into cells of `edge` (CRS units), all in one layer. The second part of the result is,
    /// in sorted order, the index of each point.
    ///
    /// # Panics
    ///
    /// Unless `edge` is positive; and as [`OccupiedCells::sort`].
    pub(crate) fn one_layer<P: Sync>(
        points: &[P],
        position: impl Fn(&P) -> Local + Sync,
        edge: f64,
    ) -> (Self, Vec<u32>) {
        assert!(edge > 0.0, "an edge of {edge}");
        let (cells, order) = OccupiedCells::sort(points, |point| cell_of(position(point), edge));
        let layer = Layer {
            edge,
            cells,
            first_cell: 0,
        };
        let layers = vec![layer];
        (Self { layers }, order)
    }

    /// Sorts `points`, each at its `position`, into the layers that `layers` gives, one to a point, and within a layer *k* into cells
    /// of the edge `edges[k]` (CRS units). The second part of the result is, in sorted order, the index of each point.
    ///
    /// # Panics
    ///
    /// Unless all edges are positive and each point has a layer with an edge; and as [`OccupiedCells::sort`].
    pub(crate) fn sort<P: Sync>(
        points: &[P],
        position: impl Fn(&P) -> Local + Sync,
        layers: &[u8],
        edges: &[f64],
    ) -> (Self, Vec<u32>) {
        assert!(edges.iter().all(|&edge| edge > 0.0), "edges of {edges:?}");
        let mut indices: Vec<Vec<u32>> = vec![Vec::new(); edges.len()];
        for (index, &layer) in (0..).zip(layers) {
            indices[usize::from(layer)].push(index);
        }
        let (mut sorted, mut order) = (Vec::new(), Vec::with_capacity(points.len()));
        let mut first_cell = 0;
        for (&edge, indices) in edges.iter().zip(&indices) {
            if indices.is_empty() {
                continue;
            }
            let cell = |&index: &u32| cell_of(position(&points[index as usize]), edge);
            let (mut cells, in_layer) = OccupiedCells::sort(indices, cell);
            cells.shift(order.len() as u32);
            let layer = Layer {
                edge,
                first_cell,
                cells,
            };
            first_cell += layer.cells.len();
            order.extend(in_layer.iter().map(|&k| indices[k as usize]));
            sorted.push(layer);
        }
        (Self { layers: sorted }, order)
    }

    /// The edge of the finest cells (CRS units).
    pub(crate) fn finest_edge(&self) -> f64 {
        let edges = self.layers.iter().map(|layer| layer.edge);
        edges.fold(f64::INFINITY, f64::min)
    }

    /// The ranges of points of the occupied cells, in their order.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        self.layers.iter().flat_map(|layer| layer.cells.ranges())
    }

    /// The indices of the occupied cells that contain `position`, at most one of each layer.
    pub(crate) fn containing(&self, position: Local) -> impl Iterator<Item = usize> {
        self.layers.iter().filter_map(move |layer| {
            let index = layer.cells.index_of(cell_of(position, layer.edge))?;
            Some(layer.first_cell + index)
        })
    }

    /// Calls `visit` with the index of every occupied cell of the same layer that is at most `reach` cells away from the one
    /// with the index `cell`, which contains the position `inside`.
    pub(crate) fn visit_layer_around(
        &self,
        cell: usize,
        inside: Local,
        reach: i32,
        mut visit: impl FnMut(usize),
    ) {
        let next = self
            .layers
            .partition_point(|layer| layer.first_cell <= cell);
        let layer = &self.layers[next - 1];
        let index = cell_of(inside, layer.edge);
        let [low, high] = [-reach, reach].map(|reach| index.map(|c| c.saturating_add(reach)));
        let _ = layer.cells.visit_box(low, high, |cell| {
            visit(layer.first_cell + cell);
            ControlFlow::<()>::Continue(())
        });
    }

    /// Calls `visit` with the range of points of every occupied cell that the box from `low` to `high` touches, layer by layer
    /// and in their order, until it breaks.
    #[inline]
    pub(crate) fn visit_box<B>(
        &self,
        low: Local,
        high: Local,
        mut visit: impl FnMut(Range<usize>) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for layer in &self.layers {
            let (low, high) = (cell_of(low, layer.edge), cell_of(high, layer.edge));
            layer
                .cells
                .visit_box(low, high, |cell| visit(layer.cells.points_of(cell)))?;
        }
        ControlFlow::Continue(())
    }
}
