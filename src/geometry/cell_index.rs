//! The cells of a cubic grid, and the bricks that they come in.
//!
//! A brick is 4 × 4 × 4 cells; one word of 64 bits says which of them are occupied: bit
//! x + 4 y + 16 z stands for the cell (x, y, z) of the brick.

use super::Local;

/// The index of a cell: whole cells from the local origin.
pub(crate) type CellIndex = [i32; 3];

/// The index of the cell of edge `edge` (CRS units) that contains `point`.
#[inline]
pub(crate) fn cell_of(point: Local, edge: f64) -> CellIndex {
    let cells_per_unit = 1.0 / edge;
    [point.x, point.y, point.z].map(|c| {
        // The floor, without the function call that old processors need for it. `as` saturates:
        // a coordinate beyond the range lands in the last cell.
        let cells = c * cells_per_unit;
        let towards_zero = cells as i32;
        towards_zero.saturating_sub(i32::from(cells < f64::from(towards_zero)))
    })
}

/// Cells along the edge of a brick, as a power of two.
pub(super) const BRICK_SHIFT: u32 = 2;
/// Bits of the index of a cell in its brick.
pub(super) const CELL_BITS: u32 = 3 * BRICK_SHIFT;
/// Mask of the part of a cell's index that says where it lies in its brick.
pub(super) const CELL_MASK: i32 = (1 << BRICK_SHIFT) - 1;

/// The number of the bit that stands for a cell in the word of its brick.
#[inline]
pub(super) fn bit_of(index: CellIndex) -> u32 {
    let [x, y, z] = index.map(|c| (c & CELL_MASK) as u32);
    x | y << BRICK_SHIFT | z << (2 * BRICK_SHIFT)
}

/// A word of four groups of `size` bits each, in which the groups from `first` to `last` are
/// set.
#[inline]
pub(super) fn bits([first, last]: [u32; 2], size: u32) -> u64 {
    let up_to = |groups: u32| u64::MAX.checked_shr(64 - groups * size).unwrap_or(0);
    up_to(last + 1) & !up_to(first)
}
