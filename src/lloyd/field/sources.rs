//! Where which spacing is wanted, and how far each such wish reaches.
//!
//! A *source* is a cell of the scan with the smallest spacing that is wanted of its points. The spacing at a position is
//!
//! ```text
//!   min over all sources of   wanted + slope · (distance to the source − distance to the nearest source)
//! ```
//!
//! so it is what is wanted where the scan is, grows no faster than the slope around finer places, and between the points of a
//! sparse scan it is what is wanted of those around.

use crate::geometry::{Local, by_position};

/// A place where a spacing is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Source {
    /// The middle of the place (local coordinates).
    pub(super) middle: Local,
    /// The place is a ball of this radius (CRS units).
    pub(super) radius: f64,
    /// The wanted spacing (CRS units).
    pub(super) spacing: f64,
}

impl Source {
    /// The distance from `position` (CRS units).
    fn distance(&self, position: Local) -> f64 {
        ((self.middle - position).norm() - self.radius).max(0.0)
    }
}

/// Sources in a tree of boxes. What is asked of them does not depend on the tree.
#[derive(Debug)]
pub(super) struct Sources {
    sources: Vec<Source>,
    /// The root comes first, and the first child of a node directly after it.
    nodes: Vec<Node>,
}

/// A part of the sources.
#[derive(Clone, Copy, Debug)]
struct Node {
    /// The box around their middles.
    low: Local,
    high: Local,
    /// The largest radius (CRS units).
    radius: f64,
    /// The finest spacing (CRS units).
    finest: f64,
    /// The first of the sources.
    first: u32,
    /// Their number.
    count: u32,
    /// The second child; 0 if the node has none.
    second: u32,
}

/// Sources of a node without children, at most.
const SOURCES_OF_A_LEAF: usize = 8;

/// The depth of a tree of 2³² sources, and some more.
const DEEPEST: usize = 40;

impl Node {
    /// The least distance from `position` to a source of the node (CRS units).
    fn distance(&self, position: Local) -> f64 {
        let nearest = position.sup(&self.low).inf(&self.high);
        ((nearest - position).norm() - self.radius).max(0.0)
    }
}

impl Sources {
    /// A tree of `sources`, in any order.
    pub(super) fn new(mut sources: Vec<Source>) -> Self {
        let mut nodes = Vec::with_capacity(2 * sources.len() / SOURCES_OF_A_LEAF + 1);
        if !sources.is_empty() {
            add_node(&mut sources, 0, &mut nodes);
        }
        Self { sources, nodes }
    }

    /// The spacing at `position` that grows by `slope` at most, and whether it is one that is wanted there, and has not grown.
    ///
    /// `None` without sources.
    pub(super) fn spacing_at(&self, position: Local, slope: f64) -> Option<(f64, bool)> {
        let (nearest, wanted) = self.nearest(position)?;
        let mut best = (wanted, true);
        let at = |distance: f64, spacing: f64| spacing + slope * (distance - nearest).max(0.0);
        self.descend(
            position,
            |node, best: &(f64, bool)| at(node.distance(position), node.finest) < best.0,
            &mut best,
            |source, best| {
                let distance = source.distance(position);
                let spacing = at(distance, source.spacing);
                if spacing < best.0 {
                    *best = (spacing, distance <= nearest);
                }
            },
        );
        Some(best)
    }

    /// The finest spacing that there can be within `radius` (CRS units) of `position`, where a source is everywhere.
    pub(super) fn finest_around(&self, position: Local, radius: f64, slope: f64) -> f64 {
        let mut best = f64::INFINITY;
        let at = |distance: f64, spacing: f64| spacing + slope * (distance - radius).max(0.0);
        self.descend(
            position,
            |node, best: &f64| at(node.distance(position), node.finest) < *best,
            &mut best,
            |source, best| *best = best.min(at(source.distance(position), source.spacing)),
        );
        best
    }

    /// The distance from `position` to the nearest source (CRS units), and the finest spacing (CRS units) among those that
    /// are as near.
    fn nearest(&self, position: Local) -> Option<(f64, f64)> {
        let mut best = (f64::INFINITY, f64::INFINITY);
        self.descend(
            position,
            |node, best: &(f64, f64)| (node.distance(position), node.finest) < *best,
            &mut best,
            |source, best| {
                let found = (source.distance(position), source.spacing);
                if found < *best {
                    *best = found;
                }
            },
        );
        best.0.is_finite().then_some(best)
    }

