//! Facets: the planes that a surface consists of near a sharp edge.
//!
//! A quadratic patch rounds an edge. Where it does, the planes that meet there describe the
//! samples better, and a position belongs on the nearest of them:
//!
//! ```text
//!     ─────────────┐        ─ │   facets; each ends where it meets the other
//!     · · · · · ·╲ │        ·     a patch that rounds the edge
//!              x  ╲│        x     a site on the patch, which is moved to the facet above it
//!                 ·│
//! ```

use nalgebra::Matrix3;

use super::{Local, narrow_frame};

/// Most planes that are told apart near a position: those of a corner, or of a step with both levels.
pub(super) const MOST_FACETS: usize = 3;
/// Fewest positions that a plane is fitted to.
const LEAST_SUPPORT: usize = 5;
/// The number of parameters of a plane.
const PARAMETERS: usize = 3;
/// Positions that are less round lie on a line.
const LEAST_ROUNDNESS_SQUARED: f64 = 0.02;
/// Facets whose normals differ less (by the sine of their angle) do not meet near by.
const LEAST_SINE: f64 = 0.3;
/// A position nearer than this to a second facet is on their edge, and as near to it as any other there.
const EDGE_WIDTH_IN_CAPTURES: f64 = 0.01;

/// A plane through `point` with this unit `normal`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Facet {
    pub(super) point: Local,
    pub(super) normal: Local,
}

/// A sharp edge, as it is seen from a position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharpEdge {
    /// The place on it that is nearest to the position.
    pub(crate) place: Local,
    /// The unit vector along it, of either sign.
    pub(crate) direction: Local,
}

/// The planes near an edge or a corner.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Facets {
    /// One to [`MOST_FACETS`] planes.
    pub(super) all: Vec<Facet>,
    /// `sides[i][j]` is the side of facet `j` on which facet `i` lies: 1 towards the normal of `j`, −1 away from it, 0 for
    /// both.
    pub(super) sides: [[f64; MOST_FACETS]; MOST_FACETS],
    /// Positions nearer to an edge than this (CRS units) are moved onto it.
    pub(super) capture: f64,
}

impl Facet {
    /// The distance of `position` from the plane, positive towards the normal (CRS units).
    pub(super) fn height(&self, position: Local) -> f64 {
        self.normal.dot(&(position - self.point))
    }

    /// Whether the plane is nearly parallel to `other`, and within `distance` (CRS units) of it where both are.
    pub(super) fn is_near(&self, other: &Self, distance: f64) -> bool {
        let apart = self.height(other.point).abs();
        let sine = self.normal.cross(&other.normal).norm();
        sine < LEAST_SINE && apart.max(other.height(self.point).abs()) < distance
    }

    /// The plane that fits the `weighted` positions best, and the standard deviation of their distances from it (CRS
    /// units); `None` if they are too few, or lie on a line.
    pub(super) fn fit(weighted: impl Iterator<Item = (Local, f64)>) -> Option<(Self, f64)> {
        let (mut total, mut count) = (0.0, 0);
        let [mut sum_x, mut sum_y, mut sum_z] = [0.0; 3];
        let [mut xx, mut xy, mut xz, mut yy, mut yz, mut zz] = [0.0; 6];
        // Positions of no weight are not skipped: which have some is hard to foresee for the processor.
        for (position, weight) in weighted {
            let [x, y, z]: [f64; 3] = position.into();
            let [x_weighted, y_weighted, z_weighted] = [x, y, z].map(|c| c * weight);
            total += weight;
            count += usize::from(weight > 0.0);
            sum_x += x_weighted;
            sum_y += y_weighted;
            sum_z += z_weighted;
            xx += x_weighted * x;
            xy += x_weighted * y;
            xz += x_weighted * z;
            yy += y_weighted * y;
            yz += y_weighted * z;
            zz += z_weighted * z;
        }
        if count < LEAST_SUPPORT {
            return None;
        }
        let point = Local::new(sum_x, sum_y, sum_z) / total;
        let squares = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        let covariance = squares / total - point * point.transpose();
        let (spread, [_, _, normal]) = narrow_frame(covariance)?;
        let is_round = spread[1] >= LEAST_ROUNDNESS_SQUARED * spread[0];
        // A plane has three parameters, which take a part of the spread.
        let unbiased = count as f64 / (count - PARAMETERS) as f64;
        let deviation = (spread[2].max(0.0) * unbiased).sqrt();
        is_round.then_some((Self { point, normal }, deviation))
    }

