//! The number of distinct hashes among many, in bounded memory.
//!
//! The method is adaptive sampling (Flajolet, *On adaptive sampling*, Computing 43, 1990): hashes up to a ceiling
//! are kept, and the ceiling is halved whenever they become too many. Neither the order of the hashes nor their
//! division among threads shows in the estimate.

use std::{
    collections::HashSet,
    hash::{BuildHasherDefault, Hasher},
};

/// The most hashes that are kept: the estimate has a standard error of 1.1 to 1.6 %.
const MAX_KEPT: usize = 8192;

/// Counts the distinct values among uniformly distributed hashes.
#[derive(Clone, Debug)]
pub(super) struct DistinctCount {
    kept: HashSet<u64, BuildHasherDefault<HalvesSwapped>>,
    /// The largest hash that is kept, one less than a power of two.
    ceiling: u64,
    /// The last hash that was added: neighbouring points of a scan often have the same.
    last: u64,
}

impl DistinctCount {
    /// A count of nothing.
    pub(super) fn new() -> Self {
        Self {
            kept: HashSet::default(),
            ceiling: u64::MAX,
            last: u64::MAX,
        }
    }

    /// Adds a hash.
    #[inline]
    pub(super) fn add(&mut self, hash: u64) {
        if hash <= self.ceiling && hash != self.last {
            self.last = hash;
            self.kept.insert(hash);
            self.lower_ceiling();
        }
    }

    /// Adds all hashes of `other`.
    pub(super) fn join(&mut self, other: &Self) {
        self.ceiling = self.ceiling.min(other.ceiling);
        self.kept.extend(&other.kept);
        let ceiling = self.ceiling;
        self.kept.retain(|&hash| hash <= ceiling);
        self.lower_ceiling();
    }

    /// Halves the ceiling until few enough hashes are kept.
    fn lower_ceiling(&mut self) {
        while self.kept.len() > MAX_KEPT {
            self.ceiling /= 2;
            let ceiling = self.ceiling;
            self.kept.retain(|&hash| hash <= ceiling);
        }
    }

    /// The estimated number of distinct hashes; it is exact up to [`MAX_KEPT`].
    pub(super) fn estimate(&self) -> f64 {
        let share_kept = (self.ceiling as f64 + 1.0) / (u64::MAX as f64 + 1.0);
        self.kept.len() as f64 / share_kept
    }
}

/// A hasher for values that are hashes already. The upper half of those that are kept is small, and the table
/// tells entries apart by their uppermost bits first.
#[derive(Clone, Copy, Debug, Default)]
struct HalvesSwapped(u64);

impl Hasher for HalvesSwapped {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = self.0.rotate_left(8) ^ u64::from(byte);
        }
    }

    fn write_u64(&mut self, hash: u64) {
        self.0 = hash.rotate_left(32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    fn count(hashes: impl Iterator<Item = u64>) -> DistinctCount {
        let mut count = DistinctCount::new();
        hashes.for_each(|hash| count.add(hash));
        count
    }

    #[test]
    fn repeated_hashes_count_once() {
        let few = count((0..50_000).map(|i| spread(i % 5000)));
        assert_eq!(few.estimate(), 5000.0);
        let many = count((0..1_200_000).map(|i| spread(i % 400_000)));
        assert!((many.estimate() / 400_000.0 - 1.0).abs() < 0.05);
        assert_eq!(count(std::iter::empty()).estimate(), 0.0);
    }

    #[test]
    fn order_and_division_do_not_show() {
        let all = count((0..100_000).map(spread));
        let reversed = count((0..100_000).rev().map(spread));
        let mut joined = count((60_000..100_000).map(spread));
        joined.join(&count((0..70_000).map(spread)));
        for other in [reversed, joined] {
            assert_eq!(other.kept, all.kept);
            assert_eq!(other.estimate(), all.estimate());
        }
    }
}
