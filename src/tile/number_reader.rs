//! Reads the numbers of a file one after the other.

/// Takes numbers, little endian, from the front of a slice; `None` when it is exhausted.
pub(super) struct NumberReader<'a>(pub(super) &'a [u8]);

impl NumberReader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    pub(super) fn u64(&mut self) -> Option<u64> {
        self.take().map(u64::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_le_bytes)
    }
}
