//! The spacing that is wanted at every place of a cloud.
//!
//! One spacing for the whole cloud is the usual case. Where rules say that it varies, they give each point of the scan a wanted
//! spacing, and the field is made of those: what is wanted where the points are, and in between no steeper than a stated
//! [`Grading`]. All lengths of the solver are in proportion to the spacing at their place
//! ([`SolverOptions::at`](super::SolverOptions::at)), and cells are centred by a density that makes them as large as the
//! field says: in the plane a centroidal tessellation by the density h⁻⁴ has cells as wide as h (paper, equation 2, with ρ; Du,
//! Faber and Gunzburger, *Centroidal Voronoi Tessellations*, 1999, section 6).
//!
//! Grids follow the field in *layers*, one for each factor of √2, because their cells would be too coarse for one place or
//! too fine for another.

mod flat_cells;
#[cfg(test)]
mod graded_tests;
mod grading;
mod sources;

use rayon::prelude::*;

use flat_cells::FlatCells;
pub use grading::Grading;
use grading::SOURCE_RADIUS_IN_EDGES;
use sources::{Source, Sources};

use crate::geometry::{
    ITEMS_PER_TASK, LayeredCells, Local, NeighborGrid, Quantization, Stored, cell_of,
};

/// The spacing that is wanted at every place of a cloud.
#[derive(Debug)]
pub(crate) struct SpacingField {
    /// The coarsest spacing (CRS units).
    coarsest: f64,
    graded: Option<GradedField>,
}

/// A field that varies.
#[derive(Debug)]
struct GradedField {
    slope: f64,
    /// The finest spacing of each layer (CRS units), ascending.
    layers: Vec<f64>,
    sources: Sources,
    flat: FlatCells,
}

impl SpacingField {
    /// A field of one `spacing` (CRS units).
    pub(crate) fn constant(spacing: f64) -> Self {
        Self {
            coarsest: spacing,
            graded: None,
        }
    }

    /// The field of `points` with the wanted spacings `shares`, as shares of the `coarsest` (CRS units), and a `grading`.
    pub(crate) fn new(
        points: &[Stored],
        shares: &[f32],
        quantization: &Quantization,
        coarsest: f64,
        grading: &Grading,
    ) -> Self {
        let layers = grading.layers();
        let layers: Vec<f64> = layers.into_iter().map(|share| share * coarsest).collect();
        let spacing = |share: f32| f64::from(share).clamp(grading.finest, 1.0) * coarsest;
        let mut places: Vec<(u8, [i32; 3], u64)> = points
            .par_iter()
            .zip(shares)
            .map(|(&point, &share)| {
                let spacing = spacing(share);
                let layer = layer_of(&layers, spacing);
                let cell = cell_of(quantization.local(point), layers[usize::from(layer)]);
                // Positive numbers sort as their bits do.
                (layer, cell, spacing.to_bits())
            })
            .collect();
        places.par_sort_unstable();
        // The finest of a cell comes first.
        places.dedup_by_key(|&mut (layer, cell, _)| (layer, cell));
        let source = |&(layer, cell, spacing): &(u8, [i32; 3], u64)| {
            let edge = layers[usize::from(layer)];
            Source {
                middle: Local::from(cell.map(|c| (f64::from(c) + 0.5) * edge)),
                radius: SOURCE_RADIUS_IN_EDGES * edge,
                spacing: f64::from_bits(spacing),
            }
        };
        let listed: Vec<Source> = places.iter().map(source).collect();
        let of_listed: Vec<u8> = places.iter().map(|&(layer, ..)| layer).collect();
        drop(places);
        let sources = Sources::new(listed.clone());
        let flat = FlatCells::new(&listed, &of_listed, &layers, &sources, grading.slope);
        Self {
            coarsest,
            graded: Some(GradedField {
                slope: grading.slope,
                layers,
                sources,
                flat,
            }),
        }
    }

    /// The coarsest spacing (CRS units).
    #[inline]
    pub(crate) fn coarsest(&self) -> f64 {
        self.coarsest
    }

    /// Whether the spacing is the same everywhere.
    #[inline]
    pub(crate) fn is_constant(&self) -> bool {
        self.graded.is_none()
    }

    /// The spacing at `position` (CRS units).
    #[inline]
    pub(crate) fn at(&self, position: Local) -> f64 {
        match &self.graded {
            None => self.coarsest,
            Some(graded) => graded
                .at(position)
                .map_or(self.coarsest, |(spacing, _)| spacing),
        }
    }

    /// The spacing at each of `positions` (CRS units).
    pub(crate) fn at_all(&self, positions: &[Local]) -> Vec<f64> {
        let positions = positions.par_iter().with_max_len(ITEMS_PER_TASK);
        positions.map(|&position| self.at(position)).collect()
    }

