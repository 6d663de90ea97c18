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
    io::{self, BufWriter, Seek, Write},
    path::Path,
};

use laz::LazVlr;

use super::{
    cloud::{CloudHeader, Workspace},
    cloud_levels::CloudLevels,
    columns::ColumnPlan,
    copc_nodes::{NodeWriter, compress_nodes},
    las_header::{PointEncoding, las_header},
    leveled_records::LeveledRecords,
    nested_sets::NestedSets,
    node_bytes::{NodeRecords, compressed_bytes, compressed_nodes, record_bytes, records_of_nodes},
    octree::Octree,
    part_file::PartFile,
    pieces::Piece,
    point_order::PointOrder,
    store::{SortedRecords, StoreError},
    writer::CompleteCloud,
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
/// The most points of a column, however large the memory: processes share columns, and threads share the nodes of one.
const MOST_POINTS_OF_COLUMN: usize = 1 << 19;

/// Writes the points of `sorted` as a COPC file that is to become `path`. `progress` gets the numbers of points that are
/// written. The levels of the points in `seen` are returned with the cloud.
///
/// # Errors
///
/// If the file cannot be written, or temporary files cannot be read or written.
pub(super) fn write_copc(
    path: &Path,
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
    seen: Option<&Rect>,
    progress: &dyn Fn(u64),
) -> Result<CompleteCloud, LasError> {
    let (part, file) = PartFile::create_file(path)?;
    let wrong = |e: &dyn std::fmt::Display| LasError::unwritable(path, e);
    let las = las_header(header, PointEncoding::Copc).map_err(|e| wrong(&e))?;
    let mut file = BufWriter::with_capacity(1 << 20, file);
    las.write_to(&mut file).map_err(|e| wrong(&e))?;
    let octree = OctreeCloud::elect(header, workspace, sorted).map_err(|e| wrong(&e))?;
    let (order, scale) = (PointOrder::default(), header.quantization.scale);
    let levels = (octree.sets.figures(workspace))
        .and_then(|figures| CloudLevels::new(order, &octree.sets, figures, scale, seen))
        .map_err(|e| wrong(&e))?;
    let written = octree.write(file, progress);
    let (mut file, hierarchy_offset) = written.map_err(|e| wrong(&e))?;
    file.flush().map_err(|e| wrong(&e))?;
    drop(file);
    octree.sets.remove();
    let (bounds, points) = (sorted.bounds(), sorted.points());
    let bounds = header_bounds(&header.quantization, &[bounds.min, bounds.max], points);
    let amendments = vec![
        (BOUNDS_START, bounds),
        (EXTENDED_START, extended_counts(hierarchy_offset, points)),
    ];
    Ok(CompleteCloud::of_file(part, points, amendments)?.with_levels(levels))
}

/// Does a part of the work of [`write_copc`], whose cloud another process writes.
///
/// # Errors
///
/// If temporary files cannot be read or written.
pub(super) fn help_write_copc(
    header: &CloudHeader,
    workspace: &Workspace<'_>,
    sorted: &dyn SortedRecords,
) -> Result<(), StoreError> {
    let octree = OctreeCloud::elect(header, workspace, sorted)?;
    octree.sets.figures(workspace)?;
    octree.columns(&mut |_, _| Ok(()))
}

/// A cloud whose points have their levels.
struct OctreeCloud<'a> {
    header: &'a CloudHeader,
    workspace: &'a Workspace<'a>,
    sorted: &'a dyn SortedRecords,
    octree: Octree,
    sets: NestedSets<'a>,
    plan: ColumnPlan,
    compression: LazVlr,
}

