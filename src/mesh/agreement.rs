//! Which of the triangles that stars name are in the mesh: none overlaps another one, and no edge has more
//! than two.
//!
//! Two stars may differ about the diagonal of four points that lie nearly on a circle, or where a surface is
//! bent or cluttered. The triangle that more stars name is preferred, then the one with the smaller circle through
//! its corners, which is the better shaped. A triangle is in the mesh as soon as no better one that is undecided
//! is in its way; this takes a few rounds, each of which looks no farther than the corners of a
//! triangle. What is undecided after the last round is left to the closing of holes.

use rayon::prelude::*;

use super::{
    Corners,
    by_corner::sorted_by_corner,
    stars::{Candidate, LARGEST_CIRCUMRADIUS},
    triangle::{circumradius_squared, is_fold, is_overlap, others, places},
};
use crate::geometry::Local;

/// Number of rounds; nearly all triangles are decided in two.
const ROUNDS: usize = 3;
/// How far away triangles can be that decide on a triangle, in spacings.
pub(super) const REACH: f64 = 2.0 * LARGEST_CIRCUMRADIUS * (ROUNDS as f64 + 1.0);

/// Triangles that an edge of a mesh can have.
const TRIANGLES_OF_AN_EDGE: usize = 2;

/// What is known of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    Undecided,
    Accepted,
    Rejected,
}

/// The triangles among `candidates` that are in the mesh.
pub(super) fn agreed(positions: &[Local], candidates: Vec<Candidate>) -> Vec<Corners> {
    let rivals = Rivals::of(positions, &candidates);
    let mut standing = vec![Standing::Undecided; candidates.len()];
    let mut undecided: Vec<u32> = Vec::new();
    for (k, standing) in (0..).zip(&mut standing) {
        match rivals.has_any(k) {
            true => undecided.push(k),
            false => *standing = Standing::Accepted,
        }
    }
    for _ in 0..ROUNDS {
        let decided: Vec<Standing> = undecided
            .par_iter()
            .map(|&k| rivals.decide(k, &standing))
            .collect();
        for (&k, decided) in undecided.iter().zip(decided) {
            standing[k as usize] = decided;
        }
        undecided.retain(|&k| standing[k as usize] == Standing::Undecided);
    }
    candidates
        .iter()
        .zip(standing)
        .filter(|&(_, standing)| standing == Standing::Accepted)
        .map(|(candidate, _)| candidate.corners)
        .collect()
}

/// The candidates that stand in each other's way.
struct Rivals {
    /// The rank of each candidate: the smaller, the better.
    ranks: Vec<u32>,
    /// The candidates that cannot be in a mesh together with candidate k are
    /// `others[starts[k]..starts[k + 1]]`.
    starts: Vec<u32>,
    others: Vec<u32>,
    /// The candidates on each edge that has more than two.
    contested: Vec<Vec<u32>>,
    /// Each candidate on such an edge, and the index of the edge in `contested`; sorted.
    contested_by: Vec<(u32, u32)>,
}

impl Rivals {
    fn of(positions: &[Local], candidates: &[Candidate]) -> Self {
        let Found {
            mut pairs,
            contested,
        } = find(positions, candidates);
        pairs.par_sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; candidates.len() + 1];
        for &(one, _) in &pairs {
            starts[one as usize + 1] += 1;
        }
        for k in 0..candidates.len() {
            starts[k + 1] += starts[k];
        }
        let mut contested_by: Vec<(u32, u32)> = (0..)
            .zip(&contested)
            .flat_map(|(number, on_edge)| on_edge.iter().map(move |&k| (k, number)))
            .collect();
        contested_by.par_sort_unstable();
        Self {
            ranks: ranks(positions, candidates),
            starts,
            others: pairs.into_iter().map(|(_, other)| other).collect(),
            contested,
            contested_by,
        }
    }

    /// The candidates that cannot be in a mesh together with `candidate`.
    fn rivals_of(&self, candidate: u32) -> &[u32] {
        let [from, to] = [0, 1].map(|k| self.starts[candidate as usize + k] as usize);
        &self.others[from..to]
    }

    /// The candidates on each contested edge of `candidate`.
    fn contested_by(&self, candidate: u32) -> impl Iterator<Item = &[u32]> {
        let from = self.contested_by.partition_point(|&(k, _)| k < candidate);
        let own = self.contested_by[from..]
            .iter()
            .take_while(move |&&(k, _)| k == candidate);
        own.map(|&(_, on_edge)| self.contested[on_edge as usize].as_slice())
    }

    /// Whether anything stands in the way of `candidate`.
    fn has_any(&self, candidate: u32) -> bool {
        !self.rivals_of(candidate).is_empty() || self.contested_by(candidate).next().is_some()
    }

    /// What can be said of an undecided `candidate` by the `standing` of all.
    fn decide(&self, candidate: u32, standing: &[Standing]) -> Standing {
        let is_accepted = |&other: &u32| standing[other as usize] == Standing::Accepted;
        let rank = self.ranks[candidate as usize];
        let is_better = |&other: &u32| {
            standing[other as usize] == Standing::Undecided && self.ranks[other as usize] < rank
        };
        let rivals = self.rivals_of(candidate);
        let is_full = |on_edge: &[u32]| {
            on_edge.iter().filter(|other| is_accepted(other)).count() >= TRIANGLES_OF_AN_EDGE
        };
        if rivals.iter().any(is_accepted) || self.contested_by(candidate).any(is_full) {
            return Standing::Rejected;
        }
        let may_be_full = |on_edge: &[u32]| {
            let before = |other: &&u32| is_accepted(other) || is_better(other);
            on_edge.iter().filter(before).count() >= TRIANGLES_OF_AN_EDGE
        };
        match rivals.iter().any(is_better) || self.contested_by(candidate).any(may_be_full) {
            true => Standing::Undecided,
            false => Standing::Accepted,
        }
    }
}

