//! The octree of a COPC file, written within bounded memory.
//!
//! Records come in any order and are spilled by place. Then the ground is taken in
//! columns, each of which holds all points of every voxel in it ([`Octree`]), in an
//! order that leaves one ancestor of every level behind before it enters the next: nodes
//! below the columns are complete with their column, and of the few above only those
//! over the present column are open.
//!
//! (COPC 1.0: a LAZ file of chunks of any length, a node each; a record of 160 bytes
//! after the header; a table of nodes at the end.)

use std::{
    collections::{BTreeMap, BTreeSet},
    io::{self, Cursor, Seek, SeekFrom, Write},
};

use ::las::Vlr;
use laz::{
    LasZipCompressor, LazVlr, LazVlrBuilder,
    laszip::{ChunkTable, ChunkTableEntry},
};
use rayon::prelude::*;

use super::{
    RecordFormat, RecordView,
    octree::{NodeKey, Octree},
};
use crate::{
    geometry::{Quantization, Rect, Stored},
    tile::{Spill, TileError},
};

/// Length of the record that describes the octree, and of its header.
pub(super) const INFO_BYTES: usize = 160;
const VLR_HEADER: u64 = 54;
/// Where the octree's record stands: behind the header of LAS 1.4.
const INFO_AT: u64 = 375 + VLR_HEADER;
/// A node in the table of nodes.
const ENTRY_BYTES: usize = 32;
/// Voxels along the edge of a node are two to the power of this, or more if columns
/// would not fit into memory otherwise.
const VOXEL_BITS: std::ops::RangeInclusive<u32> = 7..=9;
/// Bytes that a point takes, beside its record twice, while its column is sorted.
const PER_POINT: usize = 64;

/// The variable length records that a COPC file begins with.
pub(super) fn first_records(point_format: u8, extra_length: u16) -> laz::Result<[Vlr; 2]> {
    let mut compression = Vec::new();
    laszip(point_format, extra_length)?.write_to(&mut compression)?;
    Ok([
        Vlr {
            user_id: "copc".to_owned(),
            record_id: 1,
            description: "COPC info VLR".to_owned(),
            data: vec![0; INFO_BYTES],
        },
        Vlr {
            user_id: LazVlr::USER_ID.to_owned(),
            record_id: LazVlr::RECORD_ID,
            description: LazVlr::DESCRIPTION.to_owned(),
            data: compression,
        },
    ])
}

fn laszip(point_format: u8, extra_length: u16) -> laz::Result<LazVlr> {
    let builder = LazVlrBuilder::default().with_point_format(point_format, extra_length)?;
    Ok(builder.with_variable_chunk_size().build())
}

