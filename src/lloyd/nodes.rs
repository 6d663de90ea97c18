//! Nodes of hexagonal lattices, for seeds to be elected at.
//!
//! The most even cover of a plane is a hexagonal lattice. So where the scan has
//! a surface, the nodes of a lattice in its plane, put on the patches, are
//! elected first. Where the surface bends, one lattice gives way to the next, and
//! points of the scan fill what is left between them.
//!
//! Lloyd's method alone never gets there: from random seeds it ends in small
//! grains with defects all around, and every pair of defects takes hundreds of
//! iterations to meet and vanish.
//!
//! Nothing here knows of tiles. The lattice of a place follows from its normal
//! alone, rounded to one of a few directions, and is anchored at the run's
//! origin: two tiles, and two ends of a long wall, have the same nodes. Only
//! products and roots are used, so that every machine finds the same bits.

use std::{
    cmp::Ordering,
    ops::{ControlFlow, Range},
};

use rayon::prelude::*;

use super::{
    Scan, SolverOptions,
    fit::{Samples, is_allowed},
    neighborhoods::{BLOCK, BLOCKS_AT_ONCE, bounds},
    seeds::ROW,
};
use crate::geometry::{CellIndex, Local, OccupiedCells, Patch, PatchKind, Stored, cell_of};

/// A component of a normal, over the largest, is rounded to 0, ± this or ± 1.
/// Finer, and a curved surface falls into more grains; coarser, and a lattice
/// is stretched by more than a twentieth on the planes that it serves. On a
/// sphere (300 K points, 10 K sites, 20 iterations) the energy ratio is 1.014
/// with no step between 0 and 1, 1.006 with this one, 1.010 with steps of 0.4.
const STEP: f64 = 2.0 / 3.0;

/// Edge of a cell that has one normal, in spacings.
const CELL: f64 = 1.0;

/// How many cells away a cell has a say in the normal of another.
const SAY: i32 = 2;

/// Cosine between normals of one surface, at the least.
const SAME_SURFACE: f64 = 0.87;

/// A residual, in fit radii, and a roundness beyond which a neighbourhood has no
/// normal.
const FLATNESS: f64 = 0.15;
const ROUNDNESS: f64 = 0.3;

/// Samples nearer to each other than this, in spacings, and nearest to one node
/// are of one surface.
const ONE_NODE: f64 = 0.8;

/// The lattices of a scan.
pub(super) struct Nodes {
    spacing: f64,
    /// The samples of the scan by cell.
    cells: OccupiedCells,
    order: Vec<u32>,
    /// For each occupied cell its lattice, if it has one.
    hexagons: Vec<Option<Hexagons>>,
}

/// A hexagonal lattice by the directions along and across its rows.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hexagons {
    /// The same for the same lattice.
    key: [i8; 4],
    axes: [Local; 2],
}

/// A sample near a node.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    hexagons: Hexagons,
    /// The node, by row and column.
    node: [i64; 2],
    /// Its squared distance from the line through the node, in spacings.
    squared: f64,
    sample: Local,
}

impl Nodes {
    /// Lattices with edges of the spacing, from the normals of `scan`.
    pub(super) fn new(scan: &Scan, options: &SolverOptions) -> Self {
        let edge = CELL * options.spacing;
        let samples = scan.samples().points();
        let (cells, order) = OccupiedCells::sort(samples, |&p| cell_of(p, edge));
        let ranges: Vec<_> = cells.ranges().collect();
        let mean = |range: &Range<usize>| {
            let held = order[range.clone()]
                .iter()
                .map(|&place| samples[place as usize]);
            held.sum::<Local>() / range.len() as f64
        };
        let middles: Vec<Local> = ranges.par_iter().map(mean).collect();
        let mut normals: Vec<(CellIndex, Option<Local>)> = middles
            .iter()
            .map(|&middle| (cell_of(middle, edge), None))
            .collect();
        let normal = |samples: &mut Samples, own: usize| {
            let radius = options.fit_radius;
            let (near, _) = samples.within(middles[own], radius);
            let patch = Patch::fit(middles[own], near, radius, PatchKind::Plane)?;
            let is_flat = patch.residual <= FLATNESS * radius && patch.roundness >= ROUNDNESS;
            is_flat.then(|| (own, patch.normal()))
        };
        for (own, normal) in by_block(&middles, scan, options, normal) {
            normals[own].1 = Some(normal);
        }
        let hexagons = normals
            .par_iter()
            .map(|&(index, own)| {
                let own = own?;
                // Neighbours on the same surface are heard, so that noise does
                // not scatter lattices over it.
                let mut sum = Local::zeros();
                let [low, high] = [-SAY, SAY].map(|say| index.map(|c| c.saturating_add(say)));
                let _ = cells.visit_box(low, high, |cell| {
                    if let Some(other) = normals[cell].1 {
                        let cosine = own.dot(&other);
                        if cosine.abs() >= SAME_SURFACE {
                            sum += other * cosine.signum();
                        }
                    }
                    ControlFlow::<()>::Continue(())
                });
                Some(Hexagons::across(sum))
            })
            .collect();
        Self {
            spacing: options.spacing,
            cells,
            order,
            hexagons,
        }
    }