/// The rank of each candidate, the best first.
fn ranks(positions: &[Local], candidates: &[Candidate]) -> Vec<u32> {
    let mut order: Vec<(usize, f64, u32)> = (0..)
        .zip(candidates)
        .map(|(k, candidate)| {
            let radius = circumradius_squared(places(positions, candidate.corners));
            (3 - candidate.votes(), radius, k)
        })
        .collect();
    // Candidates are in the order of their corners, which decides between equals.
    order.par_sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut ranks = vec![0; candidates.len()];
    for (rank, (_, _, k)) in (0..).zip(order) {
        ranks[k as usize] = rank;
    }
    ranks
}

/// What stands in the way of candidates.
#[derive(Default)]
struct Found {
    /// Candidates that lie on top of each other, in both orders.
    pairs: Vec<(u32, u32)>,
    /// The candidates on each edge that has more than two.
    contested: Vec<Vec<u32>>,
}

/// Finds what stands in the way of candidates.
fn find(positions: &[Local], candidates: &[Candidate]) -> Found {
    let incident: Vec<(u32, u32)> = (0..)
        .zip(candidates)
        .flat_map(|(k, candidate)| candidate.corners.map(|corner| (corner, k)))
        .collect();
    let incident = sorted_by_corner(incident, |&(corner, _)| corner);
    let by_corner: Vec<&[(u32, u32)]> = incident.chunk_by(|a, b| a.0 == b.0).collect();
    let found =
        by_corner
            .par_iter()
            .with_min_len(1024)
            .fold(Found::default, |mut found, incident| {
                found.compare(positions, candidates, incident);
                found
            });
    found.reduce(Found::default, |mut found, mut other| {
        found.pairs.append(&mut other.pairs);
        found.contested.append(&mut other.contested);
        found
    })
}

impl Found {
    /// Compares the candidates that are incident to a vertex; each is given with that vertex.
    fn compare(&mut self, positions: &[Local], candidates: &[Candidate], incident: &[(u32, u32)]) {
        let tip = incident[0].0;
        let is_named = |k: u32| candidates[k as usize].is_named_by(tip);
        // The triangles of one star do not overlap at its site, and two at most have a common edge.
        if incident.iter().all(|&(_, k)| is_named(k)) {
            return;
        }
        for (i, &(_, one)) in incident.iter().enumerate() {
            for &(_, other) in &incident[i + 1..] {
                let is_one_star = is_named(one) && is_named(other);
                let [one_corners, other_corners] =
                    [one, other].map(|k| candidates[k as usize].corners);
                if !is_one_star && is_conflict(positions, tip, one_corners, other_corners) {
                    self.pairs.extend([(one, other), (other, one)]);
                }
            }
        }
        let ends = |k: u32| others(candidates[k as usize].corners, tip);
        let mut ways: Vec<(u32, u32)> = incident
            .iter()
            .flat_map(|&(_, k)| ends(k).map(|end| (end, k)))
            .filter(|&(end, _)| tip < end)
            .collect();
        ways.sort_unstable();
        let contested = ways.chunk_by(|a, b| a.0 == b.0);
        let contested = contested.filter(|on_edge| on_edge.len() > TRIANGLES_OF_AN_EDGE);
        self.contested
            .extend(contested.map(|on_edge| on_edge.iter().map(|&(_, k)| k).collect()));
    }
}

/// Whether two triangles with the common corner `tip` lie on top of each other.
fn is_conflict(positions: &[Local], tip: u32, one: Corners, other: Corners) -> bool {
    let place = |corner: u32| positions[corner as usize];
    let (one, other) = (others(one, tip), others(other, tip));
    let common = one.iter().position(|corner| other.contains(corner));
    match common {
        Some(k) => {
            let (edge, first) = (one[k], one[1 - k]);
            let second = if other[0] == edge { other[1] } else { other[0] };
            // In the order of the positions, so that every part of a cloud has the same bits.
            let [from, to] = if tip < edge { [tip, edge] } else { [edge, tip] };
            is_fold(place(from), place(to), place(first), place(second))
        }
        None => is_overlap(place(tip), one.map(place), other.map(place)),
    }
}
