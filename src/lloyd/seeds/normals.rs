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

/// The lattices of cells up to this many cells away go on in a cell. Where each ended with its own
/// cells, gaps of up to two rows were left between two lattices.
const LATTICE_REACH_IN_CELLS: i32 = 1;

/// A lattice with this tilt (one less the cosine) has the last rank.
const LARGEST_TILT: f64 = 0.1;
/// Number of ranks: the tilts that have one in common differ by less than a degree.
const TILT_RANKS: f64 = 32.0;

/// A lattice that has nodes in a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellLattice {
    pub(super) lattice: Lattice,
    /// Rank of its tilt against the surface in the cell: of two lattices the one that is tilted less comes first.
    pub(super) tilt_rank: u32,
    /// Whether it is that of the cell's own normal, and not only of a cell nearby.
    pub(super) is_own: bool,
}

/// The samples of a scan by cell, and the lattices of each cell.
pub(super) struct LatticeCells {
    pub(super) cells: LayeredCells,
    /// The indices of the samples, sorted by cell.
    pub(super) order: Vec<u32>,
    /// The lattices of each occupied cell; none where the cell has no normal.
    pub(super) lattices: Vec<Vec<CellLattice>>,
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
        let of_cell = |(cell, own): (usize, &Option<Local>)| {
            let normal = averaged(cell, middles[cell], (*own)?, &cells, &normals).normalize();
            Some((
                Lattice::across(normal, &surface.options.dominant_normals),
                normal,
            ))
        };
        let of_cells: Vec<_> = normals.par_iter().enumerate().map(of_cell).collect();
        let around = |(cell, own): (usize, &Option<(Lattice, Local)>)| {
            let around = |&own: &_| around(cell, middles[cell], own, &cells, &of_cells);
            own.as_ref().map_or_else(Vec::new, around)
        };
        let lattices = of_cells.par_iter().enumerate().map(around).collect();
        Self {
            cells,
            order,
            lattices,
        }
    }

    /// Whether there is a lattice, and so a surface, at `position`.
    pub(super) fn have(&self, position: Local) -> bool {
        let mut cells = self.cells.containing(position);
        cells.any(|cell| !self.lattices[cell].is_empty())
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

/// The lattices of the same surface around the cell with the index `cell`, the position `inside` it and the lattice and normal
/// `own`; `of_cells` has the lattice and the normal of each cell.
fn around(
    cell: usize,
    inside: Local,
    own: (Lattice, Local),
    cells: &LayeredCells,
    of_cells: &[Option<(Lattice, Local)>],
) -> Vec<CellLattice> {
    let (own, normal) = own;
    let mut found: Vec<CellLattice> = Vec::with_capacity(1);
    cells.visit_layer_around(cell, inside, LATTICE_REACH_IN_CELLS, |cell| {
        if let Some((lattice, other)) = of_cells[cell]
            && normal.dot(&other).abs() >= SAME_SURFACE_COSINE
            && found.iter().all(|known| known.lattice.key != lattice.key)
        {
            let tilt = (lattice.tilt(normal) / LARGEST_TILT).min(1.0);
            found.push(CellLattice {
                lattice,
                tilt_rank: (tilt.sqrt() * TILT_RANKS) as u32,
                is_own: lattice.key == own.key,
            });
        }
    });
    found
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
