//! The nodes of a COPC file: chunks of compressed points, and the tables of them.

use std::{
    collections::BTreeMap,
    io::{self, Cursor, Seek, SeekFrom, Write},
};

use laz::{
    LasZipCompressor, LazVlr,
    laszip::{ChunkTable, ChunkTableEntry},
};
use rayon::prelude::*;

use super::{
    node_bytes::{CompressedNode, NodeRecords},
    octree::{NodeKey, Octree},
};
use crate::{
    geometry::Quantization,
    las::format::{
        copc::{INFO_OFFSET, NodeEntry, OctreeInfo, hierarchy, hierarchy_head},
        record::RecordView,
    },
};

/// A file whose nodes are being written.
pub(super) struct NodeWriter<W> {
    file: W,
    /// The offset of the points: there the file says where the table of chunks is.
    start: u64,
    /// The offset of the next chunk.
    next: u64,
    /// The number of points in the nodes so far.
    points: u64,
    compression: LazVlr,
    /// The position of each node's chunk in the file.
    entries: BTreeMap<NodeKey, ChunkEntry>,
    chunks: ChunkTable,
    /// The least and the greatest GPS time, in seconds.
    times: [f64; 2],
}

#[derive(Clone, Copy)]
struct ChunkEntry {
    offset: u64,
    bytes: i32,
    points: i32,
}

impl<W: Write + Seek + Send> NodeWriter<W> {
    /// Begins the points of `file`.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub(super) fn new(mut file: W, compression: LazVlr) -> io::Result<Self> {
        // The offset of the table of chunks, to be known at the end.
        let start = file.stream_position()?;
        file.write_all(&[0; ChunkTable::OFFSET_SIZE])?;
        Ok(Self {
            file,
            start,
            points: 0,
            next: start + ChunkTable::OFFSET_SIZE as u64,
            compression,
            entries: BTreeMap::new(),
            chunks: ChunkTable::default(),
            times: [f64::INFINITY, f64::NEG_INFINITY],
        })
    }

    /// The number of points in the nodes so far.
    pub(super) fn points(&self) -> u64 {
        self.points
    }

    /// Adds `nodes`.
    ///
    /// # Errors
    ///
    /// If the file cannot be written, or a chunk is longer than COPC can say.
    pub(super) fn add(&mut self, nodes: Vec<CompressedNode>) -> io::Result<()> {
        nodes.iter().try_for_each(|node| self.write_chunk(node))
    }

    fn write_chunk(&mut self, node: &CompressedNode) -> io::Result<()> {
        self.file.write_all(&node.chunk)?;
        let bytes = node.chunk.len();
        let too_large = |_| {
            let problem = format!(
                "a node of the octree has {} points in {bytes} bytes; COPC allows 2147483647 of \
                 each: write .laz instead",
                node.points
            );
            io::Error::other(problem)
        };
        let entry = ChunkEntry {
            offset: self.next,
            bytes: bytes.try_into().map_err(too_large)?,
            points: node.points.try_into().map_err(too_large)?,
        };
        self.entries.insert(node.key, entry);
        self.chunks.push(ChunkTableEntry {
            point_count: node.points,
            byte_count: bytes as u64,
        });
        self.next += bytes as u64;
        self.points += node.points;
        self.times[0] = self.times[0].min(node.times[0]);
        self.times[1] = self.times[1].max(node.times[1]);
        Ok(())
    }

    /// Adds the nodes without points that have points below them: readers descend from node to node.
    fn add_empty_ancestors(&mut self) {
        let with_points: Vec<NodeKey> = self.entries.keys().copied().collect();
        for mut key in with_points {
            while let Some(parent) = key.parent() {
                if self.entries.contains_key(&parent) {
                    break;
                }
                let empty = ChunkEntry {
                    offset: 0,
                    bytes: 0,
                    points: 0,
                };
                self.entries.insert(parent, empty);
                key = parent;
            }
        }
    }

    /// Writes the table of chunks, the hierarchy, and the record that says where they are.
    /// Returns the file, and the offset of the hierarchy, an extended record.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub(super) fn finish(
        mut self,
        octree: &Octree,
        quantization: &Quantization,
    ) -> io::Result<(W, u64)> {
        self.chunks.write_to(&mut self.file, &self.compression)?;
        self.add_empty_ancestors();
        let hierarchy_offset = self.file.stream_position()?;
        self.file.seek(SeekFrom::Start(self.start))?;
        self.file.write_all(&self.next.to_le_bytes())?;

        let nodes = self.entries.iter().map(|(key, entry)| NodeEntry {
            level: key.level,
            position: key.position,
            offset: entry.offset,
            bytes: entry.bytes,
            points: entry.points,
        });
        let hierarchy = hierarchy(nodes);
        let hierarchy_bytes = hierarchy.len() as u64;
        self.file.seek(SeekFrom::Start(hierarchy_offset))?;
        self.file.write_all(&hierarchy_head(hierarchy_bytes))?;
        self.file.write_all(&hierarchy)?;

        let half_edge = 0.5 * octree.edge() as f64 * quantization.scale;
        let corner = octree.corner();
        let info = OctreeInfo {
            center: [0, 1, 2].map(|axis| {
                quantization.offset[axis] + corner[axis] as f64 * quantization.scale + half_edge
            }),
            half_edge,
            root_spacing: octree.root_spacing() * quantization.scale,
            hierarchy_offset,
            hierarchy_bytes,
            times: self.times,
        };
        self.file.seek(SeekFrom::Start(INFO_OFFSET))?;
        self.file.write_all(&info.to_bytes())?;
        Ok((self.file, hierarchy_offset))
    }
}

/// Compresses `nodes`, each with all of its records of `record_length` bytes, in the order of their keys.
///
/// # Errors
///
/// If records cannot be compressed.
pub(super) fn compress_nodes(
    nodes: NodeRecords,
    record_length: usize,
    compression: &LazVlr,
) -> io::Result<Vec<CompressedNode>> {
    let nodes: Vec<(NodeKey, Vec<u8>)> = nodes.into_iter().collect();
    let compressed = nodes.into_par_iter().map(|(key, records)| {
        let sorted = by_time(&records, record_length);
        let times = [sorted.first(), sorted.last()].map(|r| r.map_or(0.0, |r| gps_time(r)));
        Ok(CompressedNode {
            key,
            points: sorted.len() as u64,
            times,
            chunk: compress(&sorted, compression)?,
        })
    });
    compressed.collect()
}

fn gps_time(record: &[u8]) -> f64 {
    RecordView::new(record).gps_time()
}

/// The records by their GPS time; of one time, by all of their bytes.
fn by_time(records: &[u8], record_length: usize) -> Vec<&[u8]> {
    let mut sorted: Vec<&[u8]> = records.chunks_exact(record_length).collect();
    sorted.sort_unstable_by(|a, b| gps_time(a).total_cmp(&gps_time(b)).then_with(|| a.cmp(b)));
    sorted
}

/// Compresses `records` into one chunk.
fn compress(records: &[&[u8]], compression: &LazVlr) -> io::Result<Vec<u8>> {
    let buffer = Cursor::new(Vec::new());
    let mut compressor =
        LasZipCompressor::new(buffer, compression.clone()).map_err(io::Error::other)?;
    for record in records {
        compressor.compress_one(record)?;
    }
    compressor.finish_current_chunk()?;
    let mut bytes = compressor.into_inner().into_inner();
    // The compressor begins with the offset of a table.
    Ok(bytes.split_off(ChunkTable::OFFSET_SIZE))
}
