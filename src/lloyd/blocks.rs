//! Blocks of sites that lie together, and so find their neighbours and samples together.

use std::ops::Range;

use super::step::BLOCK_EDGE_IN_SPACINGS;
use crate::geometry::{Local, OccupiedCells, cell_of};

/// The blocks of `positions`, as ranges of the order that comes with them: that of the blocks, and
/// within a block that of the positions.
pub(super) fn in_blocks(positions: &[Local], spacing: f64) -> (Vec<Range<usize>>, Vec<u32>) {
    let edge = BLOCK_EDGE_IN_SPACINGS * spacing;
    let (blocks, order) = OccupiedCells::sort(positions, |&p| cell_of(p, edge));
    (blocks.ranges().collect(), order)
}
