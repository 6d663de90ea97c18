//! LZF, the compression of PCD files: runs of literal bytes, and copies of what stands at most 8192 bytes before.
//!
//! ```text
//!   000LLLLL                     L + 1 literal bytes follow
//!   LLLooooo          oooooooo   copy L + 2 bytes (L from 1 to 6) from o + 1 bytes before
//!   111ooooo llllllll oooooooo   copy l + 9 bytes from o + 1 bytes before
//! ```
//!
//! Blocks that are compressed apart from each other are one stream when they stand one behind the other.

use std::io::{self, Write};

/// The bytes of a block that is compressed apart from the others.
const BLOCK_BYTES: usize = 1 << 20;
/// The most bytes of a run of literals.
const LONGEST_RUN: usize = 32;
/// The most bytes of a copy, and the farthest that it reaches back.
const LONGEST_COPY: usize = 264;
const FARTHEST: usize = 8192;
/// The binary logarithm of the number of places that are remembered.
const HASH_BITS: u32 = 14;

/// A stream that compresses what is written to it.
pub(super) struct LzfWriter<W: Write> {
    out: W,
    block: Vec<u8>,
    compressed: Vec<u8>,
    written: u64,
}

impl<W: Write> LzfWriter<W> {
    pub(super) fn new(out: W) -> Self {
        Self {
            out,
            block: Vec::with_capacity(BLOCK_BYTES),
            compressed: Vec::new(),
            written: 0,
        }
    }

    /// Appends `bytes`.
    pub(super) fn push(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            let now = bytes.len().min(BLOCK_BYTES - self.block.len());
            self.block.extend_from_slice(&bytes[..now]);
            bytes = &bytes[now..];
            if self.block.len() == BLOCK_BYTES {
                self.flush_block()?;
            }
        }
        Ok(())
    }

    /// Writes what is left, and returns the number of compressed bytes.
    pub(super) fn finish(mut self) -> io::Result<u64> {
        self.flush_block()?;
        Ok(self.written)
    }

    fn flush_block(&mut self) -> io::Result<()> {
        self.compressed.clear();
        compress(&self.block, &mut self.compressed);
        self.block.clear();
        self.written += self.compressed.len() as u64;
        self.out.write_all(&self.compressed)
    }
}

/// Appends the compressed form of `input` to `out`.
fn compress(input: &[u8], out: &mut Vec<u8>) {
    // Positions plus one, by the hash of the three bytes there; zero stands for none.
    let mut seen = vec![0_u32; 1 << HASH_BITS];
    let (mut at, mut literals) = (0, 0);
    while at + 3 <= input.len() {
        let word = u32::from_be_bytes([0, input[at], input[at + 1], input[at + 2]]);
        let slot = &mut seen[(word.wrapping_mul(0x9E37_79B1) >> (32 - HASH_BITS)) as usize];
        let before = std::mem::replace(slot, at as u32 + 1) as usize;
        let is_copy = before > 0
            && at + 1 - before <= FARTHEST
            && input[before - 1..before + 2] == input[at..at + 3];
        if !is_copy {
            at += 1;
            continue;
        }
        let from = before - 1;
        let longest = LONGEST_COPY.min(input.len() - at);
        let mut length = 3;
        while length < longest && input[from + length] == input[at + length] {
            length += 1;
        }
        append_literals(&input[literals..at], out);
        let back = at - from - 1;
        match length - 2 {
            short @ ..7 => out.push((short << 5 | back >> 8) as u8),
            long => out.extend([(7 << 5 | back >> 8) as u8, (long - 7) as u8]),
        }
        out.push(back as u8);
        at += length;
        literals = at;
    }
    append_literals(&input[literals..], out);
}

fn append_literals(bytes: &[u8], out: &mut Vec<u8>) {
    for run in bytes.chunks(LONGEST_RUN) {
        out.push(run.len() as u8 - 1);
        out.extend_from_slice(run);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// What the definition of the format makes of a stream.
    fn decompressed(stream: &[u8]) -> Vec<u8> {
        let (mut out, mut at) = (Vec::new(), 0);
        while at < stream.len() {
            let control = usize::from(stream[at]);
            at += 1;
            if control < 32 {
                out.extend(&stream[at..=at + control]);
                at += control + 1;
                continue;
            }
            let mut length = control >> 5;
            if length == 7 {
                length += usize::from(stream[at]);
                at += 1;
            }
            let back = ((control & 31) << 8 | usize::from(stream[at])) + 1;
            at += 1;
            for _ in 0..length + 2 {
                out.push(out[out.len() - back]);
            }
        }
        out
    }

    fn round_trip(bytes: &[u8]) -> usize {
        let mut stream = Vec::new();
        let mut writer = LzfWriter::new(&mut stream);
        bytes
            .chunks(777)
            .for_each(|part| writer.push(part).unwrap());
        assert_eq!(writer.finish().unwrap(), stream.len() as u64);
        assert!(decompressed(&stream) == bytes);
        stream.len()
    }

    #[test]
    fn long_streams_come_back_and_repetition_is_small() {
        let counted: Vec<u8> = (0..700_000_u32).flat_map(u32::to_le_bytes).collect();
        round_trip(&counted);
        assert!(round_trip(&[7; 3_000_000]) < 60_000);
        assert_eq!(round_trip(&[]), 0);
    }

    proptest! {
        #[test]
        fn any_bytes_come_back(bytes in prop::collection::vec(0_u8..4, 0..3000)) {
            round_trip(&bytes);
        }
    }
}
