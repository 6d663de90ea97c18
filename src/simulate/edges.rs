//! The edges of a street: where two plane surfaces meet.

use super::{
    bins::{Bins, bin_of},
    road::Road,
    shapes::Shape,
    solids::Solids,
};
use crate::geometry::Local;

/// The cosine of the angle between the normals of two rectangles from which on they count as
/// one plane.
const ONE_PLANE_COSINE: f64 = 0.9;
/// The distance below which surfaces touch.
const TOUCHING_DISTANCE: f64 = 1e-9;

/// Edges, found by bins.
#[derive(Debug)]
pub(super) struct Edges {
    segments: Vec<[Local; 2]>,
    bins: Bins,
}

impl Edges {
    /// Finds the edges of a street of this length: borders of rectangles that lie on another
    /// rectangle at an angle, or on the road.
    pub(super) fn find(length: f64, solids: &Solids, bins: &Bins, road: &Road) -> Self {
        let segments = segments(solids, bins, road);
        let bounds = segments.iter().map(|[a, b]| (a.inf(b), a.sup(b)));
        let bins = Bins::new(length, bounds);
        Self { segments, bins }
    }

    /// Returns the distance from `point` to the nearest edge; infinite beyond 40 m.
    pub(super) fn distance(&self, point: Local) -> f64 {
        let to_segment = |number: u32| distance_to_segment(point, self.segments[number as usize]);
        self.bins.nearest(point, f64::INFINITY, to_segment)
    }

    /// Returns the distance from `point` to the nearest of all edges, one by one.
    #[cfg(test)]
    pub(super) fn distance_by_all(&self, point: Local) -> f64 {
        let segments = self.segments.iter();
        let distances = segments.map(|&segment| distance_to_segment(point, segment));
        distances.fold(f64::INFINITY, f64::min)
    }
}

fn distance_to_segment(point: Local, [a, b]: [Local; 2]) -> f64 {
    let along = b - a;
    let share = (point - a).dot(&along) / along.norm_squared();
    (point - a - along * share.clamp(0.0, 1.0)).norm()
}

fn segments(solids: &Solids, bins: &Bins, road: &Road) -> Vec<[Local; 2]> {
    let rectangle = |number: u32| match solids.0[number as usize].0 {
        Shape::Rectangle { corner, edges } => Some((corner, edges)),
        _ => None,
    };
    let mut found = Vec::new();
    for own in 0..solids.0.len() as u32 {
        let Some((corner, [a, b])) = rectangle(own) else {
            continue;
        };
        let normal = a.cross(&b).normalize();
        let borders = [(corner, a), (corner + b, a), (corner, b), (corner + a, b)];
        for (start, along) in borders {
            let middle = start + along * 0.5;
            let meets = |&other: &u32| {
                rectangle(other).is_some_and(|(_, [a, b])| {
                    normal.dot(&a.cross(&b).normalize()).abs() < ONE_PLANE_COSINE
                        && solids.0[other as usize].0.distance(middle) < TOUCHING_DISTANCE
                })
            };
            let near = bins.bin(bin_of(middle));
            if near.iter().any(meets) || road.distance(middle) < TOUCHING_DISTANCE {
                found.push([start, start + along]);
            }
        }
    }
    found
}
