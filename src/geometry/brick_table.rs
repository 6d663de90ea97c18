//! The hash table by which bricks are found.
//!
//! A look through a box of space asks for a few bricks that lie side by side, most of them
//! empty. So the 2 × 2 × 2 bricks of an *octet* have the eight slots of one cache line, and a
//! slot carries part of the hash: an empty brick is known to be empty without a look at others.

use super::{CellIndex, hash::spread};

/// Slots of a cache line: one to each brick of an octet.
const LINE: usize = 8;

/// The way from an occupied slot to the next that is tried: another line, and another slot of
/// it. It is odd, so that every slot is tried.
const PROBE: usize = LINE + 1;

/// A hash table of bricks.
#[derive(Debug, Clone, Default)]
pub(super) struct BrickTable {
    slots: Vec<Slot>,
}

#[derive(Debug, Clone, Copy)]
struct Slot {
    /// Bits of the hash that do not choose the slot.
    tag: u32,
    /// The index of the brick in its list, or [`EMPTY`].
    entry: u32,
}

const EMPTY: u32 = u32::MAX;

impl BrickTable {
    /// The table of the bricks with these indices, in the order of their list: with twice as
    /// many slots as bricks the probes are short.
    pub(super) fn new(bricks: impl ExactSizeIterator<Item = CellIndex>) -> Self {
        let empty = Slot {
            tag: 0,
            entry: EMPTY,
        };
        let mut slots = vec![empty; (2 * bricks.len()).next_power_of_two().max(LINE)];
        let mask = slots.len() - 1;
        for (entry, index) in (0_u32..).zip(bricks) {
            let (first, tag) = hash(index);
            let mut slot = first & mask;
            while slots[slot].entry != EMPTY {
                slot = (slot + PROBE) & mask;
            }
            slots[slot] = Slot { tag, entry };
        }
        Self { slots }
    }

    /// The entry of the brick `index`, if it has one; `is_it` tells whether an entry is its.
    #[inline]
    pub(super) fn find(&self, index: CellIndex, is_it: impl Fn(usize) -> bool) -> Option<usize> {
        let mask = self.slots.len() - 1;
        let (first, tag) = hash(index);
        let mut slot = first & mask;
        loop {
            let found = self.slots[slot];
            if found.entry == EMPTY {
                return None;
            }
            if found.tag == tag && is_it(found.entry as usize) {
                return Some(found.entry as usize);
            }
            slot = (slot + PROBE) & mask;
        }
    }
}

/// The first slot to try, before it is cut to the size of the table, and the tag.
#[inline]
fn hash(index: CellIndex) -> (usize, u32) {
    let [x, y, z] = index.map(|c| u64::from((c >> 1) as u32));
    // An odd factor keeps layers apart.
    let octet = spread((x << 32 | y) ^ z.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let [i, j, k] = index.map(|c| (c & 1) as usize);
    let in_octet = i | j << 1 | k << 2;
    let first = (octet as usize).wrapping_mul(LINE) | in_octet;
    // The tags of the bricks of an octet differ.
    (first, ((octet >> 32) as u32 & !7) | in_octet as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bricks_are_found_and_no_others() {
        let shapes: [fn(i32) -> CellIndex; 3] = [
            |k| [k % 10, k / 10 % 10, k / 100],
            |k| [2 * k, 0, 0],
            |k| [i32::MAX - k, i32::MIN + k % 3, -k],
        ];
        for shape in shapes {
            let bricks: Vec<CellIndex> = (0..1000).map(shape).collect();
            let table = BrickTable::new(bricks.iter().copied());
            for (entry, &index) in bricks.iter().enumerate() {
                let find = |index| table.find(index, |entry| bricks[entry] == index);
                assert_eq!(find(index), Some(entry));
                assert_eq!(find(index.map(|c| c ^ 0x40_0000)), None);
            }
        }
        assert_eq!(BrickTable::new([].into_iter()).find([0; 3], |_| true), None);
    }
}