    /// Calls `visit` for the sources of all nodes for which `matters` is true, the nearer of two nodes first.
    fn descend<T>(
        &self,
        position: Local,
        matters: impl Fn(&Node, &T) -> bool,
        best: &mut T,
        mut visit: impl FnMut(&Source, &mut T),
    ) {
        let mut open = [0_u32; 2 * DEEPEST];
        let mut count = usize::from(!self.nodes.is_empty());
        while count > 0 {
            count -= 1;
            let number = open[count] as usize;
            let node = &self.nodes[number];
            if !matters(node, best) {
                continue;
            }
            if node.second == 0 {
                let range = node.first as usize..(node.first + node.count) as usize;
                self.sources[range]
                    .iter()
                    .for_each(|source| visit(source, best));
                continue;
            }
            let children = [number as u32 + 1, node.second];
            let distances = children.map(|child| self.nodes[child as usize].distance(position));
            let is_first_nearer = distances[0] <= distances[1];
            let [near, far] = match is_first_nearer {
                true => children,
                false => [children[1], children[0]],
            };
            open[count] = far;
            open[count + 1] = near;
            count += 2;
        }
    }
}

/// Adds the node of `sources`, of which as many stand before them as `first` says, and those below it to `nodes`.
fn add_node(sources: &mut [Source], first: u32, nodes: &mut Vec<Node>) {
    let far = Local::repeat(f64::INFINITY);
    let mut node = Node {
        low: far,
        high: -far,
        radius: 0.0,
        finest: f64::INFINITY,
        first,
        count: sources.len() as u32,
        second: 0,
    };
    for source in &*sources {
        node.low = node.low.inf(&source.middle);
        node.high = node.high.sup(&source.middle);
        node.radius = node.radius.max(source.radius);
        node.finest = node.finest.min(source.spacing);
    }
    let number = nodes.len();
    nodes.push(node);
    if sources.len() <= SOURCES_OF_A_LEAF {
        return;
    }
    let axis = (node.high - node.low).imax();
    let middle = sources.len() / 2;
    sources.select_nth_unstable_by(middle, |a, b| {
        let along = a.middle[axis].total_cmp(&b.middle[axis]);
        along.then_with(|| by_position(&a.middle, &b.middle))
    });
    let (before, after) = sources.split_at_mut(middle);
    add_node(before, first, nodes);
    nodes[number].second = nodes.len() as u32;
    add_node(after, first + middle as u32, nodes);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    fn sources(count: u64) -> Vec<Source> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let source = |k: u64| Source {
            middle: Local::new(unit(5 * k), unit(5 * k + 1), 0.1 * unit(5 * k + 2)) * 10.0,
            radius: 0.1 * unit(5 * k + 3),
            spacing: [0.05, 0.1, 0.4][(spread(k) % 40 % 3) as usize],
        };
        (0..count).map(source).collect()
    }

    /// The slow twin asks every source.
    fn slow(sources: &[Source], position: Local, slope: f64) -> f64 {
        let distances = sources.iter().map(|source| source.distance(position));
        let nearest = distances.fold(f64::INFINITY, f64::min);
        let at = |source: &Source| source.spacing + slope * (source.distance(position) - nearest);
        sources.iter().map(at).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_tree_finds_what_asking_every_source_finds() {
        let sources = sources(3000);
        let tree = Sources::new(sources.clone());
        for k in 0..2000 {
            let unit = |axis: u64| spread(7 * k + axis + (1 << 40)) as f64 / u64::MAX as f64;
            let position = Local::new(unit(0), unit(1), unit(2)) * 12.0;
            let (found, is_wanted) = tree.spacing_at(position, 0.2).unwrap();
            assert_eq!(found, slow(&sources, position, 0.2));
            assert!(!is_wanted || [0.05, 0.1, 0.4].contains(&found));
        }
        assert!(
            Sources::new(Vec::new())
                .spacing_at(Local::zeros(), 0.2)
                .is_none()
        );
    }
}
