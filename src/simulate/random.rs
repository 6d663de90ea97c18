//! Pseudo-random numbers, by hashing.

use crate::geometry::spread;

/// Maps a hash to a number from 0 to 1, 1 excluded: its upper 53 bits as a fraction.
pub(super) fn unit(hash: u64) -> f64 {
    (hash >> 11) as f64 / (1_u64 << 53) as f64
}

/// A sequence of numbers that follows from its first hash.
pub(super) struct Random(pub(super) u64);

impl Random {
    /// Returns the next number of the sequence, from `low` to `high`.
    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = spread(self.0);
        low + (high - low) * (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns true with this probability.
    pub(super) fn happens(&mut self, probability: f64) -> bool {
        self.between(0.0, 1.0) < probability
    }
}
