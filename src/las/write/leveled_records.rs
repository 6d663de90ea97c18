//! Records with the number of the first of nested sets that contains each of them.

use rayon::prelude::*;

use super::{
    nested_sets::NestedSets,
    store::{SortedRecords, StoreError},
};
use crate::geometry::{Rect, Stored};

/// The records in a rectangle, in the order of their positions, and those of one position by all of their bytes.
pub(super) struct LeveledRecords {
    bytes: Vec<u8>,
    record_length: usize,
    /// The position of each record, the number of its set, and its own number in `bytes`.
    order: Vec<(Stored, u8, u32)>,
}

impl LeveledRecords {
    /// Reads the records of `sorted` in `rect`. Of several records at one position the first belongs to the set that
    /// contains the position, the others to the last set.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn read(
        sorted: &dyn SortedRecords,
        sets: &NestedSets<'_>,
        rect: &Rect,
        record_length: usize,
    ) -> Result<Self, StoreError> {
        let bytes = sorted.read(rect)?;
        let record = |number: u32| &bytes[number as usize * record_length..][..record_length];
        // The records of a rectangle are in memory: their number fits into 32 bits.
        let (count, last) = ((bytes.len() / record_length) as u32, sets.last());
        let mut order: Vec<(Stored, u8, u32)> = bytes
            .par_chunks_exact(record_length)
            .zip(0..count)
            .map(|(record, number)| (Stored::of_record(record), last, number))
            .collect();
        order.par_sort_unstable_by(|a, b| {
            let by_bytes = || record(a.2).cmp(record(b.2));
            a.0.cmp(&b.0).then_with(by_bytes)
        });
        // Both are in the order of positions; every elected position is one of a record.
        let mut records = order.iter_mut();
        for (point, set) in sets.first_sets(rect)? {
            if let Some(found) = records.find(|(position, ..)| *position == point) {
                found.1 = set;
            }
        }
        Ok(Self {
            bytes,
            record_length,
            order,
        })
    }

    /// The records, each with its position and the number of its set.
    pub(super) fn iter(&self) -> impl Iterator<Item = (Stored, u8, &[u8])> {
        self.order.iter().map(|&(point, set, number)| {
            let start = number as usize * self.record_length;
            (point, set, &self.bytes[start..][..self.record_length])
        })
    }
}
