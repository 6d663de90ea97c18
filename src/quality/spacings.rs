//! How many points of a cloud want which spacing, where it varies.

use serde::{Deserialize, Serialize};

/// The spacings of neighbouring classes differ by a factor of √2; finer spacings are in the last class.
const CLASSES: usize = 14;

/// A tally of the spacings that are wanted at the points of a cloud, in classes that get finer by √2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct SpacingTally {
    /// The coarsest spacing (CRS units).
    coarsest: f64,
    counts: [u64; CLASSES],
    /// The finest and the coarsest spacing of each class (CRS units), where it has points.
    ranges: [[f64; 2]; CLASSES],
}

/// The points of a cloud that want spacings of one class.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct SpacingClass {
    /// The finest of these spacings (CRS units).
    pub(crate) finest: f64,
    /// The coarsest of these spacings (CRS units).
    pub(crate) coarsest: f64,
    /// The number of points.
    pub(crate) points: u64,
}

impl SpacingTally {
    /// An empty tally of spacings that are at most `coarsest` (CRS units).
    pub(crate) fn new(coarsest: f64) -> Self {
        Self {
            coarsest,
            counts: [0; CLASSES],
            ranges: [[f64::MAX, 0.0]; CLASSES],
        }
    }

    /// Adds a point that wants `spacing` (CRS units).
    pub(crate) fn push(&mut self, spacing: f64) {
        // The margin keeps a whole number of steps in its class, whatever the rounding.
        let steps = 2.0 * (self.coarsest / spacing).log2() - 1e-4;
        // `as` saturates.
        let class = (steps.max(0.0).ceil() as usize).min(CLASSES - 1);
        self.counts[class] += 1;
        let range = &mut self.ranges[class];
        *range = [range[0].min(spacing), range[1].max(spacing)];
    }

    /// Adds the points of another part of the cloud.
    pub(crate) fn add(&mut self, other: &Self) {
        for (count, more) in self.counts.iter_mut().zip(&other.counts) {
            *count += more;
        }
        for (range, other) in self.ranges.iter_mut().zip(&other.ranges) {
            *range = [range[0].min(other[0]), range[1].max(other[1])];
        }
    }

    /// The classes that have points, the finest first.
    pub(crate) fn classes(&self) -> Vec<SpacingClass> {
        let classes = self.counts.iter().zip(&self.ranges).rev();
        classes
            .filter(|&(&points, _)| points > 0)
            .map(|(&points, &[finest, coarsest])| SpacingClass {
                finest,
                coarsest,
                points,
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spacings_are_counted_by_class() {
        let mut tally = SpacingTally::new(0.4);
        for (spacing, times) in [(0.4, 3), (0.2, 5), (0.21, 1), (0.05, 7), (1e-9, 1)] {
            (0..times).for_each(|_| tally.push(spacing));
        }
        let class = |finest, coarsest, points| SpacingClass {
            finest,
            coarsest,
            points,
        };
        let expected = [
            class(1e-9, 1e-9, 1),
            class(0.05, 0.05, 7),
            class(0.2, 0.21, 6),
            class(0.4, 0.4, 3),
        ];
        assert_eq!(tally.classes(), expected);
    }
}