impl<'a> OctreeCloud<'a> {
    /// Elects the levels of the points of `sorted`.
    fn elect(
        header: &'a CloudHeader,
        workspace: &'a Workspace<'a>,
        sorted: &'a dyn SortedRecords,
    ) -> Result<Self, StoreError> {
        let record = &header.record;
        let spacing = workspace.spacing / header.quantization.scale;
        let octree = Octree::around(&sorted.bounds(), spacing);
        let bytes_per_point = 2 * record.record_length() + SORTING_BYTES_PER_POINT;
        let most = (workspace.sort_bytes / bytes_per_point).min(MOST_POINTS_OF_COLUMN);
        // A record is no longer than its format can say.
        let compression = compression_of(record.point_format, record.extra_length() as u16);
        Ok(Self {
            header,
            workspace,
            sorted,
            sets: NestedSets::elect(sorted, octree.radii(), 0, workspace)?,
            plan: ColumnPlan::new(&octree, sorted, most as u64),
            octree,
            compression: compression.map_err(io::Error::other)?,
        })
    }

    /// Writes all points to `file`, behind its header and records. Returns the file, and the offset of the hierarchy in it.
    fn write<W: Write + Seek + Send>(
        &self,
        file: W,
        progress: &dyn Fn(u64),
    ) -> Result<(W, u64), StoreError> {
        let mut nodes = NodeWriter::new(file, self.compression.clone())?;
        let mut open = OpenNodes::above(self.plan.level);
        let compress = |nodes| compress_nodes(nodes, self.record_length(), &self.compression);
        let mut reported = 0;
        self.columns(&mut |column, piece| {
            for complete in open.leave_for(self.plan.columns[column]) {
                nodes.add(compress(complete)?)?;
            }
            let [complete, begun] = piece.try_into().map_err(|_| lost("a column"))?;
            nodes.add(compressed_nodes(&complete).ok_or_else(|| lost("a node"))?)?;
            open.add(records_of_nodes(&begun).ok_or_else(|| lost("a node"))?);
            progress(nodes.points() - reported);
            reported = nodes.points();
            Ok(())
        })?;
        for complete in open.levels {
            nodes.add(compress(complete)?)?;
        }
        progress(nodes.points() - reported);
        if nodes.points() != self.sorted.points() {
            let (written, points) = (nodes.points(), self.sorted.points());
            return Err(lost(&format!("the node of {written} of {points} points")));
        }
        Ok(nodes.finish(&self.octree, &self.header.quantization)?)
    }

    /// Passes the columns to `take`, each as the nodes that are complete with it, compressed, and the records of nodes above it.
    fn columns(
        &self,
        take: &mut dyn FnMut(usize, Piece) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let (workforce, columns) = (self.workspace.workforce, &self.plan.columns);
        let mut make = |column: usize| self.column(columns[column]);
        workforce.pass("columns", columns.len(), &mut make, take)
    }

    fn column(&self, column: [u32; 2]) -> Result<Piece, StoreError> {
        let (level, length) = (self.plan.level, self.record_length());
        let rect = self.octree.rect_of_column(column, level);
        let ordered = LeveledRecords::read(self.sorted, &self.sets, &rect, length)?;
        let (mut complete, mut begun) = (NodeRecords::new(), NodeRecords::new());
        for (point, of_point, record) in ordered.iter() {
            let nodes = match u32::from(of_point) < level {
                true => &mut begun,
                false => &mut complete,
            };
            let node = self.octree.node(point, of_point.into());
            nodes.entry(node).or_default().extend(record);
        }
        drop(ordered);
        let complete = compress_nodes(complete, length, &self.compression)?;
        Ok(vec![compressed_bytes(&complete), record_bytes(&begun)])
    }

    fn record_length(&self) -> usize {
        self.header.record.record_length()
    }
}

/// The error of a cloud that is not what was written.
fn lost(what: &str) -> StoreError {
    format!("{what} was lost; this is a defect of the program, please report it").into()
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

    /// Adds records of nodes above the present column.
    fn add(&mut self, records: NodeRecords) {
        for (node, more) in records {
            if let Some(nodes) = self.levels.get_mut(node.level as usize) {
                nodes.entry(node).or_default().extend(more);
            }
        }
    }
}
