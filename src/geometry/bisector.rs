//! The planes halfway between a site and its neighbours, and where they meet on a
//! patch: the corners of its cell.

use super::{Local, Patch, heights::Heights};

/// Two planes meet where the position is this near to both, in squared radii of the cell.
const MEETING_TOLERANCE: f64 = 1e-12;
/// Largest number of Newton steps to where two planes meet.
const MAX_STEPS: usize = 6;

/// A neighbour of a site.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Squared distance from the site.
    pub distance_squared: f64,
    /// The index by which the caller knows the neighbour.
    pub index: u32,
    /// The position of the neighbour (local coordinates).
    pub position: Local,
}

impl Neighbor {
    /// The site `index` at `position` as a neighbour of `site`.
    #[inline]
    pub(crate) fn new(site: Local, index: u32, position: Local) -> Self {
        Self {
            distance_squared: (position - site).norm_squared(),
            index,
            position,
        }
    }

    /// Sorts by distance, nearest first; equally near neighbours are in the order of their
    /// indices.
    pub(crate) fn sort(neighbors: &mut [Self]) {
        neighbors.sort_unstable_by(|a, b| {
            a.distance_squared
                .total_cmp(&b.distance_squared)
                .then(a.index.cmp(&b.index))
        });
    }
}

/// The plane halfway to a neighbour.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Bisector {
    /// The way to the neighbour in the patch's frame (CRS units).
    pub(super) direction: Local,
    /// Half the squared distance to the neighbour.
    half: f64,
}

impl Bisector {
    pub(super) fn new(patch: &Patch, site: Local, neighbor: &Neighbor) -> Self {
        let towards = neighbor.position - site;
        Self {
            direction: Local::from(patch.axes.map(|axis| axis.dot(&towards))),
            half: 0.5 * neighbor.distance_squared,
        }
    }

    /// A measure that is positive beyond the plane, for a `position` in the patch's frame, seen
    /// from the site.
    #[inline]
    pub(super) fn beyond(&self, position: Local) -> f64 {
        position.dot(&self.direction) - self.half
    }

    /// The position on the surface over the straight way between `ends`, one on either side of the plane and `beyond` it by that
    /// much, where the way crosses the plane.
    #[inline]
    pub(super) fn crossing(
        &self,
        [here, there]: [Local; 2],
        beyond: [f64; 2],
        surface: &Heights,
    ) -> Local {
        let way = there - here;
        // Over a straight way the patch is a parabola, and so is the distance from the plane, with one root between the ends.
        let quadratic = surface.quadratic_term(way.x, way.y) * self.direction.z;
        let half = 0.5 * (beyond[1] - beyond[0] - quadratic);
        let root = (half * half - quadratic * beyond[0]).max(0.0).sqrt();
        let sum = -(half + root.copysign(half));
        let [one, other] = [beyond[0] / sum, sum / quadratic];
        let share = match (0.0..=1.0).contains(&one) {
            true => one,
            false => other.clamp(0.0, 1.0),
        };
        lift(surface, here.x + way.x * share, here.y + way.y * share)
    }

    /// The derivatives of [`beyond`](Self::beyond) along `u` and `v` on a surface of the given
    /// slopes.
    #[inline]
    fn slopes_on(&self, [p, q]: [f64; 2]) -> [f64; 2] {
        [
            self.direction.x + p * self.direction.z,
            self.direction.y + q * self.direction.z,
        ]
    }
}

/// The position on the surface where two planes meet, by Newton's steps from the site's foot;
/// `None` if they do not converge. `radius` (CRS units) is the size of a cell.
#[inline]
pub(super) fn meeting(
    one: &Bisector,
    other: &Bisector,
    surface: &Heights,
    radius: f64,
) -> Option<Local> {
    let tolerance = MEETING_TOLERANCE * radius * radius;
    let mut position = lift(surface, 0.0, 0.0);
    for _ in 0..MAX_STEPS {
        let beyond = [one.beyond(position), other.beyond(position)];
        if beyond[0].abs().max(beyond[1].abs()) <= tolerance {
            return Some(position);
        }
        let slopes = surface.slopes(position.x, position.y);
        let ([a, b], [c, d]) = (one.slopes_on(slopes), other.slopes_on(slopes));
        let inverse = 1.0 / (a * d - b * c);
        let u = (beyond[0] * d - beyond[1] * b) * inverse;
        let v = (beyond[1] * a - beyond[0] * c) * inverse;
        position = lift(surface, position.x - u, position.y - v);
    }
    None
}

/// The point of the surface over `(u, v)`.
#[inline]
pub(super) fn lift(surface: &Heights, u: f64, v: f64) -> Local {
    Local::new(u, v, surface.at(u, v))
}