    /// Whether there is a lattice, and so a surface, at `place`.
    pub(super) fn have(&self, place: Local) -> bool {
        let cell = self.cells.place(cell_of(place, CELL * self.spacing));
        cell.is_some_and(|cell| self.hexagons[cell].is_some())
    }

    /// The nodes that the scan has a surface at, on its patches, each with its
    /// distance to the sample that it was found from (in thousandths of a
    /// spacing).
    pub(super) fn places(&self, scan: &Scan, options: &SolverOptions) -> Vec<(u32, Stored)> {
        let candidates = self.candidates(scan);
        let above: Vec<Local> = candidates
            .iter()
            .map(|own| self.to_node(own.sample, own.hexagons.axes))
            .collect();
        by_block(&above, scan, options, |samples, own| {
            let candidate = &candidates[own];
            let place = self.on_patch(candidate, above[own], scan, options, samples)?;
            let rank = (candidate.squared.sqrt() * 1e3) as u32;
            Some((rank, scan.quantization().stored(place)?))
        })
    }

    /// The samples nearest to the nodes of their lattices.
    fn candidates(&self, scan: &Scan) -> Vec<Candidate> {
        let samples = scan.samples().points();
        let cells: Vec<_> = self.cells.ranges().zip(&self.hexagons).collect();
        let mut candidates: Vec<Candidate> = cells
            .into_par_iter()
            .filter_map(|(range, hexagons)| Some((range, (*hexagons)?)))
            .map(|(range, hexagons)| {
                // Of the cell's samples the one nearest to each node.
                let mut best: Vec<Candidate> = Vec::new();
                for &place in &self.order[range] {
                    let sample = samples[place as usize];
                    let (node, [along, across]) = self.nearest_node(sample, hexagons.axes);
                    let candidate = Candidate {
                        hexagons,
                        node,
                        squared: along * along + across * across,
                        sample,
                    };
                    match best.iter_mut().find(|known| known.node == node) {
                        Some(known) if candidate.squared < known.squared => *known = candidate,
                        Some(_) => {}
                        None => best.push(candidate),
                    }
                }
                best
            })
            .flatten_iter()
            .collect();
        candidates.par_sort_unstable_by(Candidate::cmp);
        // Most nodes were found from more than one cell.
        let is_best = |own: &Candidate, others: &[Candidate]| {
            let near = ONE_NODE * self.spacing;
            let is_own = |other: &Candidate| (other.sample - own.sample).norm() < near;
            !others
                .iter()
                .take_while(|other| other.cmp(own).is_lt())
                .any(is_own)
        };
        candidates
            .par_chunk_by(|a, b| a.node == b.node && a.hexagons.key == b.hexagons.key)
            .flat_map_iter(|found| found.iter().filter(|own| is_best(own, found)).copied())
            .collect()
    }

    /// The node nearest to `place`, by row and column, and the way from it in
    /// spacings, along the row and across.
    fn nearest_node(&self, place: Local, axes: [Local; 2]) -> ([i64; 2], [f64; 2]) {
        let [s, t] = axes.map(|axis| axis.dot(&place) / self.spacing);
        let below = (t / ROW).floor();
        let [lower, upper] = [below, below + 1.0].map(|row| {
            let line = row as i64;
            let shift = 0.5 * (line & 1) as f64;
            let column = (s - shift).round();
            let way = [s - shift - column, t - row * ROW];
            ([line, column as i64], way)
        });
        let squared = |[along, across]: [f64; 2]| along * along + across * across;
        if squared(lower.1) <= squared(upper.1) {
            lower
        } else {
            upper
        }
    }

    /// `place`, moved within the lattice's plane to stand straight above or below
    /// the node nearest to it.
    fn to_node(&self, place: Local, axes: [Local; 2]) -> Local {
        let (_, [along, across]) = self.nearest_node(place, axes);
        place - (axes[0] * along + axes[1] * across) * self.spacing
    }

    /// The node of `candidate` on the patch of the scan at the place `above` it,
    /// if there is one that the node is near to.
    fn on_patch(
        &self,
        candidate: &Candidate,
        above: Local,
        scan: &Scan,
        options: &SolverOptions,
        samples: &mut Samples,
    ) -> Option<Local> {
        let mut fit = samples.fit(above, options)?;
        // The patch may be tilted against the lattice: its foot is a little
        // beside the node, and much less so the second time.
        let foot = fit.patch.foot_point(above);
        let node = self.to_node(foot, candidate.hexagons.axes);
        let place = fit.patch.foot_point(node);
        (fit.is_trusted() && is_allowed(scan, &mut fit, place, options)).then_some(place)
    }
}

