//! The planes halfway between a site and its neighbours, and where they meet on a
//! patch: the corners of its cell.

use super::{Local, Patch, heights::Heights};

/// Two planes meet where both are this near, in squared radii …
const EXACT: f64 = 1e-12;
/// … which is found in so many steps, or not at all.
const MOST_STEPS: usize = 6;

/// A neighbour of the site: its place in the caller's list, and where it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Squared distance from the site.
    pub distance_squared: f64,
    /// The caller's name for it.
    pub index: u32,
    /// Where it is.
    pub position: Local,
}

impl Neighbor {
    /// The site `index` at `position` as a neighbour of `site`.
    pub(crate) fn new(site: Local, index: u32, position: Local) -> Self {
        Self {
            distance_squared: (position - site).norm_squared(),
            index,
            position,
        }
    }

    /// Nearest first, equally near ones in the order of their names.
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
    /// To the neighbour, in the patch's frame.
    pub(super) direction: Local,
    /// Half the squared distance.
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

    /// Positive beyond the plane, for a `place` in the patch's frame, from the site.
    pub(super) fn beyond(&self, place: Local) -> f64 {
        place.dot(&self.direction) - self.half
    }

    /// How [`beyond`](Self::beyond) grows along `u` and `v` on a surface of such
    /// slopes.
    fn slopes_on(&self, [p, q]: [f64; 2]) -> [f64; 2] {
        [
            self.direction.x + p * self.direction.z,
            self.direction.y + q * self.direction.z,
        ]
    }
}

/// Where two planes meet on the surface, by Newton's steps from the site's foot;
/// `None` if that is not found. `radius` (CRS units) is the size of a cell.
pub(super) fn meeting(
    one: &Bisector,
    other: &Bisector,
    surface: &Heights,
    radius: f64,
) -> Option<Local> {
    let tolerance = EXACT * radius * radius;
    let mut place = lift(surface, 0.0, 0.0);
    for _ in 0..MOST_STEPS {
        let beyond = [one.beyond(place), other.beyond(place)];
        if beyond[0].abs().max(beyond[1].abs()) <= tolerance {
            return Some(place);
        }
        let slopes = surface.slopes(place.x, place.y);
        let ([a, b], [c, d]) = (one.slopes_on(slopes), other.slopes_on(slopes));
        let inverse = 1.0 / (a * d - b * c);
        let u = (beyond[0] * d - beyond[1] * b) * inverse;
        let v = (beyond[1] * a - beyond[0] * c) * inverse;
        place = lift(surface, place.x - u, place.y - v);
    }
    None
}

/// The point of the surface over `(u, v)`.
pub(super) fn lift(surface: &Heights, u: f64, v: f64) -> Local {
    Local::new(u, v, surface.at(u, v))
}
