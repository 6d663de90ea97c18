//! The election of a subset of points that is evenly spaced: no two of its points are nearer to each other than a radius,
//! and every other point is nearer than that to one of them.
//!
//! Of the points that may still be elected, the next is always one with the fewest others within the radius, which it
//! excludes. So the elected points stand close together: on a hexagonal lattice with edges *h* a radius between *h* and
//! √3 *h* elects nearly one point in three, where an election in random order elects one in four. (The greedy choice by
//! least degree: Halldórsson and Radhakrishnan, *Greed is good: approximating independent sets in sparse and bounded-degree
//! graphs*, 1997.) Ties are broken by the hash of the position, then by the position.
//!
//! The plane is cut into squares of 32 radii, anchored at the origin of the stored coordinates. They have four colours:
//!
//! ```text
//!   2 3 2 3
//!   0 1 0 1     squares of one colour are elected independently of each other; a point of a later colour
//!   2 3 2 3     is excluded by those of earlier ones, and counts undecided points of any colour
//!   0 1 0 1
//! ```
//!
//! So the outcome follows from the set of positions: it does not matter which squares are in memory together. A part of
//! the plane is elected alone, with the squares around it on which its own depend:
//!
//! ```text
//!   0 1  0 1  0 1 0     in brackets a part of one block: its square of colour 3 depends on those of colour 2
//!   . . [2 3] 2 . .     that touch it, these on those of colour 1 that touch them, these on those of
//!   0 1 [0 1] 0 1 0     colour 0
//! ```

use std::{
    cmp::Reverse,
    collections::BinaryHeap,
    ops::Range,
    sync::atomic::{AtomicU8, AtomicU32, Ordering::Relaxed},
};

use rayon::prelude::*;

use crate::geometry::{Local, NeighborGrid, Rect, Stored};

/// The edge of a square of one colour in radii. With 16 the elected points of a street are 1 % fewer, because points of
/// different phases meet at the sides; with 64 they are not more.
const SQUARE_IN_RADII: f64 = 32.0;
/// The number of points whose neighbours are searched for together.
const POINTS_PER_PART: usize = 4096;

/// The squares of each colour on which a part depends, in squares beyond its own: west, east and north. To the south there
/// are none, because parts begin with squares of colours 0 and 1.
const AROUND_BY_COLOR: [[i64; 3]; 4] = [[2, 3, 1], [1, 2, 1], [0, 1, 0], [0, 0, 0]];

/// The bytes that an election takes for each point in memory: its position twice, in integers and in the cells of a grid,
/// some ten neighbours, its state, and its place in the queue.
pub(super) const ELECTION_BYTES_PER_POINT: usize = 200;

/// An election with one radius.
#[derive(Clone, Copy, Debug)]
pub(super) struct Election {
    /// The least distance of two elected points (stored units).
    radius: f64,
}

/// What is known of a point.
const UNDECIDED: u8 = 0;
const ELECTED: u8 = 1;
const EXCLUDED: u8 = 2;

impl Election {
    /// An election with this `radius` (stored units), at least 1.
    pub(super) fn new(radius: f64) -> Self {
        Self {
            radius: radius.max(1.0),
        }
    }

    /// The edge of a square (stored units).
    fn square(&self) -> i64 {
        (SQUARE_IN_RADII * self.radius).ceil() as i64
    }

    /// The edge of a block of four squares (stored units), of which parts consist.
    pub(super) fn block(&self) -> i64 {
        2 * self.square()
    }

    /// The rectangle of the points that decide on those in `part`: they lie in squares on which it depends, or count there.
    pub(super) fn around(&self, part: &Rect) -> Rect {
        let squares = self.squares_around(part, 0);
        // Points within a radius count, and points within another one exclude these.
        squares.grown((2.0 * self.radius).ceil() as i64 + 1)
    }

    /// The squares of this `color` on which `part` depends, as a rectangle.
    fn squares_around(&self, part: &Rect, color: u8) -> Rect {
        let [west, east, north] = AROUND_BY_COLOR[usize::from(color)].map(|n| n * self.square());
        Rect {
            min: [part.min[0] - west, part.min[1]],
            max: [part.max[0] + east, part.max[1] + north],
        }
    }

    /// Elects points in `part`, which consists of blocks. The `candidates` are all points [`around`](Self::around) it, in any
    /// order; of several at one position there is one. Returns the elected points in ascending order.
    pub(super) fn elect(&self, candidates: Vec<Stored>, part: &Rect) -> Vec<Stored> {
        let Some(undecided) = self.undecided(candidates) else {
            return Vec::new();
        };
        let neighbors = undecided.neighbors(self.radius);
        for color in 0..4 {
            let around = self.squares_around(part, color);
            let squares = undecided.squares.par_iter();
            squares
                .filter(|square| square.color() == color && square.lies_in(&around, self.square()))
                .for_each(|square| undecided.elect_in(square, &neighbors));
        }
        let mut elected = undecided.elected();
        elected.retain(|&point| part.contains(point));
        elected.par_sort_unstable();
        elected
    }

