//! Wires: seeds in a row, each of which may have no other near it.

use super::planes::steps_to;
use crate::{
    geometry::{Local, NeighborGrid},
    lloyd::options::SolverOptions,
};

/// A row is of no fewer seeds, the one that is asked about among them.
const FEWEST_IN_A_ROW: usize = 5;
/// The share of the sparse seeds around that are in the row, at least: among many some are in a row by chance, and where the
/// ground is far from the scanner, all are in rows, side by side.
const SHARE_IN_A_ROW: f64 = 0.5;
/// Largest distance of a seed from the line of its row.
const FARTHEST_FROM_ROW_IN_SPACINGS: f64 = 0.2;
/// So many seeds are never in one row.
const MOST_IN_A_ROW: f64 = 16.0;

/// Whether the seed at `position` is in a row with seeds around it, of which those count that `is_sparse`. A wire far from
/// the scanner has a return every second spacing: no plane or line can be told from the seeds next to each other.
pub(super) fn lies_on_a_wire(
    seeds: &NeighborGrid,
    position: Local,
    options: &SolverOptions,
    is_sparse: impl Fn(usize) -> bool,
) -> bool {
    let around = steps_to(seeds, position, options.wire_radius(), is_sparse);
    let fewest = (SHARE_IN_A_ROW * around.len() as f64).max(FEWEST_IN_A_ROW as f64);
    if fewest > MOST_IN_A_ROW {
        return false;
    }
    let farthest = FARTHEST_FROM_ROW_IN_SPACINGS * options.spacing;
    around.iter().any(|way| {
        let row = way.normalize();
        let is_in_row = |step: &&Local| step.cross(&row).norm() < farthest;
        around.iter().filter(is_in_row).count() as f64 >= fewest
    })
}
