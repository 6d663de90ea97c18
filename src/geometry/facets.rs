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

/// Fewest positions that a plane is fitted to.
const LEAST_SUPPORT: usize = 5;
/// Positions that are less round lie on a line.
const LEAST_ROUNDNESS_SQUARED: f64 = 0.02;
/// Facets whose normals differ less (by the sine of their angle) do not meet near by.
const LEAST_SINE: f64 = 0.3;
/// A position nearer than this to both facets is on their edge.
const EDGE_WIDTH_IN_CAPTURES: f64 = 0.01;

/// A plane through `point` with this unit `normal`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Facet {
    pub(super) point: Local,
    pub(super) normal: Local,
}

/// A second facet, and how both end.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Second {
    pub(super) facet: Facet,
    /// The side of the second facet on which the first lies: 1 towards the normal, −1 away from it, 0 for both.
    pub(super) side_of_first: f64,
    /// The side of the first facet on which the second lies.
    pub(super) side_of_second: f64,
}

/// The planes near an edge, one or two of them.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Facets {
    pub(super) first: Facet,
    pub(super) second: Option<Second>,
    /// Positions nearer to the edge than this (CRS units) are moved onto it.
    pub(super) capture: f64,
}

impl Facet {
    /// The distance of `position` from the plane, positive towards the normal (CRS units).
    pub(super) fn height(&self, position: Local) -> f64 {
        self.normal.dot(&(position - self.point))
    }

    /// The plane that fits the `weighted` positions best; `None` if they are too few, lie on a
    /// line, or are on average farther from it than `largest_residual` (CRS units).
    pub(super) fn fit(
        weighted: impl Iterator<Item = (Local, f64)>,
        largest_residual: f64,
    ) -> Option<Self> {
        let (mut total, mut count) = (0.0, 0);
        let (mut sum, mut squares) = (Local::zeros(), Matrix3::zeros());
        for (position, weight) in weighted.filter(|&(_, weight)| weight > 0.0) {
            let scaled = position * weight;
            total += weight;
            count += 1;
            sum += scaled;
            squares += scaled * position.transpose();
        }
        if count < LEAST_SUPPORT {
            return None;
        }
        let point = sum / total;
        let covariance = squares / total - point * point.transpose();
        let (spread, [_, _, normal]) = narrow_frame(covariance)?;
        let is_round = spread[1] >= LEAST_ROUNDNESS_SQUARED * spread[0];
        let is_plane = spread[2] <= largest_residual * largest_residual;
        (is_round && is_plane).then_some(Self { point, normal })
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
        let (facet, other) = self.nearest(position);
        let foot = position - facet.normal * facet.height(position);
        let Some((other, side)) = other else {
            return foot;
        };
        let edge = facet.to_edge(foot, &other).filter(|edge| {
            let is_beyond = other.height(foot) * side < 0.0;
            is_beyond || self.has_edge() && (edge - foot).norm() <= self.capture
        });
        edge.unwrap_or(foot)
    }

    /// The unit normal, of either sign, of the facet on which `position` lies; `None` if that is the edge.
    pub(crate) fn normal(&self, position: Local) -> Option<Local> {
        let (facet, other) = self.nearest(position);
        let is_on_edge = other.is_some_and(|(other, _)| {
            other.height(position).abs() <= EDGE_WIDTH_IN_CAPTURES * self.capture
        });
        (!is_on_edge).then_some(facet.normal)
    }

    /// Whether both facets end where they meet.
    fn has_edge(&self) -> bool {
        let ends = |second: &Second| second.side_of_first != 0.0 && second.side_of_second != 0.0;
        self.second.as_ref().is_some_and(ends)
    }

    /// The facet nearest to `position`, and the other with the side of it on which the nearest lies.
    fn nearest(&self, position: Local) -> (Facet, Option<(Facet, f64)>) {
        let first = self.first;
        match self.second {
            None => (first, None),
            Some(second) => {
                let heights = [first, second.facet].map(|facet| facet.height(position).abs());
                match heights[0] <= heights[1] {
                    true => (first, Some((second.facet, second.side_of_first))),
                    false => (second.facet, Some((first, second.side_of_second))),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The faces of a step that looks up and towards x: `z = 0` for `x < 0`, and `x = 0` for `z < 0`.
    fn step(capture: f64) -> Facets {
        let facet = |normal| Facet {
            point: Local::zeros(),
            normal,
        };
        Facets {
            first: facet(Local::z()),
            second: Some(Second {
                facet: facet(Local::x()),
                side_of_first: -1.0,
                side_of_second: -1.0,
            }),
            capture,
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
    fn a_face_that_goes_on_behind_another_has_no_edge() {
        let mut facets = step(0.2);
        if let Some(second) = &mut facets.second {
            second.side_of_first = 0.0;
        }
        let position = Local::new(0.1, 0.0, 0.05);
        assert_eq!(facets.foot_point(position), Local::new(0.1, 0.0, 0.0));
    }

    #[test]
    fn nearly_parallel_faces_meet_nowhere() {
        let mut facets = step(0.2);
        if let Some(second) = &mut facets.second {
            second.facet.normal = Local::new(0.1, 0.0, 1.0).normalize();
        }
        let position = Local::new(0.3, 0.0, 0.001);
        assert!((facets.foot_point(position) - position).norm() < 0.05);
    }
}
