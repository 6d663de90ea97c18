//! Which seeds are near to each other.

use crate::geometry::{Local, NeighborGrid};

/// Calls `visit` with the index and the place of every seed within `link` of `position`.
#[inline]
pub(super) fn visit_linked(
    seeds: &NeighborGrid,
    position: Local,
    link: f64,
    mut visit: impl FnMut(usize, Local),
) {
    seeds.visit_around(position, link, |seed, place| {
        if (place - position).norm_squared() <= link * link {
            visit(seed as usize, place);
        }
    });
}
