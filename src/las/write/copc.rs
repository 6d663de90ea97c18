//! COPC: a LAZ file as an octree, written within bounded memory.
//!
//! Records are given in any order and sorted by position. Then the plane is taken in
//! columns, each of which contains all points of every voxel in it ([`Octree`]), in an
//! order that leaves one ancestor of every level behind before it enters the next: nodes
//! below the columns are complete with their column, and of the few above only those
//! over the present column are open.
//!
//! (COPC 1.0: a LAZ file of chunks of any length, a node each; a record of 160 bytes
//! after the header; a table of nodes at the end.)

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufWriter, Seek, Write},
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use super::{
    cloud::{CloudHeader, Workspace},
    columns::ColumnPlan,
    copc_nodes::{NodeRecords, NodeWriter},
    las_header::{PointEncoding, las_header},
    octree::Octree,
    part_file::PartFile,
    sink::SinkMonitor,
    store::{RecordSorter, SortedRecords, StoreError},
    writer::{CloudBody, CloudWriter, Completion},
};
use crate::{
    geometry::Stored,
    las::{
        error::LasError,
        format::{
            copc::compression_of,
            header::{BOUNDS_START, EXTENDED_START, extended_counts, header_bounds},
        },
    },
};

/// The memory that a point takes while its column is sorted, beside its record twice, in
/// bytes.
const SORTING_BYTES_PER_POINT: usize = 64;

/// The points of a COPC file.
struct CopcBody {
    /// The path of the output, for errors.
    path: PathBuf,
    file: File,
    header: CloudHeader,
    workspace: Workspace,
    sorter: Box<dyn RecordSorter>,
}

/// Begins a COPC file at `path`.
///
/// # Errors
///
/// If no file can be made there, or in the `workspace`.
pub(super) fn create_copc(
    path: &Path,
    header: &CloudHeader,
    workspace: &Workspace,
) -> Result<CloudWriter, LasError> {
    let (part, file) = PartFile::create_file(path)?;
    let body = CopcBody {
        path: path.to_owned(),
        file,
        header: header.clone(),
        workspace: workspace.clone(),
        sorter: workspace.begin_sorting(header, path)?,
    };
    let record_length = header.record.record_length();
    CloudWriter::new(part, SinkMonitor::default(), Box::new(body), record_length)
}

impl CloudBody for CopcBody {
    fn write(&mut self, records: &[u8]) -> Result<(), LasError> {
        self.sorter
            .push(records)
            .map_err(|e| LasError::unwritable(&self.path, e))
    }

    fn complete(
        self: Box<Self>,
        points: u64,
        progress: &dyn Fn(u64),
    ) -> Result<Completion, LasError> {
        let Self {
            path,
            file,
            header,
            workspace,
            sorter,
        } = *self;
        let wrong = |e: &dyn std::fmt::Display| LasError::unwritable(&path, e);
        let sorted = sorter.finish().map_err(|e| wrong(&e))?;
        let las = las_header(&header, PointEncoding::Copc).map_err(|e| wrong(&e))?;
        let mut file = BufWriter::with_capacity(1 << 20, file);
        las.write_to(&mut file).map_err(|e| wrong(&e))?;
        let (mut file, hierarchy_offset) =
            write_octree(&*sorted, &header, &workspace, file, progress).map_err(|e| wrong(&e))?;
        file.flush().map_err(|e| wrong(&e))?;
        let bounds = sorted.bounds();
        let bounds = header_bounds(&header.quantization, &[bounds.min, bounds.max], points);
        sorted.remove();
        Ok(Completion::File(vec![
            (BOUNDS_START, bounds),
            (EXTENDED_START, extended_counts(hierarchy_offset, points)),
        ]))
    }
}