    /// The point of the line where the plane meets `other` that is nearest to `position`, which is on the plane; `None`
    /// if they are nearly parallel.
    fn to_edge(self, position: Local, other: &Self) -> Option<Local> {
        let across = other.normal - self.normal * self.normal.dot(&other.normal);
        let squared = across.norm_squared();
        let is_steep = squared >= LEAST_SINE * LEAST_SINE;
        is_steep.then(|| position - across * (other.height(position) / squared))
    }
}

impl Facets {
    /// The foot point of `position` on the nearest facet, or on the edge where the facet ends before it.
    pub(crate) fn foot_point(&self, position: Local) -> Local {
        let own = self.nearest(position);
        let facet = self.all[own];
        let mut foot = position - facet.normal * facet.height(position);
        // The edge with one facet can lie beyond that with another.
        for _ in 1..self.all.len() {
            for (other, plane) in self.all.iter().enumerate() {
                if other != own
                    && let Some(edge) = facet.to_edge(foot, plane)
                {
                    let is_beyond = plane.height(foot) * self.sides[own][other] < 0.0;
                    let is_near = (edge - foot).norm() <= self.capture;
                    if is_beyond || is_near && self.has_edge(own, other) {
                        foot = edge;
                    }
                }
            }
        }
        foot
    }

    /// The edge nearest to `position`, if it is nearer than `reach` (CRS units).
    pub(crate) fn edge_near(mut self, position: Local, reach: f64) -> Option<SharpEdge> {
        self.capture = reach;
        let place = self.place_on_edge(position)?;
        if (place - position).norm() >= reach {
            return None;
        }
        let height = |facet: &Facet| facet.height(place).abs();
        self.all
            .sort_by(|one, other| height(one).total_cmp(&height(other)));
        let [one, other, ..] = self.all.as_slice() else {
            return None;
        };
        let direction = one.normal.cross(&other.normal).try_normalize(LEAST_SINE)?;
        Some(SharpEdge { place, direction })
    }

    /// Lets the site at `position` go onto an edge within `reach` (CRS units), unless one of the `others` that can do so, too,
    /// comes first, with a place less than `gap` (CRS units) away: one that is nearer to the edge does. Returns whether the site
    /// goes there.
    pub(crate) fn claim_edge(
        &mut self,
        position: Local,
        mut others: impl Iterator<Item = Local>,
        reach: f64,
        gap: f64,
    ) -> bool {
        self.capture = reach;
        let claims = self.place_on_edge(position).is_some_and(|place| {
            let own = self.rank(position, place);
            let comes_first = |other: Local| {
                self.place_on_edge(other).is_some_and(|other_place| {
                    (other_place - place).norm() < gap && self.rank(other, other_place) < own
                })
            };
            !others.any(comes_first)
        });
        if !claims {
            self.capture = 0.0;
        }
        claims
    }

    /// The place on an edge onto which a site at `position` is moved, if it is near enough to one.
    fn place_on_edge(&self, position: Local) -> Option<Local> {
        let foot = self.foot_point(position);
        self.normal(foot).is_none().then_some(foot)
    }

    /// What decides between two sites that claim an edge: how far the one at `position` is from its `place` there (CRS units), and
    /// where it is if both are on it.
    fn rank(&self, position: Local, place: Local) -> (f64, [f64; 3]) {
        let distance = (position - place).norm();
        let is_on_edge = distance <= EDGE_WIDTH_IN_CAPTURES * self.capture;
        let left = if is_on_edge { 0.0 } else { distance };
        (left, position.into())
    }

    /// The unit normal, of either sign, of the facet on which `position` lies; `None` if that is an edge.
    pub(crate) fn normal(&self, position: Local) -> Option<Local> {
        let own = self.nearest(position);
        let width = EDGE_WIDTH_IN_CAPTURES * self.capture;
        let mut others = self.all.iter().enumerate();
        let is_on_edge =
            others.any(|(other, facet)| other != own && facet.height(position).abs() <= width);
        (!is_on_edge).then_some(self.all[own].normal)
    }

    /// Whether two facets both end where they meet.
    fn has_edge(&self, one: usize, other: usize) -> bool {
        self.sides[one][other] != 0.0 && self.sides[other][one] != 0.0
    }

