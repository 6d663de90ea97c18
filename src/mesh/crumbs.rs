//! Crumbs: scraps of triangles in leaves and clutter, which are no surface.
//!
//! ```text
//!      /\_         _____/\      Here and there a few points in leaves have neighbours around them, and a patch that is trusted a little.
//!     /__\/       /\___/        Their triangles lead nowhere, point anywhere, and more than half of them are slivers.
//! ```
//!
//! Triangles hang together by their corners. Those that do are a crumb if they are few, reach nowhere far, and face no common
//! direction. A flat piece stays, however small it is: it can be a sign.

use std::collections::{HashMap, HashSet};

use nalgebra::Matrix3;

use super::{
    Corners, holes,
    joined::Joined,
    triangle::{doubled_area, places},
};
use crate::geometry::Local;

/// A crumb has no more triangles than this.
const MOST_TRIANGLES: u32 = 31;
/// A crumb is no wider than this along any axis, in spacings.
const WIDEST: f64 = 8.0;
/// How far away corners can be that decide on a triangle, in spacings: the diagonal of the box of a crumb, and the longest edge that
/// leads out of it.
pub(super) const REACH: f64 = 1.75 * WIDEST + holes::REACH;
/// The least share of a flat piece: of its area, by the squared cosines between the normals of its triangles and the direction that
/// they share the most.
const LEAST_FLAT_SHARE: f64 = 0.8;

/// The triangles that hang together with each other.
#[derive(Debug)]
struct Piece {
    /// The corners of the bounding box.
    bounds: [Local; 2],
    /// The sum of the squared normals by the doubled areas.
    facing: Matrix3<f64>,
    /// The sum of the doubled areas.
    area: f64,
}

/// Takes the crumbs among `triangles` away; `spacing` is that of the points (CRS units).
pub(super) fn sweep(positions: &[Local], spacing: f64, triangles: &mut Vec<Corners>) {
    let mut joined = Joined::new(positions.len());
    for &[a, b, c] in triangles.iter() {
        joined.join(a, b, false);
        joined.join(a, c, false);
    }
    let roots: Vec<u32> = triangles.iter().map(|it| joined.root(it[0]).0).collect();
    let mut counts = vec![0_u32; positions.len()];
    for &root in &roots {
        counts[root as usize] += 1;
    }
    let mut pieces: HashMap<u32, Piece> = HashMap::new();
    for (&root, &corners) in roots.iter().zip(triangles.iter()) {
        if counts[root as usize] <= MOST_TRIANGLES {
            let piece = pieces.entry(root).or_default();
            piece.add(places(positions, corners));
        }
    }
    let crumbs = pieces.into_iter().filter(|(_, it)| it.is_crumb(spacing));
    let crumbs: HashSet<u32> = crumbs.map(|(root, _)| root).collect();
    let mut roots = roots.into_iter();
    triangles.retain(|_| roots.next().is_none_or(|root| !crumbs.contains(&root)));
}

impl Default for Piece {
    fn default() -> Self {
        Self {
            bounds: [Local::repeat(f64::INFINITY), Local::repeat(-f64::INFINITY)],
            facing: Matrix3::zeros(),
            area: 0.0,
        }
    }
}

impl Piece {
    /// Adds the triangle with these corners.
    fn add(&mut self, corners: [Local; 3]) {
        for corner in corners {
            self.bounds[0] = self.bounds[0].inf(&corner);
            self.bounds[1] = self.bounds[1].sup(&corner);
        }
        let doubled = doubled_area(corners);
        let area = doubled.norm();
        // A triangle without area faces nowhere.
        if area > 0.0 {
            self.facing += doubled * doubled.transpose() / area;
            self.area += area;
        }
    }

    /// Whether the piece, which has few triangles, is a crumb.
    fn is_crumb(&self, spacing: f64) -> bool {
        let width = (self.bounds[1] - self.bounds[0]).max();
        let flat = self.facing.symmetric_eigenvalues().max();
        width <= WIDEST * spacing && flat < LEAST_FLAT_SHARE * self.area
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fan of `count` triangles around a point at `x`, whose rim goes up and down by `height`.
    fn fan(x: f64, count: u32, height: f64) -> (Vec<Local>, Vec<Corners>) {
        let on_rim = |k: u32| {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
            let z = height * f64::from(k % 2);
            Local::new(x + angle.cos(), angle.sin(), z)
        };
        let mut places = vec![Local::new(x, 0.0, 0.0)];
        places.extend((0..count).map(on_rim));
        let corners = (0..count).map(|k| [0, 1 + k, 1 + (k + 1) % count]);
        (places, corners.collect())
    }

    /// How many triangles are left of fans side by side.
    fn left(fans: &[(Vec<Local>, Vec<Corners>)], spacing: f64) -> usize {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (places, corners) in fans {
            let first = positions.len() as u32;
            positions.extend(places);
            triangles.extend(corners.iter().map(|it| it.map(|corner| first + corner)));
        }
        sweep(&positions, spacing, &mut triangles);
        triangles.len()
    }

    #[test]
    fn a_crumb_goes_and_flat_wide_and_large_pieces_stay() {
        assert_eq!(left(&[fan(0.0, 6, 1.5)], 1.0), 0);
        assert_eq!(left(&[fan(0.0, 6, 0.2)], 1.0), 6);
        // A fan is two units wide, more than eight spacings of 0.2.
        assert_eq!(left(&[fan(0.0, 6, 1.5)], 0.2), 6);
        assert_eq!(left(&[fan(0.0, 32, 1.5)], 1.0), 32);
        assert_eq!(left(&[fan(0.0, 6, 1.5), fan(3.0, 6, 0.2)], 1.0), 6);
    }
}
