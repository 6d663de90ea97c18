//! Cubic blocks of sites, aligned to the run's quantization, over which Anderson's least squares
//! are summed and blended.
//!
//! The identity of a site decides in which block it is, once for all iterations.

use rayon::prelude::*;

use super::normal_equations::{Equations, MEMORY, add};
use crate::geometry::{CellIndex, Local, OccupiedCells, Stored, cell_of};

/// The sites by block.
pub(super) struct Blocks {
    cells: OccupiedCells,
    /// The sites, sorted by block.
    order: Vec<u32>,
    /// The index of each occupied block.
    indices: Vec<CellIndex>,
    /// The identity of each site in units of blocks; `None` with one block for all.
    positions: Option<Vec<Local>>,
}

impl Blocks {
    /// Blocks of edge `edge` (CRS units), or one block for all; `scale` is that of the
    /// quantization.
    pub(super) fn new(identities: &[Stored], scale: f64, edge: Option<f64>) -> Self {
        let positions: Option<Vec<Local>> = edge.map(|edge| {
            identities
                .iter()
                .map(|s| Local::new(s.x.into(), s.y.into(), s.z.into()) * (scale / edge))
                .collect()
        });
        let block = |site: usize| {
            let positions = positions.as_ref();
            positions.map_or([0; 3], |p| cell_of(p[site], 1.0))
        };
        let blocks: Vec<CellIndex> = (0..identities.len()).map(block).collect();
        let (cells, order) = OccupiedCells::sort(&blocks, |&block| block);
        let indices = cells
            .ranges()
            .map(|range| blocks[order[range.start] as usize])
            .collect();
        Self {
            cells,
            order,
            indices,
            positions,
        }
    }

    /// Sums `term` over the sites of each block and of the blocks around it; the weight is
    /// halved for every axis on which a block is one block away.
    pub(super) fn sum(&self, term: impl Fn(usize) -> Equations + Sync) -> Vec<Equations> {
        let ranges: Vec<_> = self.cells.ranges().collect();
        let own: Vec<Equations> = ranges
            .into_par_iter()
            .map(|range| {
                let mut total = Equations::default();
                for &site in &self.order[range] {
                    add(&mut total, &term(site as usize), 1.0);
                }
                total
            })
            .collect();
        self.indices
            .par_iter()
            .map(|&[x, y, z]| {
                let mut total = Equations::default();
                for dz in -1..=1_i32 {
                    for dy in -1..=1_i32 {
                        for dx in -1..=1_i32 {
                            if let Some(block) = self.cells.index_of([x + dx, y + dy, z + dz]) {
                                let away = dx.abs() + dy.abs() + dz.abs();
                                add(&mut total, &own[block], 0.5_f64.powi(away));
                            }
                        }
                    }
                }
                total
            })
            .collect()
    }

    /// Interpolates the values of the eight blocks around `site` linearly; `value` gives that
    /// of a block.
    pub(super) fn blend(
        &self,
        site: usize,
        value: impl Fn(usize) -> [f64; MEMORY],
    ) -> [f64; MEMORY] {
        let Some(positions) = &self.positions else {
            return value(0);
        };
        let position = positions[site] - Local::repeat(0.5);
        let corner = cell_of(position, 1.0);
        let mut total = [0.0; MEMORY];
        let mut weights = 0.0;
        for k in 0..8_i32 {
            let offset = [k & 1, k >> 1 & 1, k >> 2];
            let index: CellIndex = std::array::from_fn(|axis| corner[axis] + offset[axis]);
            if let Some(block) = self.cells.index_of(index) {
                let weight: f64 = (0..3)
                    .map(|axis| 1.0 - (position[axis] - f64::from(index[axis])).abs())
                    .product();
                weights += weight;
                for (sum, value) in total.iter_mut().zip(value(block)) {
                    *sum += weight * value;
                }
            }
        }
        // The site's own block exists and has at least an eighth of the weight.
        total.map(|sum| sum / weights)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blending_a_constant_gives_the_constant() {
        let identities: Vec<Stored> = (0..500)
            .map(|i| Stored {
                x: i * 37 % 1000,
                y: i * 91 % 700,
                z: i % 13,
            })
            .collect();
        let blocks = Blocks::new(&identities, 0.01, Some(1.3));
        for site in 0..identities.len() {
            let [value, ..] = blocks.blend(site, |_| [2.5, 0.0, 0.0, 0.0]);
            assert!((value - 2.5).abs() < 1e-12);
        }
    }
}
