//! Figures of input and output square by square, for a map, and where the output is least
//! even.

use std::collections::BTreeMap;

use super::detail::DetailView;
use crate::{
    geometry::{Quantization, Stored},
    lloyd::DistanceSums,
    tile::Spill,
};

/// Squares along the longer side of a map.
const MOST_ALONG: i64 = 128;
/// Points that a square must have for its δ to say anything.
const ENOUGH: u64 = 30;
/// Nearest distance that is usual in an even cloud, in spacings.
const USUAL: f64 = 0.95;
/// Places that are told.
const WORST: usize = 6;

/// A grid of squares over the plane; those with points.
#[derive(Clone, Debug)]
pub(crate) struct UniformityMap {
    /// Edge of a square, and the south-west corner of the first (stored units).
    edge: i64,
    corner: [i64; 2],
    squares: BTreeMap<[i64; 2], MapSquare>,
}

/// What is in a square.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MapSquare {
    /// Points of the input.
    pub(crate) input: u64,
    /// Points of the output.
    pub(crate) output: u64,
    /// Nearest distances of the output (CRS units).
    pub(crate) distances: DistanceSums,
    /// Of the output's points the one whose nearest distance is least usual, and by how
    /// much (spacings).
    oddest: Option<(f64, Stored)>,
}

/// A place where the output is less even than elsewhere.
#[derive(Clone, Debug)]
pub(crate) struct WorstPlace {
    /// Where (world coordinates).
    pub(crate) place: [f64; 3],
    /// δ of the square around it.
    pub(crate) delta: f64,
    /// What it looks like.
    pub(crate) detail: DetailView,
}

impl UniformityMap {
    /// A field over the points of `spill`.
    pub(crate) fn of_input(spill: &Spill) -> Self {
        let bounds = spill.bounds();
        let counting = spill.grid().square();
        // Whole counting squares, so that none lies in two.
        let times = (bounds.extent() / MOST_ALONG / counting + 1).max(1);
        let edge = times * counting;
        let first = |axis: usize| i64::from(bounds.min[axis]).div_euclid(edge);
        let corner = [first(0), first(1)];
        let mut squares = BTreeMap::<[i64; 2], MapSquare>::new();
        for (place, points) in spill.squares() {
            let square = [0, 1].map(|axis| place[axis].div_euclid(times) - corner[axis]);
            squares.entry(square).or_default().input += points;
        }
        Self {
            edge,
            corner: corner.map(|c| c * edge),
            squares,
        }
    }

    /// Adds a point of the output, and how far the next one is, if one is near.
    pub(crate) fn push(&mut self, point: Stored, nearest: Option<f64>, spacing: f64) {
        let along = |c: i32, axis: usize| (i64::from(c) - self.corner[axis]).div_euclid(self.edge);
        let square = self
            .squares
            .entry([along(point.x, 0), along(point.y, 1)])
            .or_default();
        square.output += 1;
        let Some(distance) = nearest else {
            return;
        };
        square.distances.push(distance);
        let odd = (distance / spacing - USUAL).abs();
        if square
            .oddest
            .is_none_or(|(most, known)| (odd, point) > (most, known))
        {
            square.oddest = Some((odd, point));
        }
    }

    /// Edge of a square, and the south-west corner of the first, in world coordinates.
    pub(crate) fn ground(&self, quantization: &Quantization) -> (f64, [f64; 2]) {
        let world =
            |axis: usize| quantization.offset[axis] + self.corner[axis] as f64 * quantization.scale;
        (self.edge as f64 * quantization.scale, [world(0), world(1)])
    }

    /// The squares with points, by their place from the first: eastwards, northwards.
    pub(crate) fn squares(&self) -> impl Iterator<Item = ([i64; 2], &MapSquare)> {
        self.squares.iter().map(|(&place, square)| (place, square))
    }

    /// Where the output is least even: the oddest points of the squares of the largest δ.
    pub(crate) fn worst(&self) -> Vec<(f64, Stored)> {
        let mut found: Vec<(f64, Stored)> = self
            .squares
            .values()
            .filter(|square| square.distances.count >= ENOUGH)
            .filter_map(|square| Some((square.distances.delta(), square.oddest?.1)))
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        found.truncate(WORST);
        found
    }
}
