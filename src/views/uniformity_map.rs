//! Figures of input and output by squares of the plane, for a map; and where the output is least
//! even.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::detail::DetailView;
use crate::{
    geometry::{Quantization, Stored},
    quality::DistanceSums,
    tile::Spill,
};

/// The number of squares along the longer side of a map, at most.
const MAX_SQUARES_ALONG: i64 = 128;
/// The number of nearest distances that a square needs for a meaningful δ.
const MIN_DISTANCES: u64 = 30;
/// The usual nearest distance in an even cloud, in spacings.
const USUAL_DISTANCE_IN_SPACINGS: f64 = 0.95;
/// The number of places that are reported as least even.
const WORST_PLACES: usize = 6;

/// A grid of squares over the plane with the figures of each square that contains points.
#[derive(Clone, Debug)]
pub(crate) struct UniformityMap {
    /// The edge of a square (stored units).
    edge: i64,
    /// The south-west corner of the first square (stored units).
    corner: [i64; 2],
    /// The squares by column and row, counted from the first square.
    squares: BTreeMap<[i64; 2], MapSquare>,
}

/// The figures of the output in some squares of a map.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(
    from = "Vec<([i64; 2], MapSquare)>",
    into = "Vec<([i64; 2], MapSquare)>"
)]
pub(crate) struct MapPart {
    /// The squares by column and row, counted from the first square of the map.
    squares: BTreeMap<[i64; 2], MapSquare>,
}

/// The figures of one square.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(crate) struct MapSquare {
    /// The number of input points.
    pub(crate) input: u64,
    /// The number of output points.
    pub(crate) output: u64,
    /// The nearest distances of the output points (CRS units).
    pub(crate) distances: DistanceSums,
    /// The number of isolated returns.
    pub(crate) isolated: u64,
    /// The output point whose nearest distance differs most from the usual one, after that
    /// difference in spacings.
    oddest: Option<(f64, Stored)>,
}

/// A place where the output is less even than elsewhere.
#[derive(Clone, Debug)]
pub(crate) struct WorstPlace {
    /// The coordinates of its oddest point (world coordinates).
    pub(crate) position: [f64; 3],
    /// δ of the square that contains the point.
    pub(crate) delta: f64,
    /// The detail view around the point.
    pub(crate) detail: DetailView,
}

impl UniformityMap {
    /// Makes a map over the points of `spill`, with their counts.
    pub(crate) fn of_input(spill: &Spill) -> Self {
        let bounds = spill.bounds();
        let counting_edge = spill.grid().square();
        // A square consists of whole counting squares, so that no counting square lies in two.
        let times = (bounds.extent() / MAX_SQUARES_ALONG / counting_edge + 1).max(1);
        let edge = times * counting_edge;
        let first = |axis: usize| i64::from(bounds.min[axis]).div_euclid(edge);
        let corner = [first(0), first(1)];
        let mut squares = BTreeMap::<[i64; 2], MapSquare>::new();
        for (counting_square, points) in spill.squares() {
            let square = [0, 1].map(|axis| counting_square[axis].div_euclid(times) - corner[axis]);
            squares.entry(square).or_default().input += points;
        }
        Self {
            edge,
            corner: corner.map(|c| c * edge),
            squares,
        }
    }

    /// Adds figures of the output.
    pub(crate) fn add(&mut self, part: &MapPart) {
        for (&index, square) in &part.squares {
            self.squares.entry(index).or_default().add(square);
        }
    }

    /// Adds an isolated return.
    pub(crate) fn push_isolated(&mut self, place: Stored) {
        let square = self.square_of(place);
        self.squares.entry(square).or_default().isolated += 1;
    }

    /// The column and the row of the square that contains `point`, counted from the first square.
    pub(crate) fn square_of(&self, point: Stored) -> [i64; 2] {
        let index = |c: i32, axis: usize| (i64::from(c) - self.corner[axis]).div_euclid(self.edge);
        [index(point.x, 0), index(point.y, 1)]
    }

    /// Returns the edge of a square and the south-west corner of the first square, in world
    /// coordinates.
    pub(crate) fn edge_and_corner(&self, quantization: &Quantization) -> (f64, [f64; 2]) {
        let world =
            |axis: usize| quantization.offset[axis] + self.corner[axis] as f64 * quantization.scale;
        (self.edge as f64 * quantization.scale, [world(0), world(1)])
    }

    /// The squares that contain points, by column and row counted from the first square.
    pub(crate) fn squares(&self) -> impl Iterator<Item = ([i64; 2], &MapSquare)> {
        self.squares.iter().map(|(&index, square)| (index, square))
    }

    /// Returns δ and the oddest point of the squares with the largest δ, the largest first.
    pub(crate) fn least_even_points(&self) -> Vec<(f64, Stored)> {
        let mut found: Vec<(f64, Stored)> = self
            .squares
            .values()
            .filter(|square| square.distances.count >= MIN_DISTANCES)
            .filter_map(|square| Some((square.distances.delta(), square.oddest?.1)))
            .collect();
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        found.truncate(WORST_PLACES);
        found
    }
}

impl MapPart {
    /// Adds a point of the output in `square` and the distance to the nearest other point (CRS units), if
    /// there is one nearby.
    pub(crate) fn push(
        &mut self,
        square: [i64; 2],
        point: Stored,
        nearest: Option<f64>,
        spacing: f64,
    ) {
        let square = self.squares.entry(square).or_default();
        square.output += 1;
        if let Some(distance) = nearest {
            square.distances.push(distance);
            let oddness = (distance / spacing - USUAL_DISTANCE_IN_SPACINGS).abs();
            square.take_oddest((oddness, point));
        }
    }

    /// Adds another part.
    pub(crate) fn add(&mut self, other: &Self) {
        for (&index, square) in &other.squares {
            self.squares.entry(index).or_default().add(square);
        }
    }
}

impl MapSquare {
    fn add(&mut self, other: &Self) {
        self.input += other.input;
        self.output += other.output;
        self.distances.add(&other.distances);
        self.isolated += other.isolated;
        if let Some(oddest) = other.oddest {
            self.take_oddest(oddest);
        }
    }

    /// Remembers a point after its difference from the usual distance, if that is the largest so far.
    fn take_oddest(&mut self, (oddness, point): (f64, Stored)) {
        let is_odder = |(largest, known): (f64, Stored)| (oddness, point) > (largest, known);
        if self.oddest.is_none_or(is_odder) {
            self.oddest = Some((oddness, point));
        }
    }
}

impl From<Vec<([i64; 2], MapSquare)>> for MapPart {
    fn from(squares: Vec<([i64; 2], MapSquare)>) -> Self {
        Self {
            squares: squares.into_iter().collect(),
        }
    }
}

impl From<MapPart> for Vec<([i64; 2], MapSquare)> {
    fn from(part: MapPart) -> Self {
        part.squares.into_iter().collect()
    }
}
