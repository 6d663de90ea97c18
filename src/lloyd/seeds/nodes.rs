//! Nodes of hexagonal lattices, for seeds to be elected at.
//!
//! The most even cover of a plane is a hexagonal lattice. So where the scan has a surface, the
//! nodes of a lattice in its plane, put on the patches, are elected first. Where the surface
//! bends, one lattice gives way to the next: each goes on into the other until their nodes are too
//! near to each other, and those of the one that is tilted less against the surface stay. Sharp edges can have
//! [nodes of their own](super::edge_rows). Points of the scan fill what is left.
//!
//! Lloyd's method alone never gets there: from random seeds it ends in small grains with
//! defects all around, and every pair of defects takes hundreds of iterations to meet and
//! vanish.
//!
//! Nothing here knows of tiles: the lattice follows from the normals of the surface, and is
//! anchored at the run's origin.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::{
    edge_rows,
    lattice::Lattice,
    normals::{CellLattice, LatticeCells, by_block},
};
use crate::{
    geometry::{Local, Stored},
    lloyd::{
        step::{Fit, Restriction, Samples, lie_all_around},
        surface::Surface,
    },
};

/// Samples nearer to each other than this whose nearest node is the same are of one surface.
const SAME_NODE_IN_SPACINGS: f64 = 0.8;

/// A node is a seed if a point of the scan is within this of it. The boundary restriction is as narrow
/// as the scan is dense, and of points at random none is that near to one node in twenty. With those
/// nodes missing, planes had vacancies, which iterations do not close: on the planes of a simulated street of
/// 5 M points the energy ratio was 1.0022 without them and 1.0005 with all of them.
const NEAR_POINT_IN_SPACINGS: f64 = 0.45;

/// Nodes in such gaps are seeds where the patch is trusted fully, and where the mean of the samples around them is nearer to them
/// than this share of the fit radius: at a border or an edge it is farther, and what is not scanned there is no gap.
const LARGEST_OFFSET_IN_FIT_RADII: f64 = 0.25;

/// A lattice goes on into cells nearby only where the patch is trusted fully, and the scan reaches at least this far in every
/// direction: behind an edge or a border the patch is none of the surface that the lattice comes from. On a simulated street of 5 M
/// points (100 K sites) the p99 of the distances to the surface is 0.199 spacings with lattices that go on everywhere, 0.171 with those
/// that go on where patches are trusted fully, and 0.147 with this.
const LEAST_REACH_IN_SPACINGS: f64 = 0.4;

/// Distances of samples to nodes, in thousandths of a spacing, are less than this.
const RANKS_TO_A_TILT: u32 = 1000;

/// The lattices of a scan.
pub(super) struct Nodes {
    lattices: LatticeCells,
}

/// Nodes on surfaces, each with its rank: of two that are too near to each other the one with the lower rank is elected.
#[derive(Default)]
pub(super) struct RankedNodes {
    /// The nodes on sharp edges, ranked by the distance to the node that the edge was seen from.
    pub(super) on_edges: Vec<(u32, Stored)>,
    /// The nodes on patches that are trusted fully, ranked by the tilt of the lattice, then by the distance to the sample that the
    /// node was found from.
    pub(super) trusted: Vec<(u32, Stored)>,
    /// The other nodes, ranked by that distance alone. They are elected after those that are trusted, with the usual radius, and so
    /// take the place of none: on the simulated street 97 instead of 101 sites are astray.
    pub(super) doubtful: Vec<(u32, Stored)>,
}

/// What is found at a candidate.
struct Found {
    /// Whether the node is on a patch that is trusted fully, and the node with its rank.
    on_patch: Option<(bool, (u32, Stored))>,
    /// A node on a sharp edge nearby, with its rank.
    on_edge: Option<(u32, Stored)>,
}

/// A sample near a node.
#[derive(Clone, Copy, Debug)]
struct Candidate<'a> {
    /// The lattice, as it is in a cell.
    of_cell: &'a CellLattice,
    /// The edge of the lattice (CRS units).
    spacing: f64,
    /// The row and the column of the node.
    node: [i64; 2],
    /// Squared distance (spacings squared) from the line through the node along the normal.
    squared: f64,
    sample: Local,
}

