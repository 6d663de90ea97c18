//! Sorted records in an order that depends on nothing but the points: not on tiles, threads or memory.

use std::collections::BTreeMap;

use super::store::{SortedRecords, StoreError};
use crate::geometry::{Rect, Stored};

/// The number of counting squares along the edge of a block: records lie together by about as much.
const SQUARES_PER_BLOCK: i64 = 8;

/// Bytes by which a record is put in order.
const ENTRY_BYTES: u64 = size_of::<([i64; 2], Stored, &[u8])>() as u64;

/// Records by block of the plane, in a block by counting square, there by position, and at one position byte by byte.
pub(super) struct OrderedRecords<'a> {
    records: &'a dyn SortedRecords,
    record_length: usize,
    /// The most bytes of records that are put in order at a time; a square may have more.
    most_bytes: u64,
    /// The edge of a counting square (stored units).
    edge: i64,
    /// The number of records in each counting square, by row and column.
    squares: BTreeMap<[i64; 2], u64>,
}

impl<'a> OrderedRecords<'a> {
    pub(super) fn new(
        records: &'a dyn SortedRecords,
        record_length: usize,
        most_bytes: usize,
    ) -> Self {
        let squares = records.squares();
        let edge = squares
            .first()
            .map_or(1, |(rect, _)| rect.max[0] - rect.min[0]);
        let numbered = squares.into_iter().map(|(rect, points)| {
            let number = [rect.min[1].div_euclid(edge), rect.min[0].div_euclid(edge)];
            (number, points)
        });
        Self {
            records,
            record_length,
            most_bytes: most_bytes as u64,
            edge,
            squares: numbered.collect(),
        }
    }

    /// Calls `visit` with every record whose point lies in `rect`, in the order.
    ///
    /// # Errors
    ///
    /// If the store cannot be read, or `visit` fails.
    pub(super) fn visit(
        &self,
        rect: &Rect,
        visit: &mut dyn FnMut(&[u8]) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        for group in self.groups(rect) {
            let squares = Rect {
                min: [0, 1].map(|axis| group.iter().map(|s| s[1 - axis]).min().unwrap_or(0)),
                max: [0, 1].map(|axis| group.iter().map(|s| s[1 - axis] + 1).max().unwrap_or(0)),
            };
            let region = Rect {
                min: [0, 1].map(|axis| (squares.min[axis] * self.edge).max(rect.min[axis])),
                max: [0, 1].map(|axis| (squares.max[axis] * self.edge).min(rect.max[axis])),
            };
            let bytes = self.records.read(&region)?;
            let mut found: Vec<([i64; 2], Stored, &[u8])> = bytes
                .chunks_exact(self.record_length)
                .map(|record| {
                    let point = Stored::of_record(record);
                    let number = [point.y, point.x].map(|c| i64::from(c).div_euclid(self.edge));
                    (number, point, record)
                })
                .filter(|(number, ..)| group.binary_search(number).is_ok())
                .collect();
            found.sort_unstable();
            for (_, _, record) in found {
                visit(record)?;
            }
        }
        Ok(())
    }

    /// The most records that may lie in `rect`.
    pub(super) fn most_points_in(&self, rect: &Rect) -> u64 {
        let touched = self.touched(rect);
        touched.iter().map(|number| self.squares[number]).sum()
    }

    /// The occupied squares that touch `rect`, in the order of their blocks, in groups of one block that fit the memory.
    fn groups(&self, rect: &Rect) -> Vec<Vec<[i64; 2]>> {
        let block = |number: &[i64; 2]| number.map(|c| c.div_euclid(SQUARES_PER_BLOCK));
        let mut touched = self.touched(rect);
        touched.sort_unstable_by_key(|number| (block(number), *number));
        let mut groups: Vec<Vec<[i64; 2]>> = Vec::new();
        let mut bytes = 0;
        for number in touched {
            let more = self.squares[&number] * (self.record_length as u64 + ENTRY_BYTES);
            match groups.last_mut() {
                Some(group)
                    if block(&group[0]) == block(&number) && bytes + more <= self.most_bytes =>
                {
                    group.push(number);
                    bytes += more;
                }
                _ => {
                    groups.push(vec![number]);
                    bytes = more;
                }
            }
        }
        groups
    }

    fn touched(&self, rect: &Rect) -> Vec<[i64; 2]> {
        let [west, south] = rect.min.map(|c| c.div_euclid(self.edge));
        let [east, north] = rect.max.map(|c| (c - 1).div_euclid(self.edge));
        let rows = self.squares.range([south, i64::MIN]..=[north, i64::MAX]);
        rows.map(|(number, _)| *number)
            .filter(|number| (west..=east).contains(&number[1]))
            .collect()
    }
}
