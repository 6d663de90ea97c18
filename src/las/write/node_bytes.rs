//! Nodes of an octree on their way to the process that writes them.
//!
//! ```text
//!   key: level, x, y, z       4 × u32
//!   points                    u64
//!   first and last GPS time   2 × f64
//!   length                    u64
//!   a compressed chunk, or records (then times are 0)
//! ```

use std::collections::BTreeMap;

use super::octree::NodeKey;

const HEAD_BYTES: usize = 48;

/// The records of nodes.
pub(super) type NodeRecords = BTreeMap<NodeKey, Vec<u8>>;

/// A node that is compressed.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CompressedNode {
    pub(super) key: NodeKey,
    pub(super) points: u64,
    /// The GPS times of the first and of the last point, in seconds.
    pub(super) times: [f64; 2],
    pub(super) chunk: Vec<u8>,
}

/// The bytes of compressed nodes.
pub(super) fn compressed_bytes(nodes: &[CompressedNode]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for node in nodes {
        push(&mut bytes, node.key, node.points, node.times, &node.chunk);
    }
    bytes
}

/// The bytes of records by node.
pub(super) fn record_bytes(nodes: &NodeRecords) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (key, records) in nodes {
        push(&mut bytes, *key, 0, [0.0; 2], records);
    }
    bytes
}

/// Compressed nodes from their bytes; `None` if these are none.
pub(super) fn compressed_nodes(mut bytes: &[u8]) -> Option<Vec<CompressedNode>> {
    let mut nodes = Vec::new();
    while !bytes.is_empty() {
        nodes.push(pop(&mut bytes)?);
    }
    Some(nodes)
}

/// Records by node from their bytes; `None` if these are none.
pub(super) fn records_of_nodes(bytes: &[u8]) -> Option<NodeRecords> {
    let nodes = compressed_nodes(bytes)?.into_iter();
    Some(nodes.map(|node| (node.key, node.chunk)).collect())
}

fn push(bytes: &mut Vec<u8>, key: NodeKey, points: u64, times: [f64; 2], content: &[u8]) {
    let [x, y, z] = key.position;
    bytes.extend([key.level, x, y, z].map(u32::to_le_bytes).concat());
    let numbers = [points, times[0].to_bits(), times[1].to_bits()];
    bytes.extend(numbers.map(u64::to_le_bytes).concat());
    bytes.extend((content.len() as u64).to_le_bytes());
    bytes.extend(content);
}

fn pop(bytes: &mut &[u8]) -> Option<CompressedNode> {
    let (head, rest) = bytes.split_at_checked(HEAD_BYTES)?;
    let word = |at: usize| Some(u32::from_le_bytes(head.get(at..at + 4)?.try_into().ok()?));
    let long = |at: usize| Some(u64::from_le_bytes(head.get(at..at + 8)?.try_into().ok()?));
    let (chunk, rest) = rest.split_at_checked(usize::try_from(long(40)?).ok()?)?;
    *bytes = rest;
    Some(CompressedNode {
        key: NodeKey {
            level: word(0)?,
            position: [word(4)?, word(8)?, word(12)?],
        },
        points: long(16)?,
        times: [f64::from_bits(long(24)?), f64::from_bits(long(32)?)],
        chunk: chunk.to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoded_nodes_equal_the_encoded_ones_and_cut_bytes_are_none() {
        let node = |level: u32| CompressedNode {
            key: NodeKey {
                level,
                position: [1, 2, level],
            },
            points: u64::from(level) * 7,
            times: [0.5, -3.0],
            chunk: vec![level as u8; level as usize],
        };
        let nodes: Vec<CompressedNode> = (0..5).map(node).collect();
        let bytes = compressed_bytes(&nodes);
        assert_eq!(compressed_nodes(&bytes), Some(nodes));
        assert_eq!(compressed_nodes(&bytes[..bytes.len() - 1]), None);
        let records = NodeRecords::from([(node(3).key, vec![1, 2, 3]), (node(4).key, vec![])]);
        assert_eq!(records_of_nodes(&record_bytes(&records)), Some(records));
    }
}