/// Why an octree cannot be written.
#[derive(Debug, thiserror::Error)]
pub(super) enum CopcError {
    /// Its file cannot.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Its points cannot be read back.
    #[error(transparent)]
    Spill(#[from] TileError),
}

/// A file whose nodes are being written.
struct Nodes<W> {
    file: W,
    /// Where the table of chunks is said to be; the chunks follow.
    start: u64,
    /// Where the next chunk goes.
    at: u64,
    /// Points in the nodes so far.
    points: u64,
    compression: LazVlr,
    record_length: usize,
    entries: BTreeMap<NodeKey, Entry>,
    chunks: ChunkTable,
    /// Least and greatest GPS time.
    times: [f64; 2],
}

#[derive(Clone, Copy)]
struct Entry {
    offset: u64,
    bytes: i32,
    points: i32,
}

/// Writes the points of `spill` as an octree to `file`, which holds a header and records
/// that begin with those of [`first_records`], and is at the place where points begin.
/// `progress` hears of points that are sorted. Returns the file, and where in it the
/// table of nodes begins, an extended record.
pub(super) fn write_octree<W: Write + Seek + Send>(
    spill: &Spill,
    quantization: &Quantization,
    spacing: i64,
    record: &RecordFormat,
    sort_bytes: usize,
    file: W,
    progress: &dyn Fn(u64),
) -> Result<(W, u64), CopcError> {
    let most = (sort_bytes / (2 * spill.record_length() + PER_POINT)) as u64;
    let (octree, level, columns) = columns(spill, spacing, most);
    // A record is no longer than its format can say.
    let compression = laszip(record.point_format, record.extra_length() as u16);
    let compression = compression.map_err(io::Error::other)?;
    let mut nodes = Nodes::new(file, compression, spill.record_length())?;
    // The nodes above the columns, as far as they are known.
    let mut open: Vec<BTreeMap<NodeKey, Vec<u8>>> = vec![BTreeMap::new(); level as usize];
    let mut before: Option<[u32; 2]> = None;
    let mut told = 0;
    for column in columns {
        if let Some(before) = before {
            for (above, open) in (0..).zip(&mut open) {
                let ancestor = |column: [u32; 2]| column.map(|c| c >> (level - above));
                if ancestor(before) != ancestor(column) {
                    nodes.add(std::mem::take(open))?;
                }
            }
        }
        before = Some(column);
        let ground = octree.ground(column, level);
        let mut complete = BTreeMap::<NodeKey, Vec<u8>>::new();
        let records = gathered(spill, &ground)?;
        let length = spill.record_length();
        let sorted = by_voxel(&octree, &records, length);
        let points: Vec<(u64, Stored)> = sorted.iter().map(|&(key, p, _)| (key, p)).collect();
        for (&(key, _, number), chosen) in sorted.iter().zip(octree.levels(&points)) {
            let node = octree.node(key, chosen.into());
            let nodes = match open.get_mut(usize::from(chosen)) {
                Some(open) => open,
                None => &mut complete,
            };
            let record = &records[number as usize * length..][..length];
            nodes.entry(node).or_default().extend(record);
        }
        drop((records, sorted, points));
        nodes.add(complete)?;
        progress(nodes.points - told);
        told = nodes.points;
    }
    for open in open {
        nodes.add(open)?;
    }
    progress(nodes.points - told);
    if nodes.points != spill.points() {
        let (taken, points) = (nodes.points, spill.points());
        let lost = format!("{taken} of {points} points have a node; please report this");
        return Err(io::Error::other(lost).into());
    }
    let table_at = nodes.finish(&octree, quantization)?;
    Ok((nodes.file, table_at))
}

/// An octree for the points of `spill`, and the columns of one of its levels, of at most
/// `most` points each if that can be, in the order in which they are to be taken.
fn columns(spill: &Spill, spacing: i64, most: u64) -> (Octree, u32, Vec<[u32; 2]>) {
    let grid = spill.grid();
    let candidates = VOXEL_BITS.flat_map(|bits| {
        let octree = Octree::around(&spill.bounds(), spacing, bits);
        (0..=octree.deepest_column()).map(move |level| (octree, level))
    });
    let mut last = None;
    for (octree, level) in candidates {
        let mut counts = BTreeMap::<[u32; 2], u64>::new();
        for (square, points) in spill.squares() {
            let Rect { min, max } = grid.rect_of_square(square);
            let [west, south] = octree.column_of(min[0], min[1], level);
            let [east, north] = octree.column_of(max[0] - 1, max[1] - 1, level);
            for x in west..=east {
                for y in south..=north {
                    *counts.entry([x, y]).or_default() += points;
                }
            }
        }
        let fits = counts.values().all(|&points| points <= most);
        let occupied: BTreeSet<[u32; 2]> = counts.into_keys().collect();
        last = Some((octree, level, occupied));
        if fits {
            break;
        }
    }
    let (octree, level, occupied) = last.unwrap_or_else(|| {
        let octree = Octree::around(&spill.bounds(), spacing, *VOXEL_BITS.start());
        (octree, 0, BTreeSet::from([[0, 0]]))
    });
    let mut columns: Vec<[u32; 2]> = occupied.into_iter().collect();
    columns.sort_by(|a, b| in_depth(*a, *b));
    (octree, level, columns)
}

/// The order in which a square is gone through quarter by quarter: decided by the axis
/// in which the places differ at the highest bit.
fn in_depth(a: [u32; 2], b: [u32; 2]) -> std::cmp::Ordering {
    let [x, y] = [a[0] ^ b[0], a[1] ^ b[1]];
    // Whether the highest bit of `x` is below that of `y`.
    let y_decides = x < y && x < (x ^ y);
    match y_decides {
        true => a[1].cmp(&b[1]),
        false => a[0].cmp(&b[0]),
    }
}

/// The points of `records` with their voxel and their number, sorted by voxel, and those
/// of one place in an order that is theirs alone.
fn by_voxel(octree: &Octree, records: &[u8], length: usize) -> Vec<(u64, Stored, u32)> {
    // So many points of one column as numbers have bits are in no memory.
    let count = (records.len() / length) as u32;
    let mut sorted: Vec<(u64, Stored, u32)> = records
        .par_chunks_exact(length)
        .zip(0..count)
        .map(|(record, number)| {
            let point = Stored::of_record(record);
            (octree.voxel_key(point), point, number)
        })
        .collect();
    let record = |number: u32| &records[number as usize * length..][..length];
    sorted.par_sort_unstable_by(|a, b| {
        (a.0, a.1)
            .cmp(&(b.0, b.1))
            .then_with(|| record(a.2).cmp(record(b.2)))
    });
    sorted
}

fn gathered(spill: &Spill, ground: &Rect) -> Result<Vec<u8>, TileError> {
    let mut records = Vec::new();
    spill.gather_each(
        ground,
        |found: &mut Vec<u8>, record| found.extend(record),
        |found| records.extend(found),
    )?;
    Ok(records)
}

impl<W: Write + Seek + Send> Nodes<W> {
    fn new(mut file: W, compression: LazVlr, record_length: usize) -> io::Result<Self> {
        // The place of the table of chunks, to be known at the end.
        let start = file.stream_position()?;
        file.write_all(&[0; ChunkTable::OFFSET_SIZE])?;
        Ok(Self {
            file,
            start,
            points: 0,
            at: start + ChunkTable::OFFSET_SIZE as u64,
            compression,
            record_length,
            entries: BTreeMap::new(),
            chunks: ChunkTable::default(),
            times: [f64::INFINITY, f64::NEG_INFINITY],
        })
    }

