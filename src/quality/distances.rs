//! Distances from one cloud to another: accuracy (output to input) and
//! coverage (input to output).

use serde::{Deserialize, Serialize};

/// Number of bins to a spacing.
const BINS_PER_SPACING: f64 = 256.0;
/// Range of the bins. Larger distances are counted in the last bin; their mean and maximum remain
/// exact.
const RANGE_IN_SPACINGS: f64 = 8.0;
/// Steps to a spacing in which distances are summed, 2⁶⁴: a sum of integers does not depend on the order of its terms.
const SUM_STEPS_PER_SPACING: f64 = 18_446_744_073_709_551_616.0;

/// A tally of distances, in bounded memory. Neither the order of the distances nor their division into parts shows in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DistanceTally {
    spacing: f64,
    bins: Vec<u64>,
    count: u64,
    /// The sum of the distances in steps of 2⁻⁶⁴ spacings.
    sum: u128,
    max: f64,
    beyond: u64,
}

/// The figures of a [`DistanceTally`]. Lengths are CRS units; all are NaN without distances.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DistanceFigures {
    /// Number of distances.
    pub count: u64,
    /// Mean distance.
    pub mean: f64,
    /// The 99th percentile, to 1/256 of a spacing.
    pub p99: f64,
    /// Largest distance.
    pub max: f64,
    /// Share of the distances beyond 1.5 spacings.
    pub share_beyond: f64,
}

impl DistanceTally {
    /// An empty tally, for an output at `spacing` (CRS units).
    pub fn new(spacing: f64) -> Self {
        Self {
            spacing,
            bins: vec![0; (BINS_PER_SPACING * RANGE_IN_SPACINGS) as usize + 1],
            count: 0,
            sum: 0,
            max: 0.0,
            beyond: 0,
        }
    }

    /// Adds one distance (CRS units).
    pub fn push(&mut self, distance: f64) {
        self.push_at(distance, self.spacing);
    }

    /// Adds one distance from a place where the spacing is `spacing` (both CRS units).
    pub(crate) fn push_at(&mut self, distance: f64, spacing: f64) {
        // `as` saturates, and takes what is not a number for zero.
        let spacings = distance / self.spacing;
        let bin = (spacings * BINS_PER_SPACING) as usize;
        let last = self.bins.len() - 1;
        self.bins[bin.min(last)] += 1;
        self.count += 1;
        let steps = (spacings * SUM_STEPS_PER_SPACING) as u128;
        self.sum = self.sum.saturating_add(steps);
        self.max = self.max.max(distance);
        self.beyond += u64::from(distance > 1.5 * spacing);
    }

    /// Adds the distances of another part of the cloud.
    pub(crate) fn add(&mut self, other: &Self) {
        for (bin, more) in self.bins.iter_mut().zip(&other.bins) {
            *bin += more;
        }
        self.count += other.count;
        self.sum = self.sum.saturating_add(other.sum);
        self.max = self.max.max(other.max);
        self.beyond += other.beyond;
    }

    /// The number of distances in each of `bins` equal parts of 0 to `spacings` spacings; larger
    /// distances are in the last part.
    pub(crate) fn histogram(&self, bins: usize, spacings: f64) -> Vec<u64> {
        let mut counts = vec![0; bins];
        for (k, &count) in self.bins.iter().enumerate() {
            let share = (k as f64 + 0.5) / BINS_PER_SPACING / spacings;
            counts[((share * bins as f64) as usize).min(bins - 1)] += count;
        }
        counts
    }

    /// The figures of all distances so far.
    pub fn figures(&self) -> DistanceFigures {
        let count = self.count as f64;
        let rank = (0.99 * count).ceil() as u64;
        let mut seen = 0;
        let p99 = self
            .bins
            .iter()
            .position(|bin| {
                seen += bin;
                seen >= rank
            })
            .filter(|_| self.count > 0)
            .map_or(f64::NAN, |bin| match bin + 1 < self.bins.len() {
                true => ((bin as f64 + 1.0) / BINS_PER_SPACING * self.spacing).min(self.max),
                // The last bin has no upper end.
                false => self.max,
            });
        DistanceFigures {
            count: self.count,
            mean: self.sum as f64 / SUM_STEPS_PER_SPACING * self.spacing / count,
            p99,
            max: if self.count > 0 { self.max } else { f64::NAN },
            share_beyond: self.beyond as f64 / count,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figures_of_a_ramp_are_known() {
        let mut tally = DistanceTally::new(1.0);
        for i in 1..=1000 {
            tally.push(f64::from(i) * 0.002);
        }
        let figures = tally.figures();
        assert!((figures.mean - 1.001).abs() < 1e-9);
        assert!((figures.p99 - 1.98).abs() < 0.005);
        assert_eq!(figures.max, 2.0);
        assert_eq!(figures.share_beyond, 0.25);
        assert_eq!(tally.histogram(4, 1.0), [124, 125, 125, 626]);
    }

    #[test]
    fn parts_add_up_to_the_whole() {
        let (mut whole, mut part, mut other) = (
            DistanceTally::new(0.5),
            DistanceTally::new(0.5),
            DistanceTally::new(0.5),
        );
        // Numbers whose sums are rounded, and therefore depend on their order.
        for i in 0..512 {
            let distance = f64::from(i).sqrt() / 3.0;
            whole.push(distance);
            if i % 3 == 0 { &mut part } else { &mut other }.push(distance);
        }
        part.add(&other);
        assert_eq!(part, whole);
    }
}
