//! Blocks of sites that lie together, and so find their neighbours and samples together.

use std::ops::Range;

use super::{field::SpacingField, step::BLOCK_EDGE_IN_SPACINGS};
use crate::geometry::Local;

/// The blocks of `positions`, as ranges of the order that comes with them: that of the blocks, and
/// within a block that of the positions.
pub(super) fn in_blocks(
    positions: &[Local],
    field: &SpacingField,
) -> (Vec<Range<usize>>, Vec<u32>) {
    let (blocks, order) = field.cells(positions, BLOCK_EDGE_IN_SPACINGS);
    (blocks.ranges().collect(), order)
}
