//! Hashes: 64 bits that depend on coordinates and seeds alone, the same on every machine.
//!
//! They stand for chance. A choice by hash does not depend on the order of files, on tiles or
//! on threads, so that two tiles that see the same point choose alike.

use super::Stored;

/// A hash of `key` in which every bit depends on every bit of the key (the finaliser of
/// SplitMix64; Steele, Lea and Flood, *Fast splittable pseudorandom number generators*, 2014).
#[inline]
pub(crate) fn spread(key: u64) -> u64 {
    let mut z = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

impl Stored {
    /// The 64-bit tie-break hash of the coordinates. Ties between equal hashes are broken by
    /// the point itself.
    #[inline]
    pub(crate) fn tie_break_hash(&self) -> u64 {
        let [x, y, z] = [self.x, self.y, self.z].map(|c| u64::from(c as u32));
        spread(spread(x << 32 | y) ^ z)
    }

    /// The priority of the point in every election with this `seed`; the lowest is elected
    /// first. It is a hash of the coordinates, so that it does not depend on where in which
    /// file the point stood.
    #[inline]
    pub(crate) fn priority(&self, seed: u64) -> u64 {
        let [x, y, z] = [self.x, self.y, self.z].map(|c| u64::from(c as u32));
        spread(spread(x << 32 | y) ^ spread(z ^ spread(seed)))
    }
}

/// A sequence of pseudorandom numbers that follows from one hash.
pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// The next number, uniform in [0, 1).
    #[inline]
    pub(crate) fn roll(&mut self) -> f64 {
        self.0 = spread(self.0);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}
