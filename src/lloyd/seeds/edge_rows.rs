//! Rows of nodes along sharp edges, for sites that are to end on the edge.
//!
//! ```text
//!    o     o     o     o     o       nodes of the lattice of a face
//!       o     o     o     o
//!    ──x─────x─────x─────x─────x──   nodes on the edge, a spacing apart
//!      o     o     o     o     o     nodes of the lattice of the other face
//! ```
//!
//! Two lattices meet at an edge in no order: of their nodes some are near to it, and there are gaps between them.
//! So the nodes of the edge are elected first, and those of lattices keep clear of them.
//!
//! The nodes follow from the edge alone: they are where it crosses planes, across one of the axes, that are as far apart as
//! two nodes of an edge of its direction are. The direction is rounded for that, so that the places along an edge from which it
//! is seen, each with a little noise, have the same planes in common. Two tiles have the same nodes.

use crate::geometry::{Local, SharpEdge};

/// Nodes of lattices look for an edge within this distance. Each node of the edge is found from several of them then, so that
/// noise, in which one does not see the edge, leaves no gap.
pub(super) const REACH_IN_SPACINGS: f64 = 1.3;

/// The largest component of a direction is rounded to one of so many steps: distances between nodes are a spacing within 1.4 %.
const DIRECTION_STEPS: f64 = 64.0;

/// The node on `edge` nearest to its place, for nodes a `spacing` (CRS units) apart.
pub(super) fn node_on(edge: &SharpEdge, spacing: f64) -> Local {
    let SharpEdge { place, direction } = edge;
    let axis = direction.iamax();
    let share = (direction[axis].abs() * DIRECTION_STEPS).round() / DIRECTION_STEPS;
    let step = share * spacing;
    let plane = (place[axis] / step).round() * step;
    place + direction * ((plane - place[axis]) / direction[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_on_an_edge_are_a_spacing_apart_wherever_it_is_seen_from() {
        for direction in [
            Local::x(),
            Local::new(0.94, 0.34, 0.0),
            Local::new(-0.5, 0.6, 0.62),
            Local::repeat(1.0),
        ] {
            let (direction, spacing) = (direction.normalize(), 0.1);
            // The direction has noise, and either sign.
            let seen = |k: i32| SharpEdge {
                place: Local::new(30.0, -20.0, 7.0) + direction * (0.01 * f64::from(k)),
                direction: (direction + Local::new(0.001, -0.001, 0.001) * f64::from(k % 3))
                    .normalize()
                    * f64::from(1 - 2 * (k & 1)),
            };
            let nodes: Vec<Local> = (0..300).map(|k| node_on(&seen(k), spacing)).collect();
            let mut along: Vec<f64> = nodes.iter().map(|node| node.dot(&direction)).collect();
            along.sort_by(f64::total_cmp);
            let gaps: Vec<f64> = along.windows(2).map(|w| (w[1] - w[0]) / spacing).collect();
            let is_new = |gap: &&f64| **gap > 0.01;
            assert!((29..=31).contains(&gaps.iter().filter(is_new).count()));
            let mut between = gaps.iter().filter(is_new);
            assert!(between.all(|gap| (gap - 1.0).abs() < 0.02), "{gaps:.3?}");
            for (k, node) in (0..).zip(&nodes) {
                let shift = (node - seen(k).place).norm();
                assert!(shift <= 0.51 * spacing, "{shift}");
            }
        }
    }
}
