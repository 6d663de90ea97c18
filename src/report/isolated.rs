//! The isolated returns of a job: how many there were, where, and what became of them.

use serde::Serialize;

use super::{numbers::counted, squares::AreaMap};
use crate::{job::Outcome, lloyd::IsolatedRule};

/// The isolated returns of a job, whatever became of them.
#[derive(Clone, Debug, Serialize)]
pub(super) struct IsolatedReturns {
    /// What became of them.
    rule: IsolatedRule,
    /// How many there were, of the points that the output would have had.
    pub(super) count: u64,
    /// The squares of the map in which they lie.
    squares: Vec<IsolatedSquare>,
}

/// A square of the map with isolated returns.
#[derive(Clone, Debug, Serialize)]
struct IsolatedSquare {
    /// The south-west corner (world coordinates).
    min: [f64; 2],
    /// The north-east corner (world coordinates).
    max: [f64; 2],
    /// The number of isolated returns.
    count: u64,
}

impl IsolatedReturns {
    /// Returns those of `outcome`, by the squares of its `map`.
    pub(super) fn of(outcome: &Outcome, map: &AreaMap) -> Self {
        let corner = |index: [i64; 2]| [0, 1].map(|k| map.corner[k] + index[k] as f64 * map.edge);
        let squares = map.squares.iter().filter(|square| square.isolated > 0);
        let squares = squares.map(|square| IsolatedSquare {
            min: corner(square.index),
            max: corner(square.index.map(|k| k + 1)),
            count: square.isolated,
        });
        Self {
            rule: outcome.isolated,
            count: outcome
                .tiles
                .iter()
                .map(|tile| tile.isolated.len() as u64)
                .sum(),
            squares: squares.collect(),
        }
    }

    /// Returns how many there were and what became of them, in words.
    pub(super) fn in_words(&self) -> String {
        let became = match self.rule {
            IsolatedRule::Keep => "kept; left out with --isolated drop",
            IsolatedRule::Drop => "left out",
            IsolatedRule::Mark => "marked by class 7",
        };
        format!("{}, {became}", counted(self.count, "return"))
    }
}
