//! The lattice of every part of the scan, by the normals of its surfaces.

use std::ops::Range;

use rayon::prelude::*;

use super::lattice::Lattice;
use crate::{
    geometry::{LayeredCells, Local, Patch, PatchKind},
    lloyd::{
        blocks::in_blocks,
        step::{BLOCKS_PER_TASK, Samples},
        surface::{Surface, bounding_box},
    },
};

/// Edge of a cell that has one normal.
const NORMAL_CELL_IN_SPACINGS: f64 = 1.0;

/// The normal of a cell is averaged over cells up to this many cells away.
const AVERAGE_REACH_IN_CELLS: i32 = 2;

/// Least cosine between normals of one surface.
const SAME_SURFACE_COSINE: f64 = 0.87;

/// A neighbourhood with a larger residual has no normal.
const LARGEST_RESIDUAL_IN_FIT_RADII: f64 = 0.15;
/// A neighbourhood that is less round has no normal.
const LEAST_ROUNDNESS: f64 = 0.3;

/// The samples of a scan by cell, and the lattice of each cell.
pub(super) struct LatticeCells {
    pub(super) cells: LayeredCells,
    /// The indices of the samples, sorted by cell.
    pub(super) order: Vec<u32>,
    /// The lattice of each occupied cell; `None` where the cell has no normal.
    pub(super) lattices: Vec<Option<Lattice>>,
}

impl LatticeCells {
    /// The lattices of all cells, from the normals of `surface`.
    pub(super) fn new(surface: Surface<'_>) -> Self {
        let samples = surface.scan.samples().points();
        let (cells, order) = surface.field().cells(samples, NORMAL_CELL_IN_SPACINGS);
        let ranges: Vec<_> = cells.ranges().collect();
        let mean = |range: &Range<usize>| {
            let in_cell = order[range.clone()]
                .iter()
                .map(|&index| samples[index as usize]);
            in_cell.sum::<Local>() / range.len() as f64
        };
        let middles: Vec<Local> = ranges.par_iter().map(mean).collect();
        let normals = normals(&middles, surface);
        let lattice = |(cell, own): (usize, &Option<Local>)| {
            let normal = averaged(cell, middles[cell], (*own)?, &cells, &normals);
            Some(Lattice::across(normal))
        };
        let lattices = normals.par_iter().enumerate().map(lattice).collect();
        Self {
            cells,
            order,
            lattices,
        }
    }

    /// Whether there is a lattice, and so a surface, at `position`.
    pub(super) fn have(&self, position: Local) -> bool {
        let mut cells = self.cells.containing(position);
        cells.any(|cell| self.lattices[cell].is_some())
    }
}

/// The normal of the surface at each of the positions `middles`, if there is one.
fn normals(middles: &[Local], surface: Surface<'_>) -> Vec<Option<Local>> {
    let mut normals = vec![None; middles.len()];
    let normal = |samples: &mut Samples, own: usize| {
        let radius = surface.options_at(middles[own]).fit_radius;
        let (near, _, _) = samples.in_ball(middles[own], radius);
        let patch = Patch::fit(middles[own], near, radius, PatchKind::Plane)?;
        let is_flat = patch.residual <= LARGEST_RESIDUAL_IN_FIT_RADII * radius
            && patch.roundness >= LEAST_ROUNDNESS;
        is_flat.then(|| (own, patch.normal()))
    };
    for (own, normal) in by_block(middles, surface, normal) {
        normals[own] = Some(normal);
    }
    normals
}

/// The sum of the normals of the same surface around the cell with the index `cell`, the position `inside` it and the normal
/// `own`: noise must not scatter lattices over a surface.
fn averaged(
    cell: usize,
    inside: Local,
    own: Local,
    cells: &LayeredCells,
    normals: &[Option<Local>],
) -> Local {
    let mut sum = Local::zeros();
    cells.visit_layer_around(cell, inside, AVERAGE_REACH_IN_CELLS, |cell| {
        if let Some(other) = normals[cell] {
            let cosine = own.dot(&other);
            if cosine.abs() >= SAME_SURFACE_COSINE {
                sum += other * cosine.signum();
            }
        }
    });
    sum
}

/// Calls `work` for the index of every one of `positions`, in parallel, with the samples
/// around its block.
pub(super) fn by_block<T: Send>(
    positions: &[Local],
    surface: Surface<'_>,
    work: impl Fn(&mut Samples, usize) -> Option<T> + Sync,
) -> Vec<T> {
    let (blocks, order) = in_blocks(positions, surface.field());
    blocks
        .into_par_iter()
        .with_max_len(BLOCKS_PER_TASK)
        .map_init(Samples::default, |samples, block| {
            let in_block = || order[block.clone()].iter().map(|&own| own as usize);
            let [low, high] = bounding_box(in_block().map(|own| positions[own]));
            let coarsest = surface.coarsest_options(in_block().map(|own| positions[own]));
            samples.gather_box(surface.with(&coarsest), low, high);
            in_block()
                .filter_map(|own| work(samples, own))
                .collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect()
}