    /// The index of the facet nearest to `position`.
    fn nearest(&self, position: Local) -> usize {
        let height = |&index: &usize| self.all[index].height(position).abs();
        (0..self.all.len())
            .min_by(|a, b| height(a).total_cmp(&height(b)))
            .expect("there is at least one facet")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The faces of a step that looks up and towards x: `z = 0` for `x < 0`, and `x = 0` for `z < 0`.
    fn step(capture: f64) -> Facets {
        let mut sides = [[0.0; MOST_FACETS]; MOST_FACETS];
        (sides[0][1], sides[1][0]) = (-1.0, -1.0);
        Facets {
            all: vec![plane(Local::z()), plane(Local::x())],
            sides,
            capture,
        }
    }

    /// The plane through the origin with this `normal`.
    fn plane(normal: Local) -> Facet {
        Facet {
            point: Local::zeros(),
            normal,
        }
    }

    #[test]
    fn a_position_goes_to_the_nearest_face_and_not_beyond_its_end() {
        let foot = |x, z| step(0.0).foot_point(Local::new(x, 7.0, z));
        assert_eq!(foot(-0.3, -0.1), Local::new(-0.3, 7.0, 0.0));
        assert_eq!(foot(-0.1, -0.3), Local::new(0.0, 7.0, -0.3));
        assert_eq!(foot(0.2, 0.1), Local::new(0.0, 7.0, 0.0));
    }

    #[test]
    fn positions_near_an_edge_go_onto_it_where_that_is_wanted() {
        let foot = |x| step(0.2).foot_point(Local::new(x, 7.0, 0.05));
        assert_eq!(foot(-0.15), Local::new(0.0, 7.0, 0.0));
        assert_eq!(foot(-0.25), Local::new(-0.25, 7.0, 0.0));
        assert!(step(0.2).normal(Local::new(0.0, 7.0, 0.0)).is_none());
        assert_eq!(
            step(0.2).normal(Local::new(-0.1, 7.0, 0.0)),
            Some(Local::z())
        );
    }

    #[test]
    fn an_edge_is_seen_from_near_it() {
        let edge = |x, z| step(0.0).edge_near(Local::new(x, 7.0, z), 0.5);
        let from_above = edge(-0.3, 0.1).unwrap();
        assert_eq!(from_above.place, Local::new(0.0, 7.0, 0.0));
        assert_eq!(from_above.direction.map(f64::abs), Local::y());
        assert!(edge(-0.6, 0.0).is_none());
        // Beyond the end of a face it is as far as it is.
        assert!(edge(0.3, 0.45).is_none());
    }

    #[test]
    fn of_sites_that_claim_one_place_on_an_edge_the_nearest_goes() {
        let claims = |own: Local, others: &[Local]| {
            let mut facets = step(0.0);
            let claims = facets.claim_edge(own, others.iter().copied(), 0.6, 0.75);
            // Two thirds of the reach away from the edge a site goes there if it may.
            let foot = facets.foot_point(Local::new(-0.4, 7.0, 0.0));
            assert_eq!(foot.x, if claims { 0.0 } else { -0.4 });
            claims
        };
        let at = |x, y, z| Local::new(x, y, z);
        let own = at(-0.4, 7.0, 0.0);
        assert!(claims(own, &[]));
        // Too far from the edge.
        assert!(!claims(at(-0.7, 7.0, 0.0), &[]));
        // Beside an occupied place, and between two that leave room.
        assert!(!claims(own, &[at(0.0, 7.7, 0.0)]));
        assert!(claims(own, &[at(0.0, 7.8, 0.0), at(0.0, 6.2, 0.0)]));
        // On the other face, nearer to the edge and farther from it.
        assert!(!claims(own, &[at(0.0, 7.1, -0.3)]));
        assert!(claims(own, &[at(0.0, 7.1, -0.5)]));
        // Of two on the edge one stays, whatever the rounding.
        let [one, other] = [at(1e-16, 7.0, 0.0), at(0.0, 7.5, 0.0)];
        assert!(claims(one, &[other]) != claims(other, &[one]));
    }

    #[test]
    fn a_position_beyond_two_edges_goes_to_the_corner() {
        let mut facets = step(0.0);
        facets.all.push(plane(Local::y()));
        for (one, other) in [(0, 2), (2, 0), (1, 2), (2, 1)] {
            facets.sides[one][other] = -1.0;
        }
        let corner = facets.foot_point(Local::new(0.3, 0.2, 0.1));
        assert_eq!(corner, Local::zeros());
        let on_top = facets.foot_point(Local::new(-0.3, -0.2, 0.1));
        assert_eq!(on_top, Local::new(-0.3, -0.2, 0.0));
    }

    #[test]
    fn a_face_that_goes_on_behind_another_has_no_edge() {
        let mut facets = step(0.2);
        facets.sides[0][1] = 0.0;
        let position = Local::new(0.1, 0.0, 0.05);
        assert_eq!(facets.foot_point(position), Local::new(0.1, 0.0, 0.0));
    }

    #[test]
    fn nearly_parallel_faces_meet_nowhere() {
        let mut facets = step(0.2);
        facets.all[1].normal = Local::new(0.1, 0.0, 1.0).normalize();
        let position = Local::new(0.3, 0.0, 0.001);
        assert!((facets.foot_point(position) - position).norm() < 0.05);
    }
}
