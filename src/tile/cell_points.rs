//! Points of a part of the plane: records, and the sums of points whose records are not kept.

use crate::{
    geometry::Stored,
    lloyd::{PointSum, Thinning},
};

/// Points as they lie in a spill.
#[derive(Clone, Debug, Default)]
pub(super) struct CellPoints {
    /// The records, one after the other.
    pub(super) records: Vec<u8>,
    /// The sums of the points that thinning has left out.
    pub(super) sums: Vec<PointSum>,
}

/// What is visited of a spill.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Spilled<'a> {
    /// The record of a point.
    Record(&'a [u8]),
    /// Points of which only the sum is known.
    Sum(&'a PointSum),
}

impl CellPoints {
    /// Bytes of a sum in a file.
    pub(super) const SUM_BYTES: usize = 32;

    /// Bytes of records and sums.
    pub(super) fn bytes(&self) -> usize {
        self.records.len() + Self::SUM_BYTES * self.sums.len()
    }

    /// Bytes of memory that are set aside.
    pub(super) fn capacity(&self) -> usize {
        self.records.capacity() + Self::SUM_BYTES * self.sums.capacity()
    }

    /// Adds `records` and `sums`.
    pub(super) fn extend(&mut self, records: &[u8], sums: &[PointSum]) {
        self.records.extend_from_slice(records);
        self.sums.extend_from_slice(sums);
    }

    /// Keeps those records of `record_length` bytes that `thinning` keeps, and the sums of the
    /// other points. Of several records at one position the smallest is kept.
    pub(super) fn thin(&mut self, record_length: usize, thinning: &Thinning) {
        let record = |index: u32| {
            let start = index as usize * record_length;
            &self.records[start..start + record_length]
        };
        let points: Vec<Stored> = (self.records.chunks_exact(record_length))
            .map(Stored::of_record)
            .collect();
        let order = |a, b| record(a).cmp(record(b));
        let (kept, others) = thinning.thin(&points, &[], &self.sums, order);
        if kept.len() == points.len() && others.len() == self.sums.len() {
            return;
        }
        let mut left = Vec::with_capacity(kept.len() * record_length);
        kept.iter()
            .for_each(|&index| left.extend_from_slice(record(index)));
        *self = Self {
            records: left,
            sums: others,
        };
    }

    /// Appends the bytes of `sums`, each its count and its sums of x, y and z as little endian
    /// words.
    pub(super) fn encode_sums(sums: &[PointSum], out: &mut Vec<u8>) {
        for PointSum { count, sum } in sums {
            out.extend(count.to_le_bytes());
            sum.iter().for_each(|c| out.extend(c.to_le_bytes()));
        }
    }

    /// The sum that is encoded in `bytes`, [`SUM_BYTES`](Self::SUM_BYTES) of them.
    pub(super) fn decode_sum(bytes: &[u8]) -> PointSum {
        let word = |k: usize| {
            let word = bytes[8 * k..8 * k + 8].try_into();
            u64::from_le_bytes(word.expect("eight bytes were taken"))
        };
        PointSum {
            count: word(0),
            sum: [word(1), word(2), word(3)].map(|word| word as i64),
        }
    }
}