    /// The spacing at `position` (CRS units), if it is one that is wanted there, and has not grown from a finer one.
    #[inline]
    pub(crate) fn wanted_at(&self, position: Local) -> Option<f64> {
        match &self.graded {
            None => Some(self.coarsest),
            Some(graded) => {
                let (spacing, is_wanted) = graded.at(position)?;
                is_wanted.then_some(spacing)
            }
        }
    }

    /// The factor by which the spacing within `radius` spacings of a place may be coarser than at the place itself.
    pub(crate) fn widening(&self, radius: f64) -> f64 {
        // Beside the slope itself the distance to the nearest source, which is taken off, may shrink; and the radius may be
        // meant in spacings of either place.
        let slope = self.graded.as_ref().map_or(0.0, |graded| graded.slope);
        1.0 + (4.0 * slope * radius).min(1.0)
    }

    /// The density by which cells are centred at `position`, up to a factor.
    pub(crate) fn density_at(&self, position: Local) -> f64 {
        (self.coarsest / self.at(position)).powi(4)
    }

    /// The finest spacing of the layer in which `position` lies (CRS units).
    pub(crate) fn finest_of_layer(&self, position: Local) -> f64 {
        match &self.graded {
            None => self.coarsest,
            Some(graded) => {
                let layer = layer_of(&graded.layers, self.at(position));
                graded.layers[usize::from(layer)]
            }
        }
    }

    /// `positions` in cells that are `in_spacings` wide, and the order of the positions in them.
    pub(crate) fn cells(&self, positions: &[Local], in_spacings: f64) -> (LayeredCells, Vec<u32>) {
        self.cells_of(positions, |&position| position, in_spacings)
    }

    /// `points`, each at its `position`, in cells that are `in_spacings` wide, and the order of the points in them.
    pub(crate) fn cells_of<P: Sync>(
        &self,
        points: &[P],
        position: impl Fn(&P) -> Local + Sync,
        in_spacings: f64,
    ) -> (LayeredCells, Vec<u32>) {
        match &self.graded {
            None => LayeredCells::one_layer(points, position, in_spacings * self.coarsest),
            Some(graded) => {
                let places = points.par_iter().with_max_len(ITEMS_PER_TASK);
                let spacings: Vec<f64> = places.map(|point| self.at(position(point))).collect();
                let (layers, edges) = (graded.layers_of(&spacings), graded.edges(in_spacings));
                LayeredCells::sort(points, position, &layers, &edges)
            }
        }
    }

    /// `positions` in a grid of cells that are `in_spacings` wide.
    pub(crate) fn grid(&self, positions: &[Local], in_spacings: f64) -> NeighborGrid {
        match self.is_constant() {
            true => self.grid_by(positions, &[], in_spacings),
            false => self.grid_by(positions, &self.at_all(positions), in_spacings),
        }
    }

    /// `positions`, at which the `spacings` are known (CRS units), in a grid of cells that are `in_spacings` wide. Spacings that are
    /// the same everywhere are not looked at.
    pub(crate) fn grid_by(
        &self,
        positions: &[Local],
        spacings: &[f64],
        in_spacings: f64,
    ) -> NeighborGrid {
        match &self.graded {
            None => NeighborGrid::new(positions, in_spacings * self.coarsest),
            Some(graded) => {
                let layers = graded.layers_of(spacings);
                NeighborGrid::layered(positions, &layers, &graded.edges(in_spacings))
            }
        }
    }

    /// `positions` in a grid of cells of the edge `edge` (CRS units) where the spacing is coarsest, and of an edge in proportion
    /// elsewhere.
    pub(crate) fn grid_of_edge(&self, positions: &[Local], edge: f64) -> NeighborGrid {
        match self.is_constant() {
            true => NeighborGrid::new(positions, edge),
            false => self.grid(positions, edge / self.coarsest),
        }
    }
}

impl GradedField {
    /// The layer of each place with one of these `spacings` (CRS units).
    fn layers_of(&self, spacings: &[f64]) -> Vec<u8> {
        let layers = spacings.iter();
        layers
            .map(|&spacing| layer_of(&self.layers, spacing))
            .collect()
    }

    /// The edges of the cells of each layer, if they are `in_spacings` wide (CRS units).
    fn edges(&self, in_spacings: f64) -> Vec<f64> {
        self.layers.iter().map(|h| in_spacings * h).collect()
    }

    /// The spacing at `position`, and whether it is one that is wanted there; `None` if no points were given.
    fn at(&self, position: Local) -> Option<(f64, bool)> {
        let known = self.flat.spacing_at(position);
        known
            .map(|spacing| (spacing, true))
            .or_else(|| self.sources.spacing_at(position, self.slope))
    }
}

/// The last of `layers` that is not coarser than `spacing`, or the first.
fn layer_of(layers: &[f64], spacing: f64) -> u8 {
    layers
        .partition_point(|&finest| finest <= spacing)
        .saturating_sub(1) as u8
}