/// Calls `work` for the place of every one of `places`, in parallel, with the
/// samples around its block.
fn by_block<T: Send>(
    places: &[Local],
    scan: &Scan,
    options: &SolverOptions,
    work: impl Fn(&mut Samples, usize) -> Option<T> + Sync,
) -> Vec<T> {
    let edge = BLOCK * options.spacing;
    let (blocks, order) = OccupiedCells::sort(places, |&place| cell_of(place, edge));
    let blocks: Vec<_> = blocks.ranges().collect();
    blocks
        .into_par_iter()
        .with_max_len(BLOCKS_AT_ONCE)
        .map_init(Samples::default, |samples, block| {
            let held = || order[block.clone()].iter().map(|&own| own as usize);
            let [low, high] = bounds(held().map(|own| places[own]));
            samples.look(scan, low, high, options);
            held()
                .filter_map(|own| work(samples, own))
                .collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect()
}

impl Hexagons {
    /// The lattice in the plane whose normal is `normal`, rounded.
    fn across(normal: Local) -> Self {
        let largest = normal.iamax();
        let mut steps = normal.map(|c| (c / normal[largest] / STEP).round());
        steps[largest] = 2.0;
        let n = steps.map(|c| (c * STEP).clamp(-1.0, 1.0)).normalize();
        let mut u = Local::zeros();
        u[(largest + 1) % 3] = 1.0;
        let u = (u - n * n.dot(&u)).normalize();
        let [x, y, z] = steps.map(|c| c as i8).into();
        Self {
            key: [largest as i8, x, y, z],
            axes: [u, n.cross(&u)],
        }
    }
}

impl Candidate {
    /// By lattice, node, and how near they are to it.
    fn cmp(&self, other: &Self) -> Ordering {
        let coordinates = |candidate: &Self| -> [f64; 3] { candidate.sample.into() };
        let key = |candidate: &Self| (candidate.hexagons.key, candidate.node);
        key(self)
            .cmp(&key(other))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Quantization;

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// A plane through the origin that contains `u` and `v`, every 50 units.
    fn plane(u: Local, v: Local) -> (Nodes, Scan, SolverOptions) {
        let points: Vec<Stored> = (-60..60)
            .flat_map(|i| (-60..60).map(move |j| (f64::from(i), f64::from(j))))
            .filter_map(|(i, j)| QUANTIZATION.stored(u * (0.05 * i) + v * (0.05 * j)))
            .collect();
        let options = SolverOptions::new(0.5);
        let scan = Scan::as_scanned(points, QUANTIZATION, &options);
        (Nodes::new(&scan, &options), scan, options)
    }

    #[test]
    fn the_nodes_of_the_ground_are_those_of_the_hexagonal_lattice() {
        let (nodes, scan, options) = plane(Local::x(), Local::y());
        let mut places: Vec<Local> = nodes
            .places(&scan, &options)
            .into_iter()
            .map(|(_, place)| QUANTIZATION.local(place) / 0.5)
            .filter(|place| place.norm() < 4.0)
            .collect();
        let mut count = 0;
        for (i, j) in (-6..6).flat_map(|i| (-6..6).map(move |j| (f64::from(i), f64::from(j)))) {
            let node = Local::new(i + 0.5 * j, ROW * j, 0.0);
            let is_it = |place: &Local| (place - node).norm() < 0.005;
            count += usize::from(places.iter().any(is_it));
            places.retain(|place| !is_it(place));
        }
        // As many as the disc has room for.
        assert!((50..=64).contains(&count), "{count}");
        assert!(places.is_empty(), "{places:?}");
    }

    #[test]
    fn planes_of_like_normals_have_the_same_lattice() {
        let turned = |by: f64| Hexagons::across(Local::new(0.03 * by, -0.02, 1.0));
        assert_eq!(turned(1.0), turned(-2.0));
        // Nor does the side matter from which a plane is seen.
        assert_eq!(
            Hexagons::across(Local::new(0.1, 0.9, -0.2)),
            Hexagons::across(-Local::new(0.1, 0.9, -0.2))
        );
        for normal in [Local::new(0.5, 0.6, 1.0), Local::new(-1.0, 0.2, 0.1)] {
            let [u, v] = Hexagons::across(normal).axes;
            assert!(u.dot(&v).abs() < 1e-12 && (u.norm() - 1.0).abs() < 1e-12);
            assert!(u.cross(&v).dot(&normal.normalize()).abs() > 0.93);
        }
    }

    #[test]
    fn there_is_no_lattice_where_nothing_is_or_where_it_is_no_surface() {
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
        let nodes = Nodes::new(&scan, &options);
        assert!(!nodes.have(Local::new(1.0, 0.0, 0.0)));
        assert!(nodes.places(&scan, &options).is_empty());
    }
}
