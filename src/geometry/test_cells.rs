//! Patches and neighbours that the tests of cells share.

use super::{Local, Neighbor, Patch, PatchKind};

/// The plane z = 0.
pub(super) fn flat() -> Patch {
    let grid: Vec<Local> = (-5..=5)
        .flat_map(|i| (-5..=5).map(move |j| Local::new(f64::from(i), f64::from(j), 0.0) * 0.3))
        .collect();
    Patch::fit(Local::zeros(), &grid, 2.0, PatchKind::Quadratic).unwrap()
}

/// The positions `others` as neighbours of `site`, nearest first, each with its index among
/// them.
pub(super) fn sorted(site: Local, others: &[Local]) -> Vec<Neighbor> {
    let mut neighbors: Vec<Neighbor> = (0..)
        .zip(others)
        .map(|(index, &position)| Neighbor {
            distance_squared: (position - site).norm_squared(),
            index,
            position,
        })
        .collect();
    neighbors.sort_by(|a, b| a.distance_squared.total_cmp(&b.distance_squared));
    neighbors
}

/// The nodes of the hexagonal lattice of edge 1 within this many rings of the origin, without
/// the origin.
pub(super) fn hexagonal(rings: i32) -> Vec<Local> {
    let mut sites = Vec::new();
    for i in -rings..=rings {
        for j in -rings..=rings {
            if (i, j) != (0, 0) {
                sites.push(Local::new(
                    f64::from(i) + 0.5 * f64::from(j),
                    f64::from(j) * 0.75_f64.sqrt(),
                    0.0,
                ));
            }
        }
    }
    sites
}

/// A paraboloid of `curvature` about the z axis.
pub(super) fn bent(curvature: f64) -> Patch {
    let place = |i: i32, j: i32| {
        let (x, y) = (0.3 * f64::from(i), 0.3 * f64::from(j));
        Local::new(x, y, 0.5 * curvature * (x * x + y * y))
    };
    let grid: Vec<Local> = (-5..=5)
        .flat_map(|i| (-5..=5).map(move |j| place(i, j)))
        .collect();
    Patch::fit(Local::zeros(), &grid, 2.0, PatchKind::Quadratic).unwrap()
}