    /// The `candidates` in squares; `None` if there are none.
    fn undecided(&self, candidates: Vec<Stored>) -> Option<Undecided> {
        let origin = *candidates.first()?;
        let mut points = candidates;
        let edge = self.square();
        // The order within a square is that in which ties are broken.
        points.par_sort_unstable_by_key(|p| (index_of(*p, edge), p.tie_break_hash(), *p));
        points.dedup();
        let mut squares: Vec<Square> = Vec::new();
        for (number, point) in (0..).zip(&points) {
            let index = index_of(*point, edge);
            match squares.last_mut() {
                Some(last) if last.index == index => last.points.end = number + 1,
                _ => squares.push(Square {
                    index,
                    points: number..number + 1,
                }),
            }
        }
        Some(Undecided {
            origin,
            states: points.iter().map(|_| AtomicU8::new(UNDECIDED)).collect(),
            degrees: points.iter().map(|_| AtomicU32::new(0)).collect(),
            points,
            squares,
        })
    }
}

/// A square of the plane with points.
struct Square {
    /// The row and the column.
    index: [i64; 2],
    /// The numbers of its points.
    points: Range<u32>,
}

impl Square {
    fn color(&self) -> u8 {
        let [row, column] = self.index.map(|c| c.rem_euclid(2) as u8);
        2 * row + column
    }

    /// Whether the square, of this `edge`, lies in `rect`.
    fn lies_in(&self, rect: &Rect, edge: i64) -> bool {
        let [row, column] = self.index;
        rect.covers(&Rect {
            min: [column * edge, row * edge],
            max: [(column + 1) * edge, (row + 1) * edge],
        })
    }
}

/// The row and the column of the square, of this `edge`, that contains `point`.
fn index_of(point: Stored, edge: i64) -> [i64; 2] {
    [point.y, point.x].map(|c| i64::from(c).div_euclid(edge))
}

/// Points of which some are to be elected.
///
/// Squares of one colour are elected in parallel. They are farther from each other than their points see, so that states
/// and degrees are read and changed on behalf of one square at a time: the order of the threads does not show.
struct Undecided {
    /// The position from which local coordinates are counted.
    origin: Stored,
    /// The points by square, those of a square in the order in which ties are broken.
    points: Vec<Stored>,
    squares: Vec<Square>,
    states: Vec<AtomicU8>,
    /// The number of undecided neighbours of each point of the squares that are being elected.
    degrees: Vec<AtomicU32>,
}

/// The numbers of the neighbours of each point, part by part.
struct Neighbors {
    parts: Vec<(Vec<u32>, Vec<u32>)>,
}

impl Neighbors {
    fn of(&self, point: u32) -> &[u32] {
        let (ends, numbers) = &self.parts[point as usize / POINTS_PER_PART];
        let within = point as usize % POINTS_PER_PART;
        let start = within.checked_sub(1).map_or(0, |before| ends[before]);
        &numbers[start as usize..ends[within] as usize]
    }
}

impl Undecided {
    /// The points nearer to each point than `radius`.
    fn neighbors(&self, radius: f64) -> Neighbors {
        let locals: Vec<Local> = (self.points.par_iter())
            .map(|&p| local(p, self.origin))
            .collect();
        let grid = NeighborGrid::new(&locals, radius);
        let parts = locals.par_chunks(POINTS_PER_PART).enumerate();
        let parts = parts.map(|(part, locals)| {
            let (mut ends, mut numbers) = (Vec::with_capacity(locals.len()), Vec::new());
            for (within, &center) in locals.iter().enumerate() {
                let own = (part * POINTS_PER_PART + within) as u32;
                grid.visit_around(center, radius, |number, point| {
                    if number != own && (point - center).norm_squared() < radius * radius {
                        numbers.push(number);
                    }
                });
                ends.push(numbers.len() as u32);
            }
            (ends, numbers)
        });
        Neighbors {
            parts: parts.collect(),
        }
    }

    fn is_undecided(&self, point: u32) -> bool {
        self.states[point as usize].load(Relaxed) == UNDECIDED
    }

