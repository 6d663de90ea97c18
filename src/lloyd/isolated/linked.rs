//! Which seeds are near to each other.

use crate::geometry::{Local, NeighborGrid};

/// The seeds within `link` of `position`, one at the position among them.
pub(super) fn linked_to(
    seeds: &NeighborGrid,
    position: Local,
    link: f64,
) -> impl Iterator<Item = (usize, Local)> {
    let mut found = Vec::new();
    seeds.visit_around(position, link, |seed, place| {
        if (place - position).norm_squared() <= link * link {
            found.push((seed as usize, place));
        }
    });
    found.into_iter()
}