    /// Adds `nodes`, each with all of its records.
    fn add(&mut self, nodes: BTreeMap<NodeKey, Vec<u8>>) -> io::Result<()> {
        let (length, compression) = (self.record_length, &self.compression);
        let nodes: Vec<(NodeKey, Vec<u8>)> = nodes.into_iter().collect();
        let compressed: Vec<_> = nodes
            .into_par_iter()
            .map(|(key, records)| {
                let sorted = by_time(&records, length);
                let times = [sorted.first(), sorted.last()].map(|r| r.map_or(0.0, |r| time(r)));
                let chunk = compress(&sorted, compression)?;
                Ok((key, sorted.len(), times, chunk))
            })
            .collect::<io::Result<_>>()?;
        for (key, points, times, chunk) in compressed {
            self.file.write_all(&chunk)?;
            let too_large = |_| io::Error::other("a node is larger than COPC allows");
            let entry = Entry {
                offset: self.at,
                bytes: chunk.len().try_into().map_err(too_large)?,
                points: points.try_into().map_err(too_large)?,
            };
            self.entries.insert(key, entry);
            self.chunks.push(ChunkTableEntry {
                point_count: points as u64,
                byte_count: chunk.len() as u64,
            });
            self.at += chunk.len() as u64;
            self.points += points as u64;
            self.times[0] = self.times[0].min(times[0]);
            self.times[1] = self.times[1].max(times[1]);
        }
        Ok(())
    }

    /// Writes the table of chunks, the table of nodes, and what the file says of them.
    fn finish(&mut self, octree: &Octree, quantization: &Quantization) -> io::Result<u64> {
        self.chunks.write_to(&mut self.file, &self.compression)?;
        let table_at = self.file.stream_position()?;
        self.file.seek(SeekFrom::Start(self.start))?;
        self.file.write_all(&self.at.to_le_bytes())?;

        let mut table = Vec::new();
        for (key, entry) in &self.entries {
            table.extend((key.level as i32).to_le_bytes());
            for c in key.place {
                table.extend((c as i32).to_le_bytes());
            }
            table.extend(entry.offset.to_le_bytes());
            table.extend(entry.bytes.to_le_bytes());
            table.extend(entry.points.to_le_bytes());
        }
        debug_assert_eq!(table.len(), ENTRY_BYTES * self.entries.len());
        let mut head = [0; 60];
        head[2..6].copy_from_slice(b"copc");
        head[18..20].copy_from_slice(&1000_u16.to_le_bytes());
        head[20..28].copy_from_slice(&(table.len() as u64).to_le_bytes());
        head[28..42].copy_from_slice(b"EPT Hierarchy\0");
        self.file.seek(SeekFrom::Start(table_at))?;
        self.file.write_all(&head)?;
        self.file.write_all(&table)?;

        let half = 0.5 * octree.edge() as f64 * quantization.scale;
        let corner = octree.corner();
        let mut info = Vec::new();
        for axis in 0..3 {
            let center =
                quantization.offset[axis] + corner[axis] as f64 * quantization.scale + half;
            info.extend(center.to_le_bytes());
        }
        info.extend(half.to_le_bytes());
        info.extend((octree.root_spacing() * quantization.scale).to_le_bytes());
        info.extend((table_at + head.len() as u64).to_le_bytes());
        info.extend((table.len() as u64).to_le_bytes());
        for time in self.times {
            info.extend(if time.is_finite() { time } else { 0.0 }.to_le_bytes());
        }
        info.resize(INFO_BYTES, 0);
        self.file.seek(SeekFrom::Start(INFO_AT))?;
        self.file.write_all(&info)?;
        Ok(table_at)
    }
}

/// The GPS time of a record.
fn time(record: &[u8]) -> f64 {
    RecordView::new(record).gps_time()
}

/// Records by their time, and of one time by all that they are.
fn by_time(records: &[u8], length: usize) -> Vec<&[u8]> {
    let mut sorted: Vec<&[u8]> = records.chunks_exact(length).collect();
    sorted.sort_unstable_by(|a, b| time(a).total_cmp(&time(b)).then_with(|| a.cmp(b)));
    sorted
}

/// A chunk of `records`.
fn compress(records: &[&[u8]], compression: &LazVlr) -> io::Result<Vec<u8>> {
    let sink = Cursor::new(Vec::new());
    let mut compressor =
        LasZipCompressor::new(sink, compression.clone()).map_err(io::Error::other)?;
    for record in records {
        compressor.compress_one(record)?;
    }
    compressor.finish_current_chunk()?;
    let mut bytes = compressor.into_inner().into_inner();
    // The compressor begins with the place of a table.
    Ok(bytes.split_off(ChunkTable::OFFSET_SIZE))
}
