//! What COPC adds to LAZ: two records at the beginning, and a hierarchy at the end.
//!
//! ```text
//!   header (375) │ info record (54 + 160) │ compression │ … │ chunks │ hierarchy (60 + 32 n)
//!
//!   info       center x y z, half edge, spacing of the root, offset and length of the
//!              hierarchy, least and greatest GPS time                        (all 8 bytes)
//!   node       level, x, y, z (4 bytes each), offset of its chunk (8), length (4), points (4)
//! ```
//!
//! (COPC 1.0.)

use ::las::Vlr;
use laz::{LazVlr, LazVlrBuilder};

use super::{
    header::HEADER_BYTES_1_4,
    vlr::{EVLR_HEAD_BYTES, VLR_HEAD_BYTES, extended_head},
};

/// The length of the data of the info record, in bytes.
const INFO_BYTES: usize = 160;
/// The offset of the data of the info record, in bytes: it is the first record.
pub(in crate::las) const INFO_OFFSET: u64 = HEADER_BYTES_1_4 + VLR_HEAD_BYTES;
/// The length of a node in the hierarchy, in bytes.
const NODE_BYTES: usize = 32;
/// The user of the records that COPC defines, and the number of the hierarchy.
const COPC_USER: &str = "copc";
const HIERARCHY_RECORD: u16 = 1000;

/// The variable length records that a COPC file begins with; the first one is filled by
/// [`OctreeInfo`] in the end.
///
/// # Errors
///
/// If points of this format cannot be compressed.
pub(in crate::las) fn first_records(point_format: u8, extra_length: u16) -> laz::Result<[Vlr; 2]> {
    let mut compression = Vec::new();
    compression_of(point_format, extra_length)?.write_to(&mut compression)?;
    Ok([
        Vlr {
            user_id: COPC_USER.to_owned(),
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

/// The compression of points in chunks of different lengths.
///
/// # Errors
///
/// If points of this format cannot be compressed.
pub(in crate::las) fn compression_of(point_format: u8, extra_length: u16) -> laz::Result<LazVlr> {
    let builder = LazVlrBuilder::default().with_point_format(point_format, extra_length)?;
    Ok(builder.with_variable_chunk_size().build())
}

/// What the info record says of the octree.
pub(in crate::las) struct OctreeInfo {
    /// The center of the octree's cube, in world coordinates.
    pub(in crate::las) center: [f64; 3],
    /// Half of the edge of the cube, in CRS units.
    pub(in crate::las) half_edge: f64,
    /// The distance of points in the root node, in CRS units.
    pub(in crate::las) root_spacing: f64,
    /// The offset of the record of the hierarchy, and the length of its nodes, in bytes.
    pub(in crate::las) hierarchy_offset: u64,
    pub(in crate::las) hierarchy_bytes: u64,
    /// The least and the greatest GPS time, in seconds; not finite if there is no point.
    pub(in crate::las) times: [f64; 2],
}

impl OctreeInfo {
    /// The data of the info record.
    pub(in crate::las) fn to_bytes(&self) -> Vec<u8> {
        let mut info = Vec::with_capacity(INFO_BYTES);
        for center in self.center {
            info.extend(center.to_le_bytes());
        }
        info.extend(self.half_edge.to_le_bytes());
        info.extend(self.root_spacing.to_le_bytes());
        info.extend((self.hierarchy_offset + EVLR_HEAD_BYTES).to_le_bytes());
        info.extend(self.hierarchy_bytes.to_le_bytes());
        for time in self.times {
            info.extend(if time.is_finite() { time } else { 0.0 }.to_le_bytes());
        }
        info.resize(INFO_BYTES, 0);
        info
    }
}

/// A node as the hierarchy has it.
pub(in crate::las) struct NodeEntry {
    /// The level of the node, the root's being 0.
    pub(in crate::las) level: u32,
    /// The position of the node among the cubes of its level.
    pub(in crate::las) position: [u32; 3],
    /// The offset and the length of the node's chunk in the file, in bytes.
    pub(in crate::las) offset: u64,
    pub(in crate::las) bytes: i32,
    /// The number of points of the node.
    pub(in crate::las) points: i32,
}

/// The data of the hierarchy's record: its nodes.
pub(in crate::las) fn hierarchy(nodes: impl ExactSizeIterator<Item = NodeEntry>) -> Vec<u8> {
    let mut hierarchy = Vec::with_capacity(NODE_BYTES * nodes.len());
    for node in nodes {
        hierarchy.extend((node.level as i32).to_le_bytes());
        for c in node.position {
            hierarchy.extend((c as i32).to_le_bytes());
        }
        hierarchy.extend(node.offset.to_le_bytes());
        hierarchy.extend(node.bytes.to_le_bytes());
        hierarchy.extend(node.points.to_le_bytes());
    }
    hierarchy
}

/// The head of the hierarchy's record, whose data are `length` bytes long.
pub(in crate::las) fn hierarchy_head(length: u64) -> [u8; EVLR_HEAD_BYTES as usize] {
    extended_head(COPC_USER, HIERARCHY_RECORD, "EPT Hierarchy", length)
}