    /// Elects points of `square` until none is undecided.
    fn elect_in(&self, square: &Square, neighbors: &Neighbors) {
        // Of equal degrees the least number comes first: it is that of the least hash.
        let mut queue: BinaryHeap<Reverse<(u32, u32)>> = square
            .points
            .clone()
            .filter(|&point| self.is_undecided(point))
            .map(|point| {
                let undecided = neighbors.of(point).iter();
                let degree = undecided.filter(|&&other| self.is_undecided(other)).count();
                self.degrees[point as usize].store(degree as u32, Relaxed);
                Reverse((degree as u32, point))
            })
            .collect();
        let mut changed = Vec::new();
        while let Some(Reverse((degree, point))) = queue.pop() {
            // Entries whose degree has changed since are outdated; there is a later one.
            let is_outdated = self.degrees[point as usize].load(Relaxed) != degree;
            if is_outdated || !self.is_undecided(point) {
                continue;
            }
            self.states[point as usize].store(ELECTED, Relaxed);
            for &excluded in neighbors.of(point) {
                if !self.is_undecided(excluded) {
                    continue;
                }
                self.states[excluded as usize].store(EXCLUDED, Relaxed);
                for &other in neighbors.of(excluded) {
                    if square.points.contains(&other) && self.is_undecided(other) {
                        self.degrees[other as usize].fetch_sub(1, Relaxed);
                        changed.push(other);
                    }
                }
            }
            changed.sort_unstable();
            changed.dedup();
            for other in changed.drain(..) {
                if self.is_undecided(other) {
                    let degree = self.degrees[other as usize].load(Relaxed);
                    queue.push(Reverse((degree, other)));
                }
            }
        }
    }

    fn elected(self) -> Vec<Stored> {
        let decided = self.points.into_iter().zip(self.states);
        decided
            .filter(|(_, state)| state.load(Relaxed) == ELECTED)
            .map(|(point, _)| point)
            .collect()
    }
}

/// The coordinates of `point` from `origin`, in stored units: whole numbers, so that distances are exact.
pub(super) fn local(point: Stored, origin: Stored) -> Local {
    let difference = |a: i32, b: i32| (i64::from(a) - i64::from(b)) as f64;
    Local::new(
        difference(point.x, origin.x),
        difference(point.y, origin.y),
        difference(point.z, origin.z),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// A wavy sheet around the origin, with a post on it.
    fn cloud(n: u64) -> Vec<Stored> {
        let c = |i: u64, k: u64| (spread(3 * i + k) % 6000) as i32 - 2500;
        (0..n)
            .map(|i| match i % 10 {
                0 => Stored {
                    x: 100 + c(i, 0) / 100,
                    y: -300 + c(i, 1) / 100,
                    z: c(i, 2) + 2500,
                },
                _ => Stored {
                    x: c(i, 0),
                    y: c(i, 1),
                    z: c(i, 0) / 10 + c(i, 2) / 200,
                },
            })
            .collect()
    }

    fn is_within(a: Stored, b: Stored, radius: f64) -> bool {
        let difference = local(a, b);
        difference.norm_squared() < radius * radius
    }

    /// The slow twin counts all undecided points anew for every election.
    fn slow(points: &[Stored], radius: f64) -> Vec<Stored> {
        let edge = Election::new(radius).square();
        let mut squares: Vec<[i64; 2]> = points.iter().map(|&p| index_of(p, edge)).collect();
        squares.sort_unstable_by_key(|c| (c.map(|c| c.rem_euclid(2)), *c));
        squares.dedup();
        assert!(squares.len() > 8, "{}", squares.len());
        let (mut left, mut elected) = (points.to_vec(), Vec::new());
        for square in squares {
            loop {
                let degree = |p: Stored| left.iter().filter(|q| is_within(p, **q, radius)).count();
                let own = left.iter().filter(|p| index_of(**p, edge) == square);
                let next = own.min_by_key(|p| (degree(**p), p.tie_break_hash(), **p));
                let Some(&next) = next else { break };
                elected.push(next);
                left.retain(|&p| !is_within(p, next, radius));
            }
        }
        elected.sort_unstable();
        elected
    }

    #[test]
    fn an_election_is_that_of_its_slow_twin() {
        let points = cloud(2000);
        let elected = Election::new(90.0).elect(points.clone(), &Rect::EVERYWHERE);
        assert!(elected.len() > 500, "{}", elected.len());
        assert_eq!(elected, slow(&points, 90.0));
    }

    #[test]
    fn parts_are_elected_alone_as_they_are_together() {
        let (points, election) = (cloud(6000), Election::new(25.0));
        let block = election.block();
        let together = election.elect(points.clone(), &Rect::EVERYWHERE);
        let (mut alone, mut parts) = (Vec::new(), 0);
        for column in -2..=3 {
            for row in -2..=3 {
                let part = Rect {
                    min: [column * block, row * block],
                    max: [(column + 1) * block, (row + 1) * block],
                };
                let around = election.around(&part);
                let seen = points.iter().filter(|&&p| around.contains(p));
                let elected = election.elect(seen.copied().collect(), &part);
                parts += usize::from(!elected.is_empty());
                alone.extend(elected);
            }
        }
        alone.sort_unstable();
        assert!(parts > 8, "{parts}");
        assert_eq!(alone, together);
    }
}
