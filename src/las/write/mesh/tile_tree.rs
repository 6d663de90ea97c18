//! The hierarchy of the tiles of a mesh: which tile replaces which.
//!
//! ```text
//!   level 2   ┌───────┐     A square of a level covers four of the level below; the column
//!   level 1   ├───┬───┤     and the row of the square above are half of its own, rounded
//!   level 0   ├─┬─┼─┬─┤     down. A tile stands under the next tile above it, which may be
//!             └─┴─┴─┴─┘     several levels higher.
//! ```
//!
//! Above the coarsest tiles squares without content join them four by four, up to one root.
//! Squares of both signs never have one square above them; the root joins the four around
//! the zero point.

use std::collections::BTreeMap;

/// A tile in the hierarchy.
#[derive(Debug)]
pub(super) struct TileNode {
    /// The bounds of its content and of all tiles below, in the local frame.
    pub(super) bounds: [[f64; 3]; 2],
    /// The error of showing its content instead of the tiles below.
    pub(super) geometric_error: f64,
    /// The file; `None` of a square that only joins those below.
    pub(super) uri: Option<String>,
    pub(super) children: Vec<Self>,
}

impl TileNode {
    /// A node without content that joins `children`. Where only its box is large enough to be
    /// seen, it is left for them: its error is the diagonal of the box.
    pub(super) fn joining(children: Vec<Self>) -> Self {
        let bounds = union(children.iter().map(|child| child.bounds));
        let errors = children.iter().map(|child| child.geometric_error);
        Self {
            bounds,
            geometric_error: errors.fold(diagonal(bounds), f64::max),
            uri: None,
            children,
        }
    }

    /// Puts `children` under the node, and its bounds around them.
    fn adopt(&mut self, children: Vec<Self>) {
        let bounds = children.iter().map(|child| child.bounds);
        self.bounds = union(bounds.chain([self.bounds]));
        self.children = children;
    }
}

/// Nodes by the square that contains them, as row and column.
type Nodes = BTreeMap<[i64; 2], Vec<TileNode>>;

/// The root over all tiles. `levels` has the tiles without children of each level, the finest
/// first, with their rows and columns, at most one for each square; `None` if there are none.
pub(super) fn root_of(levels: Vec<BTreeMap<[i64; 2], TileNode>>) -> Option<TileNode> {
    let mut nodes = Nodes::new();
    for tiles in levels {
        nodes = in_squares_above(nodes);
        for (square, mut tile) in tiles {
            let inside = nodes.entry(square).or_default();
            tile.adopt(std::mem::take(inside));
            inside.push(tile);
        }
    }
    let is_at_zero = |square: &[i64; 2]| square.iter().all(|index| [-1, 0].contains(index));
    while nodes.len() > 1 && !nodes.keys().all(is_at_zero) {
        nodes = in_squares_above(nodes);
        for inside in nodes.values_mut() {
            *inside = joined(std::mem::take(inside)).into_iter().collect();
        }
    }
    joined(nodes.into_values().flatten().collect())
}

/// The nodes by the squares above theirs.
fn in_squares_above(nodes: Nodes) -> Nodes {
    let mut above = Nodes::new();
    for (square, inside) in nodes {
        let square = square.map(|index| index.div_euclid(2));
        above.entry(square).or_default().extend(inside);
    }
    above
}

/// One node for `nodes`; `None` if there are none.
fn joined(mut nodes: Vec<TileNode>) -> Option<TileNode> {
    match nodes.len() {
        0 | 1 => nodes.pop(),
        _ => Some(TileNode::joining(nodes)),
    }
}

fn union(bounds: impl Iterator<Item = [[f64; 3]; 2]>) -> [[f64; 3]; 2] {
    let nothing = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    bounds.fold(nothing, |[low, high], [min, max]| {
        [
            [0, 1, 2].map(|axis| min[axis].min(low[axis])),
            [0, 1, 2].map(|axis| max[axis].max(high[axis])),
        ]
    })
}

/// The length of the diagonal of a box.
pub(super) fn diagonal([min, max]: [[f64; 3]; 2]) -> f64 {
    let squares = (0..3).map(|axis| (max[axis] - min[axis]).powi(2));
    squares.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tile of a unit square times 2^level, with an error of that length.
    fn tile(level: i32, [row, column]: [i64; 2]) -> ([i64; 2], TileNode) {
        let edge = 2_f64.powi(level);
        let corner = [column as f64 * edge, row as f64 * edge, 0.0];
        let node = TileNode {
            bounds: [corner, [corner[0] + edge, corner[1] + edge, 1.0]],
            geometric_error: edge,
            uri: Some(format!("{level} {row} {column}")),
            children: Vec::new(),
        };
        ([row, column], node)
    }

    /// Checks a node and what is below, and collects the names of its contents.
    fn check(node: &TileNode, contents: &mut Vec<String>) {
        contents.extend(node.uri.clone());
        for child in &node.children {
            assert!(child.geometric_error <= node.geometric_error);
            for axis in 0..3 {
                assert!(node.bounds[0][axis] <= child.bounds[0][axis]);
                assert!(node.bounds[1][axis] >= child.bounds[1][axis]);
            }
            check(child, contents);
        }
    }

    #[test]
    fn tiles_of_one_level_are_joined_four_by_four_and_none_is_lost() {
        for shift in [0, -5, 100_000] {
            let squares = (0..10).flat_map(|row| (0..10).map(move |c| [row + shift, c - shift]));
            let mut root = root_of(vec![squares.map(|square| tile(0, square)).collect()]).unwrap();
            let mut contents = Vec::new();
            check(&root, &mut contents);
            contents.sort();
            contents.dedup();
            assert_eq!(contents.len(), 100);
            let mut depth = 0;
            while let Some(child) = root.children.pop() {
                assert!(root.children.len() < 4);
                root = child;
                depth += 1;
            }
            assert!((2..=5).contains(&depth), "{depth}");
        }
    }

    #[test]
    fn a_tile_stands_under_the_next_tile_above_it() {
        let levels = vec![
            BTreeMap::from([tile(0, [-1, 4]), tile(0, [-1, 5]), tile(0, [-3, 7])]),
            BTreeMap::from([tile(1, [-1, 2])]),
            BTreeMap::from([tile(2, [-1, 1])]),
        ];
        let root = root_of(levels).unwrap();
        check(&root, &mut Vec::new());
        assert_eq!(root.uri.as_deref(), Some("2 -1 1"));
        let below = |node: &TileNode| -> Vec<String> {
            let children = node.children.iter();
            children.filter_map(|child| child.uri.clone()).collect()
        };
        assert_eq!(below(&root), ["0 -3 7", "1 -1 2"]);
        assert_eq!(below(&root.children[1]), ["0 -1 4", "0 -1 5"]);
    }

    #[test]
    fn no_tiles_have_no_root_and_one_tile_is_it() {
        assert!(root_of(Vec::new()).is_none());
        let root = root_of(vec![BTreeMap::from([tile(0, [3, -4])])]).unwrap();
        assert_eq!(root.uri.as_deref(), Some("0 3 -4"));
    }
}