impl Nodes {
    /// The lattices of `surface`, with edges of its spacing.
    pub(super) fn new(surface: Surface<'_>) -> Self {
        Self {
            lattices: LatticeCells::new(surface),
        }
    }

    /// Whether there is a lattice, and so a surface, at `position`.
    pub(super) fn have(&self, position: Local) -> bool {
        self.lattices.have(position)
    }

    /// The nodes that lie on `surface`, moved onto its patches.
    pub(super) fn on_surface(&self, surface: Surface<'_>) -> RankedNodes {
        let candidates = self.candidates(surface);
        let above: Vec<Local> = candidates
            .iter()
            .map(|own| own.lattice().moved_to_node(own.sample, own.spacing))
            .collect();
        let found = by_block(&above, surface, |samples, own| {
            candidates[own].found(above[own], surface, samples)
        });
        let mut nodes = RankedNodes::default();
        for Found { on_patch, on_edge } in found {
            nodes.on_edges.extend(on_edge);
            match on_patch {
                Some((true, node)) => nodes.trusted.push(node),
                Some((false, node)) => nodes.doubtful.push(node),
                None => {}
            }
        }
        nodes
    }

    /// For every node near a surface the sample nearest to it. Where the spacing varies from place to place there are no nodes.
    fn candidates(&self, surface: Surface<'_>) -> Vec<Candidate<'_>> {
        let samples = surface.scan.samples().points();
        let LatticeCells {
            cells,
            order,
            lattices,
            ..
        } = &self.lattices;
        let cells: Vec<_> = cells.ranges().zip(lattices).collect();
        let mut candidates: Vec<Candidate<'_>> = cells
            .into_par_iter()
            .flat_map_iter(|(range, lattices)| {
                let in_cell = move || order[range.clone()].iter().map(|&i| samples[i as usize]);
                let of_lattice = move |lattice| candidates_of_cell(in_cell(), lattice, surface);
                lattices.iter().flat_map(of_lattice)
            })
            .collect();
        candidates.par_sort_unstable_by(Candidate::cmp);
        // Most nodes were found from more than one cell.
        let is_best = |own: &Candidate, others: &[Candidate]| {
            let near = SAME_NODE_IN_SPACINGS * own.spacing;
            let is_own = |other: &Candidate| (other.sample - own.sample).norm() < near;
            !others
                .iter()
                .take_while(|other| other.cmp(own).is_lt())
                .any(is_own)
        };
        candidates
            .par_chunk_by(|a, b| a.key() == b.key())
            .flat_map_iter(|found| found.iter().filter(|own| is_best(own, found)).copied())
            .collect()
    }
}

/// For every node of a lattice the nearest of the `samples` of a cell.
fn candidates_of_cell<'a>(
    samples: impl Iterator<Item = Local>,
    of_cell: &'a CellLattice,
    surface: Surface<'_>,
) -> Vec<Candidate<'a>> {
    let mut best: Vec<Candidate<'_>> = Vec::new();
    for sample in samples {
        let Some(spacing) = surface.field().wanted_at(sample) else {
            continue;
        };
        let nearest = of_cell.lattice.nearest_node(sample, spacing);
        let candidate = Candidate {
            of_cell,
            spacing,
            node: nearest.index,
            squared: nearest.squared(),
            sample,
        };
        match best.iter_mut().find(|known| known.key() == candidate.key()) {
            Some(known) if candidate.squared < known.squared => *known = candidate,
            Some(_) => {}
            None => best.push(candidate),
        }
    }
    best
}

