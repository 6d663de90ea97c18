//! The bounding polygon: the dodecagon around a site that its cell is clipped from.

use super::{
    Local, Neighbor, Patch,
    bisector::{Bisector, lift},
};

/// Sides of the bounding polygon.
pub const BOUNDING_SIDES: usize = 12;

/// How far the bounding polygon reaches from the site towards each of its corners (CRS units).
pub(crate) type Reach = [f64; BOUNDING_SIDES];

/// The directions to the corners of the bounding polygon, as `[u, v]` in the frame of the patch.
pub(crate) fn bounding_corners() -> [[f64; 2]; BOUNDING_SIDES] {
    // cos and sin of multiples of 30°, written out: the same bits on every
    // machine, whatever its mathematics library.
    const S: f64 = 0.866_025_403_784_438_6;
    [
        [1.0, 0.0],
        [S, 0.5],
        [0.5, S],
        [0.0, 1.0],
        [-0.5, S],
        [-S, 0.5],
        [-1.0, 0.0],
        [-S, -0.5],
        [-0.5, -S],
        [0.0, -1.0],
        [0.5, -S],
        [S, -0.5],
    ]
}

/// Whether a corner of the bounding polygon of `reach` around `site` on `patch` is left by all of
/// the `neighbors`. Then they do not close the cell; it takes a small part of the time of clipping
/// it. Neighbours that are sorted by distance are fastest.
pub(crate) fn keeps_corner(
    patch: &Patch,
    site: Local,
    reach: &Reach,
    neighbors: &[Neighbor],
) -> bool {
    let surface = patch.heights_from(site);
    let mut corners = [Local::zeros(); BOUNDING_SIDES];
    for ((corner, [cos, sin]), reach) in corners.iter_mut().zip(bounding_corners()).zip(reach) {
        *corner = lift(&surface, reach * cos, reach * sin);
    }
    let mut count = BOUNDING_SIDES;
    for neighbor in neighbors {
        // A coincident site has no bisector.
        if neighbor.distance_squared > 0.0 {
            let bisector = Bisector::new(patch, site, neighbor);
            let mut kept = 0;
            for k in 0..count {
                let corner = corners[k];
                corners[kept] = corner;
                kept += usize::from(bisector.beyond(corner) <= 0.0);
            }
            count = kept;
            if count == 0 {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{
        Cell, spread,
        test_cells::{bent, sorted},
    };

    #[test]
    fn a_cell_that_keeps_a_corner_is_not_closed() {
        let mut open = 0;
        for seed in 0..400_u64 {
            let patch = bent(0.2);
            let roll = |k: u64| spread(100 * seed + k) as f64 / u64::MAX as f64 - 0.5;
            let sites: Vec<Local> = (0..3 + seed % 12)
                .map(|k| Local::new(2.4 * roll(2 * k), 2.4 * roll(2 * k + 1), 0.0))
                .map(|p| patch.foot_point(p))
                .collect();
            let neighbors = sorted(sites[0], &sites[1..]);
            let reach = [1.0; BOUNDING_SIDES];
            let mut cell = Cell::new();
            cell.clip(&patch, sites[0], &reach, &neighbors);
            let keeps = keeps_corner(&patch, sites[0], &reach, &neighbors);
            assert!(!(keeps && cell.is_closed()), "seed {seed}");
            open += u32::from(keeps);
        }
        assert!((100..400).contains(&open), "{open}");
    }
}
