//! The checksum of an object whose pieces arrive in any order.
//!
//! SHA-256 takes bytes in order only. Pieces that are early wait, up to a number of bytes; if there are more, all are
//! forgotten, and read once more in the end.
//!
//! ```text
//!   ████████████│      ▒▒▒▒▒  ▒▒▒        ███ taken   ▒▒▒ waiting
//!             next
//! ```

use std::{collections::BTreeMap, ops::Range};

use sha2::{Digest, Sha256};

use crate::store::checksum::digits;

/// A checksum on the way. `P` is a piece: bytes that it shares with their reader.
pub(super) struct OrderedDigest<P> {
    digest: Sha256,
    /// The offset of the first byte that was not taken yet.
    next: u64,
    /// The pieces that wait, by the offsets of their first bytes.
    waiting: BTreeMap<u64, P>,
    /// Bytes that may wait, and those that do.
    limit: u64,
    held: u64,
}

impl<P: AsRef<[u8]>> OrderedDigest<P> {
    /// A checksum of which at most `limit` bytes wait.
    pub(super) fn new(limit: u64) -> Self {
        Self {
            digest: Sha256::new(),
            next: 0,
            waiting: BTreeMap::new(),
            limit,
            held: 0,
        }
    }

    /// The offset of the first byte that was not taken yet.
    pub(super) fn next(&self) -> u64 {
        self.next
    }

    /// The offset of the first piece that waits.
    pub(super) fn first_waiting(&self) -> Option<u64> {
        self.waiting.keys().next().copied()
    }

    /// Takes the `piece` at `offset`, now or when those before it have come.
    pub(super) fn offer(&mut self, offset: u64, piece: P) {
        let length = piece.as_ref().len() as u64;
        if offset <= self.next {
            self.take(offset, piece.as_ref());
        } else if self.held + length > self.limit {
            // There would be a gap: whatever is beyond it has to be read again, and nothing waits any more.
            self.waiting.clear();
            (self.held, self.limit) = (0, 0);
        } else if !self.waiting.contains_key(&offset) {
            self.held += length;
            self.waiting.insert(offset, piece);
        }
        while let Some(first) = self.waiting.first_entry()
            && *first.key() <= self.next
        {
            let (offset, piece) = first.remove_entry();
            self.held -= piece.as_ref().len() as u64;
            self.take(offset, piece.as_ref());
        }
    }

    /// Takes what was not taken yet of the `piece` at `offset`, which is not beyond the next byte.
    fn take(&mut self, offset: u64, piece: &[u8]) {
        let Range { start, end } = offset..offset + piece.len() as u64;
        if end > self.next {
            self.digest.update(&piece[(self.next - start) as usize..]);
            self.next = end;
        }
    }

    /// The checksum of all bytes that were taken, in hexadecimal digits.
    pub(super) fn finish(self) -> String {
        digits(self.digest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_in_any_order_have_the_checksum_of_the_whole() {
        // FIPS 180-2, appendix B.1 and B.2.
        let text = b"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq";
        let sum = "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1";
        let mut digest = OrderedDigest::new(30);
        for range in [20..30, 50..56, 0..7, 5..20, 30..50, 30..50] {
            digest.offer(range.start as u64, &text[range]);
        }
        assert_eq!(digest.next(), 56);
        assert_eq!(digest.finish(), sum);
        let mut digest = OrderedDigest::new(3);
        digest.offer(1, &b"bc"[..]);
        digest.offer(40, &b"forgotten"[..]);
        digest.offer(0, &b"a"[..]);
        assert_eq!((digest.next(), digest.held), (1, 0));
        digest.offer(2, &b"c"[..]);
        digest.offer(1, &b"bc"[..]);
        assert_eq!(
            digest.finish(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