impl Candidate<'_> {
    fn lattice(&self) -> &Lattice {
        &self.of_cell.lattice
    }

    /// What is found on the patch of `surface` at the position `above` the node, and at an edge that it rounds.
    fn found(&self, above: Local, surface: Surface<'_>, samples: &mut Samples) -> Option<Found> {
        let options = surface.options_at(above);
        let surface = surface.with(&options);
        let mut fit = Fit::trusted(above, samples, &options)?;
        // The patch may be tilted against the lattice: its foot is a little beside the node,
        // and much less so the second time.
        let foot = fit.patch.foot_point(above);
        let node = self.lattice().moved_to_node(foot, self.spacing);
        let position = fit.patch.foot_point(node);
        let ranked = |rank: u32, node: Local| Some((rank, surface.quantization().stored(node)?));
        let on_edge = self.on_edge(&mut fit, position, surface, samples);
        let is_trusted = fit.trust >= 1.0;
        let is_node = self.is_node(&mut fit, [above, position], surface, samples);
        let own = is_node.then(|| ranked(self.rank(is_trusted), position));
        Some(Found {
            on_patch: own.flatten().map(|ranked| (is_trusted, ranked)),
            on_edge: on_edge.and_then(|(rank, node)| ranked(rank, node)),
        })
    }

    /// The node of the sharp edge nearest to `position`, which is on the patch of `fit`, and its rank; `None` without an edge, and where
    /// sites do not stand in rows on edges.
    fn on_edge(
        &self,
        fit: &mut Fit,
        position: Local,
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> Option<(u32, Local)> {
        // What the lattice of a neighbouring cell would find, that of the cell finds.
        if !self.of_cell.is_own || !surface.options.has_rows_on_edges() {
            return None;
        }
        let reach = edge_rows::REACH_IN_SPACINGS * self.spacing;
        let edge = fit.edge_near(position, reach, surface, samples)?;
        let node = edge_rows::node_on(&edge, self.spacing);
        let distance = (node - position).norm() / self.spacing;
        // An edge ends somewhere.
        let is_on_scan = fit.is_within_threshold(node, surface);
        is_on_scan.then_some((rank_of(distance), node))
    }

    /// Whether the node is a seed at its `position` on the patch of `fit`, which was fitted `above` it: the surface reaches there, and the
    /// scan is near.
    fn is_node(
        &self,
        fit: &mut Fit,
        [above, position]: [Local; 2],
        surface: Surface<'_>,
        samples: &mut Samples,
    ) -> bool {
        let is_trusted = fit.trust >= 1.0;
        let goes_on = self.of_cell.is_own
            || is_trusted
                && fit.least_reach(above, surface, samples)
                    >= LEAST_REACH_IN_SPACINGS * self.spacing;
        let is_in_gap = |samples: &mut _| {
            is_trusted
                && surface.options.restriction == Restriction::Local
                && (surface.scan).has_point_within(position, NEAR_POINT_IN_SPACINGS * self.spacing)
                && is_surrounded(above, surface, samples)
        };
        // A node beyond a border is a seed that the iterations lead back. Without such nodes there were vacancies at borders: in a
        // scan of trees with noise δ was 0.131 instead of 0.123.
        goes_on && (fit.is_within_threshold(position, surface) || is_in_gap(samples))
    }

    /// The rank of the node in its election.
    fn rank(&self, is_trusted: bool) -> u32 {
        let distance = rank_of(self.squared.sqrt());
        match is_trusted {
            true => self.of_cell.tilt_rank * RANKS_TO_A_TILT + distance,
            false => distance,
        }
    }

    /// What tells nodes apart.
    #[inline]
    fn key(&self) -> ([i8; 4], [i64; 2], u64) {
        (self.lattice().key, self.node, self.spacing.to_bits())
    }

    /// The order by lattice, node, and distance from the node.
    fn cmp(&self, other: &Self) -> Ordering {
        let coordinates = |candidate: &Self| -> [f64; 3] { candidate.sample.into() };
        self.key()
            .cmp(&other.key())
            .then(self.squared.total_cmp(&other.squared))
            .then_with(|| {
                let [own, other] = [self, other].map(coordinates);
                let both = own.iter().zip(&other);
                both.map(|(a, b)| a.total_cmp(b))
                    .find(|order| order.is_ne())
                    .unwrap_or(Ordering::Equal)
            })
    }
}

/// The rank by a distance (spacings) alone.
fn rank_of(distance: f64) -> u32 {
    (distance * f64::from(RANKS_TO_A_TILT)) as u32
}

