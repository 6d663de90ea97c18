//! COPC: a LAZ file as an octree, written within bounded memory.
//!
//! Records are given in any order and sorted by position. Points are elected for each level
//! ([`NestedSets`]). Then the plane is taken in columns of nodes, in an order that leaves one
//! ancestor of every level behind before it enters the next: nodes below the columns are
//! complete with their column, and of the few above only those over the present column are open.
//!
//! (COPC 1.0: a LAZ file of chunks of any length, a node each; a record of 160 bytes
//! after the header; a table of nodes at the end.)

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufWriter, Seek, Write},
    path::{Path, PathBuf},
};

use super::{
    cloud::{CloudHeader, Workspace},
    cloud_levels::CloudLevels,
    columns::ColumnPlan,
    copc_nodes::{NodeRecords, NodeWriter},
    las_header::{PointEncoding, las_header},
    leveled_records::LeveledRecords,
    nested_sets::NestedSets,
    octree::Octree,
    part_file::PartFile,
    point_order::PointOrder,
    sink::SinkMonitor,
    store::{RecordSorter, SortedRecords, StoreError},
    writer::{CloudBody, CloudWriter, Completion},
};
use crate::{
    geometry::Rect,
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
        seen: Option<&Rect>,
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
        let (bounds, scale) = (sorted.bounds(), header.quantization.scale);
        let octree = Octree::around(&bounds, workspace.spacing / scale);
        let sets = NestedSets::elect(&*sorted, octree.radii(), 0, &workspace);
        let sets = sets.map_err(|e| wrong(&e))?;
        let order = PointOrder::default();
        let levels = sets
            .figures(&workspace)
            .and_then(|figures| CloudLevels::new(order, &sets, figures, scale, seen))
            .map_err(|e| wrong(&e))?;
        let written = write_octree(
            &*sorted, &sets, &octree, &header, &workspace, file, progress,
        );
        let (mut file, hierarchy_offset) = written.map_err(|e| wrong(&e))?;
        file.flush().map_err(|e| wrong(&e))?;
        let bounds = header_bounds(&header.quantization, &[bounds.min, bounds.max], points);
        sets.remove();
        sorted.remove();
        let amendments = vec![
            (BOUNDS_START, bounds),
            (EXTENDED_START, extended_counts(hierarchy_offset, points)),
        ];
        Ok(Completion::File(amendments, Some(levels)))
    }
}

/// Writes all points of `sorted` as an octree to `file`, behind its header and records.
/// `progress` gets the numbers of points that are written. Returns the file, and the offset
/// of the hierarchy in it.
fn write_octree<W: Write + Seek + Send>(
    sorted: &dyn SortedRecords,
    levels: &NestedSets<'_>,
    octree: &Octree,
    header: &CloudHeader,
    workspace: &Workspace,
    file: W,
    progress: &dyn Fn(u64),
) -> Result<(W, u64), StoreError> {
    let record = &header.record;
    let record_length = record.record_length();
    let most = workspace.sort_bytes / (2 * record_length + SORTING_BYTES_PER_POINT);
    let ColumnPlan { level, columns } = ColumnPlan::new(octree, sorted, most as u64);
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
        let rect = octree.rect_of_column(column, level);
        let ordered = LeveledRecords::read(sorted, levels, &rect, record_length)?;
        let complete = distribute(octree, &ordered, &mut open);
        drop(ordered);
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
    Ok(nodes.finish(octree, &header.quantization)?)
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
fn distribute(octree: &Octree, records: &LeveledRecords, open: &mut OpenNodes) -> NodeRecords {
    let mut complete = BTreeMap::new();
    for (point, level, record) in records.iter() {
        let nodes = match open.levels.get_mut(usize::from(level)) {
            Some(open) => open,
            None => &mut complete,
        };
        let node = octree.node(point, level.into());
        nodes.entry(node).or_default().extend(record);
    }
    complete
}
