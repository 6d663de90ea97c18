//! LAZ whose chunks differ in length, as those of an octree do, chunk by chunk.

use std::{
    fs::File,
    io::{Seek, SeekFrom},
    ops::Range,
    path::Path,
};

use ::las::copc::{CopcHierarchyVlr, CopcInfoVlr};
use laz::{
    LazItem,
    record::{LayeredPointRecordDecompressor, RecordDecompressor},
};

use super::guard::{GuardedFile, guarded};

/// Points that are compressed together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Chunk {
    /// Where in the file it begins.
    pub(super) at: u64,
    /// How many there are.
    pub(super) points: u64,
    /// The rectangle that they lie in, if that is known: least and greatest x and y.
    pub(super) ground: Option<[[f64; 2]; 2]>,
}

/// Gives every chunk that is a node of the octree the node's ground.
pub(super) fn place_chunks(chunks: &mut [Chunk], info: &CopcInfoVlr, hierarchy: &CopcHierarchyVlr) {
    for entry in hierarchy.iter_entries().flatten() {
        // A level beyond that would shift bits out of its number.
        if !(0..31).contains(&entry.key.l) {
            continue;
        }
        // Chunks are in the order of the file.
        if let Ok(place) = chunks.binary_search_by_key(&entry.offset, |chunk| chunk.at) {
            let cube = entry.key.bounds(info);
            chunks[place].ground = Some([[cube.min.x, cube.min.y], [cube.max.x, cube.max.y]]);
        }
    }
}

/// The points of some chunks, one after the other.
pub(super) struct ChunkReader {
    decompressor: LayeredPointRecordDecompressor<'static, GuardedFile>,
    items: Vec<LazItem>,
    /// What is still to be read, the next last.
    chunks: Vec<Chunk>,
    /// Points of the present chunk that are not read yet.
    left: u64,
}

impl ChunkReader {
    /// The points `range` of the file at `path`, whose points are the `chunks`.
    ///
    /// # Errors
    ///
    /// What is wrong with the file.
    pub(super) fn open(
        path: &Path,
        items: Vec<LazItem>,
        chunks: &[Chunk],
        range: &Range<u64>,
    ) -> Result<Self, String> {
        let file = File::open(path).and_then(GuardedFile::new);
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
        };
        let mut raw = Vec::new();
        reader.fill(range.start - before, &mut raw)?;
        Ok(reader)
    }

    /// Replaces `raw` by the next records: `wanted` of them, or fewer at the end.
    ///
    /// # Errors
    ///
    /// Why they cannot be decoded.
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
                None => return Err("the decoder gave up".to_owned()),
            }
            self.left -= now;
            read += now;
        }
        Ok(read)
    }

    fn enter(&mut self, chunk: &Chunk) -> Result<(), String> {
        let sought = self.decompressor.get_mut().seek(SeekFrom::Start(chunk.at));
        sought.map_err(|e| e.to_string())?;
        self.decompressor.reset();
        let fields = self.decompressor.set_fields_from(&self.items);
        fields.map_err(|e| e.to_string())?;
        self.left = chunk.points;
        Ok(())
    }
}
