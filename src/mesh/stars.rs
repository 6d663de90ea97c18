//! The star of a point: the triangles that its Voronoi cell on the surface names.
//!
//! ```text
//!        c_____b         The cell of x is clipped on the plane through x that is normal to the surface
//!       / \   / \        there. At each of its corners two neighbours meet: x and those two are a
//!      /___\ /___\       triangle. A corner farther from x than the largest cell of an even cloud
//!     d     x     a      reaches is the corner of a hole, and names nothing.
//! ```

use rayon::prelude::*;

use super::{Corners, by_corner::sorted_by_corner};
use crate::geometry::{BOUNDING_SIDES, Cell, ITEMS_PER_TASK, Local, Neighbor, NeighborGrid, Patch};

/// The largest distance from a point to a corner of its cell that names a triangle, in spacings: the cells
/// of an even cloud reach to 0.6, those of its worst places to 1.
pub(super) const LARGEST_CIRCUMRADIUS: f64 = 1.25;
/// A distance from a point within which nearly all cells of an even cloud lie, in spacings.
const USUAL_CIRCUMRADIUS: f64 = 0.8;
/// How far away points can be that decide on a triangle, in spacings.
pub(super) const REACH: f64 = 4.0 * LARGEST_CIRCUMRADIUS;

/// A triangle that the star of one of its corners names, at least.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Candidate {
    /// The corners, in ascending order.
    pub(super) corners: Corners,
    /// Whether the star of each corner names the triangle.
    pub(super) is_named_by: [bool; 3],
}

impl Candidate {
    /// The number of corners whose stars name the triangle.
    pub(super) fn votes(&self) -> usize {
        self.is_named_by
            .iter()
            .filter(|&&is_named| is_named)
            .count()
    }

    /// Whether the star of `corner` names the triangle.
    pub(super) fn is_named_by(&self, corner: u32) -> bool {
        let named = self.corners.iter().zip(self.is_named_by);
        named
            .into_iter()
            .any(|(&c, is_named)| c == corner && is_named)
    }
}

/// The triangles that the stars of `positions` name, in the order of their corners. Points without
/// a normal take no part.
pub(super) fn candidates(
    positions: &[Local],
    normals: &[Option<Local>],
    spacing: f64,
) -> Vec<Candidate> {
    let sites: Vec<(u32, Local)> = (0..)
        .zip(normals)
        .filter_map(|(site, normal)| Some((site, (*normal)?)))
        .collect();
    let places: Vec<Local> = sites.iter().map(|&(k, _)| positions[k as usize]).collect();
    let grid = NeighborGrid::new(&places, USUAL_CIRCUMRADIUS * spacing);
    let named: Vec<(Corners, u8)> = sites
        .par_iter()
        .with_max_len(ITEMS_PER_TASK)
        .map_init(
            || (Cell::new(), Vec::new()),
            |(cell, neighbors), &(site, normal)| {
                let position = positions[site as usize];
                clip(
                    cell,
                    neighbors,
                    &grid,
                    &Patch::plane(position, normal),
                    spacing,
                );
                let other = |edge: Option<u32>| edge.map(|place| sites[place as usize].0);
                let around: Vec<Option<u32>> = cell.edge_neighbors().map(other).collect();
                star(site, &around)
            },
        )
        .flatten_iter()
        .collect();
    merged(&sorted_by_corner(named, |(corners, _)| corners[0]))
}

/// Clips the `cell` of the point at the origin of `patch` by the points of `grid`.
fn clip(
    cell: &mut Cell,
    neighbors: &mut Vec<Neighbor>,
    grid: &NeighborGrid,
    patch: &Patch,
    spacing: f64,
) {
    let site = patch.origin;
    let usual = USUAL_CIRCUMRADIUS * spacing;
    grid.find_neighbors(site, 2.0 * usual, neighbors);
    if !cell.clip_within(patch, site, usual, neighbors) {
        let reach = LARGEST_CIRCUMRADIUS * spacing;
        grid.find_neighbors(site, 2.0 * reach, neighbors);
        cell.clip(patch, site, &[reach; BOUNDING_SIDES], neighbors);
    }
}

/// The triangles of `site` with the neighbours `around` its cell, each with the bit of the corner that the site is.
fn star(site: u32, around: &[Option<u32>]) -> Vec<(Corners, u8)> {
    let next = around.iter().cycle().skip(1);
    let corners = around.iter().zip(next).filter_map(|(&one, &other)| {
        let (one, other) = (one?, other?);
        let mut corners = [site, one, other];
        corners.sort_unstable();
        let [a, b, c] = corners;
        let place = corners.iter().position(|&corner| corner == site)?;
        (a < b && b < c).then_some((corners, 1_u8 << place))
    });
    corners.collect()
}

/// The triangles of `named`, which is sorted, each once.
fn merged(named: &[(Corners, u8)]) -> Vec<Candidate> {
    let of_same = named.chunk_by(|(one, _), (other, _)| one == other);
    of_same
        .map(|same| {
            let bits = same.iter().fold(0, |bits, (_, bit)| bits | bit);
            Candidate {
                corners: same[0].0,
                is_named_by: [0, 1, 2].map(|place| bits & (1 << place) != 0),
            }
        })
        .collect()
}
