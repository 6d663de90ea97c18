//! Normals of points where the scan describes no surface, as on wires and leaves: those of the planes through their
//! neighbours.

use std::iter;

use rayon::prelude::*;

use crate::geometry::{ITEMS_PER_TASK, Local, NeighborGrid, narrow_frame};

/// The distance within which points are neighbours of a point, in spacings: the nearest ones around it.
const RADIUS: f64 = 1.5;
/// How far away points can be that decide on a normal, in spacings.
pub(super) const REACH: f64 = RADIUS;
/// The fewest points that say where a plane lies, the point itself among them.
const FEWEST_POINTS: usize = 4;
/// The least spread of the neighbours across their longest direction, over that along it: those in a row, as on a wire, lie
/// on many planes.
const LEAST_WIDTH: f64 = 0.2;

/// Gives a normal to the points of `positions` without one, as far as their neighbours lie around them.
pub(super) fn estimate(positions: &[Local], normals: &mut [Option<Local>], spacing: f64) {
    let radius = RADIUS * spacing;
    let grid = NeighborGrid::new(positions, radius);
    normals
        .par_iter_mut()
        .zip(positions)
        .with_max_len(ITEMS_PER_TASK)
        .filter(|(normal, _)| normal.is_none())
        .for_each(|(normal, &position)| *normal = normal_at(&grid, position, radius));
}

/// The normal of the plane through the points within `radius` of `position`, one of them.
fn normal_at(grid: &NeighborGrid, position: Local, radius: f64) -> Option<Local> {
    let mut neighbors = Vec::new();
    // In an order that every part of a cloud has, so that sums have the same bits.
    grid.find_neighbors(position, radius, &mut neighbors);
    let count = 1 + neighbors.len();
    if count < FEWEST_POINTS {
        return None;
    }
    let ways = || {
        let others = neighbors.iter();
        let others = others.map(|neighbor| neighbor.position - position);
        iter::once(Local::zeros()).chain(others)
    };
    let middle = ways().sum::<Local>() / count as f64;
    let covariance = ways()
        .map(|way| (way - middle) * (way - middle).transpose())
        .sum();
    let (spread, [_, _, normal]) = narrow_frame(covariance)?;
    (spread[1] > LEAST_WIDTH * LEAST_WIDTH * spread[0]).then_some(normal)
}
