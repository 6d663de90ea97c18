//! Figures of input and output by equal squares of the plane.

use crate::job::Outcome;

/// The number of distances below which δ of a square says nothing.
const FEWEST_DISTANCES: u64 = 10;

/// Equal squares of the plane.
#[derive(Clone, Debug)]
pub(super) struct AreaMap {
    /// The edge of a square (CRS units).
    pub(super) edge: f64,
    /// The south-west corner of the square `[0, 0]` (world coordinates).
    pub(super) corner: [f64; 2],
    /// The squares that contain points.
    pub(super) squares: Vec<SquareRow>,
}

/// The figures of a square.
#[derive(Clone, Debug)]
pub(super) struct SquareRow {
    /// The number of squares from the square `[0, 0]` eastwards and northwards.
    pub(super) index: [i64; 2],
    /// The number of points of the input.
    pub(super) input: u64,
    /// The number of points of the output.
    pub(super) output: u64,
    /// δ of the output; NaN for too few points.
    pub(super) delta: f64,
    /// The mean nearest distance of the output, in spacings.
    pub(super) mean: f64,
    /// The number of isolated returns.
    pub(super) isolated: u64,
}

impl AreaMap {
    /// Returns the squares of `outcome` with their figures.
    pub(super) fn of(outcome: &Outcome) -> Self {
        let (spacing, map) = (outcome.plan.spacing, &outcome.views.uniformity_map);
        let (edge, corner) = map.edge_and_corner(&outcome.plan.quantization);
        let squares = map.squares().map(|(index, square)| {
            let distances = &square.distances;
            SquareRow {
                index,
                input: square.input,
                output: square.output,
                delta: match distances.count {
                    0..FEWEST_DISTANCES => f64::NAN,
                    _ => distances.delta(),
                },
                mean: distances.sum / distances.count as f64 / spacing,
                isolated: square.isolated,
            }
        });
        Self {
            edge,
            corner,
            squares: squares.collect(),
        }
    }
}
