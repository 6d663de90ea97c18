//! Cells as integers that sort brick by brick.

use super::cell_index::{BRICK_SHIFT, CELL_BITS, CellIndex, bit_of};

/// Cells of a box of bricks as integers that sort by brick (z, y, x), then by the index in the
/// brick.
pub(super) struct Packing {
    /// The index of the first brick on each axis.
    base: CellIndex,
    /// Number of bits of a brick's index on each axis.
    bits: [u32; 3],
}

impl Packing {
    /// The packing of the bricks from `base` to `top`.
    pub(super) fn of(base: CellIndex, top: CellIndex) -> Self {
        let bits = [0, 1, 2].map(|axis| {
            let last = i64::from(top[axis]) - i64::from(base[axis]);
            (last.max(0) as u64 + 1)
                .next_power_of_two()
                .trailing_zeros()
        });
        Self { base, bits }
    }

    /// Number of bits of a cell: 102 at most.
    #[inline]
    pub(super) fn cell_bits(&self) -> u32 {
        self.bits.iter().sum::<u32>() + CELL_BITS
    }

    /// The integer of the cell `index`.
    #[inline]
    pub(super) fn cell(&self, index: CellIndex) -> u128 {
        let mut packed = 0;
        for axis in [2, 1, 0] {
            let brick = i64::from(index[axis] >> BRICK_SHIFT) - i64::from(self.base[axis]);
            packed = packed << self.bits[axis] | brick as u128;
        }
        packed << CELL_BITS | u128::from(bit_of(index))
    }

    /// The index of the brick whose cells begin with `packed`.
    #[inline]
    pub(super) fn brick(&self, mut packed: u128) -> CellIndex {
        [0, 1, 2].map(|axis| {
            let index = packed & ((1 << self.bits[axis]) - 1);
            packed >>= self.bits[axis];
            (i64::from(self.base[axis]) + index as i64) as i32
        })
    }
}