/// Writes all points of `sorted` as an octree to `file`, behind its header and records.
/// `progress` gets the numbers of points that are written. Returns the file, and the offset
/// of the hierarchy in it.
fn write_octree<W: Write + Seek + Send>(
    sorted: &dyn SortedRecords,
    header: &CloudHeader,
    workspace: &Workspace,
    file: W,
    progress: &dyn Fn(u64),
) -> Result<(W, u64), StoreError> {
    let record = &header.record;
    let record_length = record.record_length();
    let most = workspace.sort_bytes / (2 * record_length + SORTING_BYTES_PER_POINT);
    let spacing = header.quantization.units(workspace.spacing);
    let ColumnPlan {
        octree,
        level,
        columns,
    } = ColumnPlan::new(sorted, spacing, most as u64);
    // A record is no longer than its format can say.
    let compression = compression_of(record.point_format, record.extra_length() as u16);
    let compression = compression.map_err(io::Error::other)?;
    let mut nodes = NodeWriter::new(file, compression, record_length)?;
    let mut open = OpenNodes::above(level);
    let mut reported = 0;
    for column in columns {
        for complete in open.leave_for(column) {
            nodes.add(complete)?;
        }
        let records = sorted.read(&octree.rect_of_column(column, level))?;
        let complete = distribute(&octree, &records, record_length, &mut open);
        drop(records);
        nodes.add(complete)?;
        progress(nodes.points() - reported);
        reported = nodes.points();
    }
    for complete in open.levels {
        nodes.add(complete)?;
    }
    progress(nodes.points() - reported);
    if nodes.points() != sorted.points() {
        let (written, points) = (nodes.points(), sorted.points());
        let lost = format!(
            "only {written} of {points} points have a node of the octree; this is a defect of \
             the program, please report it"
        );
        return Err(lost.into());
    }
    Ok(nodes.finish(&octree, &header.quantization)?)
}

/// The nodes above the columns, as far as they are known: of each level those over the
/// present column.
struct OpenNodes {
    levels: Vec<NodeRecords>,
    present: Option<[u32; 2]>,
}

impl OpenNodes {
    /// The nodes above columns at `level`.
    fn above(level: u32) -> Self {
        Self {
            levels: vec![NodeRecords::new(); level as usize],
            present: None,
        }
    }

    /// Moves on to `column`, and returns the nodes that are not above it: they are complete.
    fn leave_for(&mut self, column: [u32; 2]) -> Vec<NodeRecords> {
        let mut complete = Vec::new();
        if let Some(present) = self.present {
            let deepest = self.levels.len();
            for (level, nodes) in self.levels.iter_mut().enumerate() {
                let ancestor = |column: [u32; 2]| column.map(|c| c >> (deepest - level));
                if ancestor(present) != ancestor(column) {
                    complete.push(std::mem::take(nodes));
                }
            }
        }
        self.present = Some(column);
        complete
    }
}

/// Gives every record of a column to a node: to one of the `open` nodes above the column, or
/// to one of the nodes below, which are returned.
fn distribute(
    octree: &Octree,
    records: &[u8],
    record_length: usize,
    open: &mut OpenNodes,
) -> NodeRecords {
    let mut complete = BTreeMap::new();
    let sorted = by_voxel(octree, records, record_length);
    let points: Vec<(u64, Stored)> = sorted.iter().map(|&(key, p, _)| (key, p)).collect();
    for (&(key, _, number), level) in sorted.iter().zip(octree.levels(&points)) {
        let nodes = match open.levels.get_mut(usize::from(level)) {
            Some(open) => open,
            None => &mut complete,
        };
        let record = &records[number as usize * record_length..][..record_length];
        let node = octree.node(key, level.into());
        nodes.entry(node).or_default().extend(record);
    }
    complete
}

/// The points of `records` with the key of their voxel and their number, sorted by voxel, and
/// those of one position by all of their bytes.
fn by_voxel(octree: &Octree, records: &[u8], record_length: usize) -> Vec<(u64, Stored, u32)> {
    // The records of a column are in memory: their number fits into 32 bits.
    let count = (records.len() / record_length) as u32;
    let mut sorted: Vec<(u64, Stored, u32)> = records
        .par_chunks_exact(record_length)
        .zip(0..count)
        .map(|(record, number)| {
            let point = Stored::of_record(record);
            (octree.voxel_key(point), point, number)
        })
        .collect();
    let record = |number: u32| &records[number as usize * record_length..][..record_length];
    sorted.par_sort_unstable_by(|a, b| {
        (a.0, a.1)
            .cmp(&(b.0, b.1))
            .then_with(|| record(a.2).cmp(record(b.2)))
    });
    sorted
}
