//! Which bytes of a file the decoding of a part reads.

use std::ops::Range;

use super::input::{EntryPoints, InputFile};
use crate::las::format::chunk_table::Chunk;

impl InputFile {
    /// The bytes of the points `part`, in the order in which they are decoded: of whole chunks, where points are compressed
    /// in chunks.
    pub(super) fn byte_ranges(&self, part: &Range<u64>) -> Vec<Range<u64>> {
        if !self.source.is_remote() {
            return Vec::new();
        }
        match &self.entry_points {
            EntryPoints::Chunks { chunks, .. } | EntryPoints::AlikeChunks(chunks) => {
                ranges_of(chunks, part)
            }
            _ if self.format.is_compressed => {
                let range = self.points_start..self.bytes;
                vec![range]
            }
            _ => {
                let byte = |point: u64| self.points_start + point * u64::from(self.format.len());
                let range = byte(part.start)..byte(part.end);
                vec![range]
            }
        }
    }

    /// Begins to read the points `part` of a remote file, which will soon be decoded. Does nothing for a local one.
    pub(crate) fn prefetch(&self, part: &Range<u64>) {
        self.source.prefetch(&self.byte_ranges(part));
    }
}

/// The bytes of those `chunks` that have points of `part`.
fn ranges_of(chunks: &[Chunk], part: &Range<u64>) -> Vec<Range<u64>> {
    let mut ranges: Vec<Range<u64>> = Vec::new();
    let mut start = 0;
    for chunk in chunks {
        let end = start + chunk.points;
        if end > part.start && start < part.end {
            ranges.push(chunk.offset..chunk.offset + chunk.bytes);
        }
        start = end;
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_reads_the_chunks_with_its_points() {
        let chunk = |offset, points| Chunk {
            offset,
            bytes: 10,
            points,
            rectangle: None,
            spacing_above: None,
        };
        let chunks = [chunk(100, 5), chunk(110, 0), chunk(110, 5), chunk(120, 1)];
        let one = |range: Range<u64>| vec![range];
        assert_eq!(ranges_of(&chunks, &(0..5)), one(100..110));
        assert_eq!(ranges_of(&chunks, &(4..6)), [100..110, 110..120, 110..120]);
        assert_eq!(ranges_of(&chunks, &(10..11)), one(120..130));
    }
}
