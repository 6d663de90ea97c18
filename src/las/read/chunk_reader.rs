//! LAZ whose chunks differ in length, as those of an octree do, chunk by chunk.

use std::{
    io::{Seek, SeekFrom},
    ops::Range,
};

use ::las::point::Format;
use laz::{
    LazItem,
    record::{LayeredPointRecordDecompressor, RecordDecompressor},
};

use super::{
    guard::{DECODER_FAILED, GuardedFile, guarded},
    input::InputFile,
};
use crate::las::format::chunk_table::{Chunk, check_layers};

/// The points of several chunks, one after the other.
pub(super) struct ChunkReader {
    decompressor: LayeredPointRecordDecompressor<'static, GuardedFile>,
    items: Vec<LazItem>,
    /// The chunks that are still to be read; the next one is the last.
    chunks: Vec<Chunk>,
    /// The number of points of the present chunk that are still to be read.
    left: u64,
    /// The format of the points, if the layers of chunks were not checked in the survey.
    unchecked: Option<Format>,
}

impl ChunkReader {
    /// Opens `input`, whose points are the `chunks`, at the points `range`.
    ///
    /// # Errors
    ///
    /// A text that says what is wrong with the file.
    pub(super) fn open(
        input: &InputFile,
        items: Vec<LazItem>,
        chunks: &[Chunk],
        range: &Range<u64>,
    ) -> Result<Self, String> {
        let file = input
            .source
            .open(&input.byte_ranges(range))
            .and_then(GuardedFile::new);
        let file = file.map_err(|e| format!("cannot be read: {e}"))?;
        let (mut first, mut before) = (0, 0);
        while let Some(chunk) = chunks.get(first)
            && before + chunk.points <= range.start
        {
            before += chunk.points;
            first += 1;
        }
        let mut reader = Self {
            decompressor: LayeredPointRecordDecompressor::new(file),
            items,
            chunks: chunks[first..].iter().rev().copied().collect(),
            left: 0,
            unchecked: input.source.is_remote().then_some(input.format),
        };
        let mut raw = Vec::new();
        reader.fill(range.start - before, &mut raw)?;
        Ok(reader)
    }

    /// Replaces `raw` by the next records: `wanted` of them, or fewer at the end.
    ///
    /// # Errors
    ///
    /// A text that says why they cannot be decoded.
    pub(super) fn fill(&mut self, wanted: u64, raw: &mut Vec<u8>) -> Result<u64, String> {
        raw.clear();
        let mut read = 0;
        while read < wanted {
            if self.left == 0 {
                let Some(chunk) = self.chunks.pop() else {
                    break;
                };
                self.enter(&chunk)?;
            }
            let now = self.left.min(wanted - read);
            let length = self.decompressor.record_size();
            let start = raw.len();
            raw.resize(start + now as usize * length, 0);
            let decompressor = &mut self.decompressor;
            match guarded(|| decompressor.decompress_many(&mut raw[start..])) {
                Some(Ok(())) => {}
                Some(Err(error)) => return Err(error.to_string()),
                None => return Err(DECODER_FAILED.to_owned()),
            }
            self.left -= now;
            read += now;
        }
        Ok(read)
    }

    /// Moves to the first point of `chunk`.
    fn enter(&mut self, chunk: &Chunk) -> Result<(), String> {
        if let Some(format) = &self.unchecked {
            check_layers(self.decompressor.get_mut(), chunk, format)?;
        }
        let sought = self
            .decompressor
            .get_mut()
            .seek(SeekFrom::Start(chunk.offset));
        sought.map_err(|e| e.to_string())?;
        self.decompressor.reset();
        let fields = self.decompressor.set_fields_from(&self.items);
        fields.map_err(|e| e.to_string())?;
        self.left = chunk.points;
        Ok(())
    }
}