/// Whether `position`, in the box of `samples`, has the scan all around it.
fn is_surrounded(position: Local, surface: Surface<'_>, samples: &mut Samples) -> bool {
    let radius = surface.options.fit_radius;
    let (near, _, _) = samples.in_ball(position, radius);
    lie_all_around(position, near, radius, LARGEST_OFFSET_IN_FIT_RADII)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::Quantization,
        lloyd::{Scan, SolverOptions, seeds::lattice::ROW_IN_SPACINGS},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// A plane through the origin that contains `u` and `v`, with a point every 50 stored units.
    fn plane(u: Local, v: Local) -> (Nodes, Scan, SolverOptions) {
        part_of_plane(u, v, |_| true)
    }

    /// The points of such a plane that `is_scanned` is true for.
    fn part_of_plane(
        u: Local,
        v: Local,
        is_scanned: impl Fn(Local) -> bool,
    ) -> (Nodes, Scan, SolverOptions) {
        let points: Vec<Stored> = (-60..60)
            .flat_map(|i| (-60..60).map(move |j| (f64::from(i), f64::from(j))))
            .map(|(i, j)| u * (0.05 * i) + v * (0.05 * j))
            .filter(|&position| is_scanned(position))
            .filter_map(|position| QUANTIZATION.stored(position))
            .collect();
        let options = SolverOptions::new(0.5);
        let scan = Scan::as_scanned(points, QUANTIZATION, &options);
        (Nodes::new(Surface::new(&scan, &options)), scan, options)
    }

    #[test]
    fn the_nodes_of_the_ground_are_those_of_the_hexagonal_lattice() {
        let (nodes, scan, options) = plane(Local::x(), Local::y());
        let mut positions: Vec<Local> = nodes
            .on_surface(Surface::new(&scan, &options))
            .trusted
            .into_iter()
            .map(|(_, position)| QUANTIZATION.local(position) / 0.5)
            .filter(|position| position.norm() < 4.0)
            .collect();
        let mut count = 0;
        for (i, j) in (-6..6).flat_map(|i| (-6..6).map(move |j| (f64::from(i), f64::from(j)))) {
            let node = Local::new(i + 0.5 * j, ROW_IN_SPACINGS * j, 0.0);
            let is_it = |position: &Local| (position - node).norm() < 0.005;
            count += usize::from(positions.iter().any(is_it));
            positions.retain(|position| !is_it(position));
        }
        // The disc has room for this many.
        assert!((50..=64).contains(&count), "{count}");
        assert!(positions.is_empty(), "{positions:?}");
    }

    #[test]
    fn a_gap_in_the_scan_has_its_node_and_what_lies_beyond_a_border_has_none() {
        let has_origin = |is_scanned: fn(Local) -> bool| {
            let (nodes, scan, options) = part_of_plane(Local::x(), Local::y(), is_scanned);
            let RankedNodes {
                trusted, doubtful, ..
            } = nodes.on_surface(Surface::new(&scan, &options));
            let is_it = |&(_, node): &_| QUANTIZATION.local(node).norm() < 0.005;
            trusted.iter().chain(&doubtful).any(is_it)
        };
        assert!(has_origin(|position| position.norm() > 0.18));
        assert!(!has_origin(|position| position.x > 0.18));
        // No point of the scan is near to the node.
        assert!(!has_origin(|position| position.norm() > 0.25));
    }

    #[test]
    fn there_is_no_lattice_without_points_or_without_a_surface() {
        let (nodes, ..) = plane(Local::x(), Local::z());
        assert!(!nodes.have(Local::new(0.0, 10.0, 0.0)));
        assert!(nodes.have(Local::zeros()));
        let wire: Vec<Stored> = (0..2000)
            .map(|x| Stored {
                x: 5 * x,
                y: 0,
                z: 0,
            })
            .collect();
        let options = SolverOptions::new(0.5);
        let scan = Scan::as_scanned(wire, QUANTIZATION, &options);
        let nodes = Nodes::new(Surface::new(&scan, &options));
        assert!(!nodes.have(Local::new(1.0, 0.0, 0.0)));
        let RankedNodes {
            trusted, doubtful, ..
        } = nodes.on_surface(Surface::new(&scan, &options));
        assert!(trusted.is_empty() && doubtful.is_empty());
    }
}
