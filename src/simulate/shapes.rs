//! The shapes that a street is built of: where a ray meets them, and their distance from a
//! point. Lengths are metres.

use crate::geometry::Local;

/// A surface with exact intersections and distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Shape {
    /// A rectangle: a corner and two perpendicular edges.
    Rectangle {
        /// The corner.
        corner: Local,
        /// The two edges from the corner.
        edges: [Local; 2],
    },
    /// The mantle of a cylinder between two points.
    Cylinder {
        /// The ends of the axis.
        ends: [Local; 2],
        /// The radius.
        radius: f64,
    },
    /// An ellipsoid with axes along the coordinates. Distances from it are exact if it is a
    /// sphere, and of first order otherwise.
    Ellipsoid {
        /// The centre.
        center: Local,
        /// The half axes.
        axes: Local,
    },
}

/// The range (m) below which hits belong to the housing of the scanner.
const SMALLEST_RANGE: f64 = 0.3;

impl Shape {
    /// Returns the least distance along the ray at which it meets the shape, and the unit normal
    /// there.
    pub(super) fn hit(&self, origin: Local, direction: Local) -> Option<(f64, Local)> {
        match *self {
            Self::Rectangle { corner, edges } => {
                let normal = edges[0].cross(&edges[1]).normalize();
                let t = normal.dot(&(corner - origin)) / normal.dot(&direction);
                let at = origin + direction * t - corner;
                let inside = edges
                    .iter()
                    .all(|edge| (0.0..=edge.norm_squared()).contains(&at.dot(edge)));
                (inside && t > SMALLEST_RANGE && t.is_finite()).then_some((t, normal))
            }
            Self::Cylinder { ends, radius } => {
                let axis = ends[1] - ends[0];
                let length = axis.norm();
                let axis = axis / length;
                let across = |v: Local| v - axis * axis.dot(&v);
                let (d, o) = (across(direction), across(origin - ends[0]));
                roots(
                    d.norm_squared(),
                    d.dot(&o),
                    o.norm_squared() - radius * radius,
                )
                .into_iter()
                .flatten()
                .find_map(|t| {
                    let at = origin + direction * t - ends[0];
                    let along = axis.dot(&at);
                    ((0.0..=length).contains(&along) && t > SMALLEST_RANGE)
                        .then(|| (t, across(at) / radius))
                })
            }
            Self::Ellipsoid { center, axes } => {
                let d = direction.component_div(&axes);
                let o = (origin - center).component_div(&axes);
                roots(d.norm_squared(), d.dot(&o), o.norm_squared() - 1.0)
                    .into_iter()
                    .flatten()
                    .find(|&t| t > SMALLEST_RANGE)
                    .map(|t| {
                        let normal = (o + d * t).component_div(&axes);
                        (t, normal.normalize())
                    })
            }
        }
    }

    /// Returns the distance from `point` to the shape.
    pub(super) fn distance(&self, point: Local) -> f64 {
        match *self {
            Self::Rectangle { corner, edges } => {
                let from = point - corner;
                let nearest = edges.iter().fold(corner, |sum, edge| {
                    sum + edge * (from.dot(edge) / edge.norm_squared()).clamp(0.0, 1.0)
                });
                (point - nearest).norm()
            }
            Self::Cylinder { ends, radius } => {
                let axis = ends[1] - ends[0];
                let from = point - ends[0];
                let along = from.dot(&axis) / axis.norm_squared();
                let nearest = along.clamp(0.0, 1.0);
                let across = (from - axis * along).norm() - radius;
                across.hypot((along - nearest) * axis.norm())
            }
            Self::Ellipsoid { center, axes } => {
                let from = point - center;
                let scaled = from.component_div(&axes);
                let size = scaled.norm();
                if size < 1e-9 {
                    return axes.min();
                }
                // The implicit function over the length of its gradient.
                let gradient = scaled.component_div(&axes) / size;
                (size - 1.0).abs() / gradient.norm()
            }
        }
    }

    /// Returns the least and the greatest corner of the bounding box.
    pub(super) fn bounds(&self) -> (Local, Local) {
        let around = |points: &[Local], margin: f64| {
            let nothing = (
                Local::repeat(f64::INFINITY),
                Local::repeat(f64::NEG_INFINITY),
            );
            let (low, high) = points
                .iter()
                .fold(nothing, |(l, h), p| (l.inf(p), h.sup(p)));
            (low.add_scalar(-margin), high.add_scalar(margin))
        };
        match *self {
            Self::Rectangle { corner, edges } => {
                let [a, b] = edges;
                around(&[corner, corner + a, corner + b, corner + a + b], 0.0)
            }
            Self::Cylinder { ends, radius } => around(&ends, radius),
            Self::Ellipsoid { center, axes } => (center - axes, center + axes),
        }
    }
}

/// Returns the roots of a t² + 2 b t + c, the smaller first.
fn roots(a: f64, b: f64, c: f64) -> [Option<f64>; 2] {
    let discriminant = b * b - a * c;
    // Written so that NaN has no roots.
    if !(discriminant >= 0.0 && a > 0.0) {
        return [None; 2];
    }
    let root = discriminant.sqrt();
    [Some((-b - root) / a), Some((-b + root) / a)]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> [Shape; 3] {
        [
            Shape::Rectangle {
                corner: Local::new(3.0, -2.0, -1.0),
                edges: [Local::new(0.0, 4.0, 0.0), Local::new(0.5, 0.0, 3.0)],
            },
            Shape::Cylinder {
                ends: [Local::new(4.0, 0.0, -3.0), Local::new(4.5, 0.2, 3.0)],
                radius: 0.4,
            },
            Shape::Ellipsoid {
                center: Local::new(4.0, 0.5, 0.0),
                axes: Local::repeat(1.2),
            },
        ]
    }

    #[test]
    fn where_a_ray_meets_a_shape_the_distance_is_zero() {
        for shape in shapes() {
            let mut hits = 0;
            for i in -20..=20 {
                for j in -20..=20 {
                    let to = Local::new(4.0, 0.08 * f64::from(i), 0.08 * f64::from(j));
                    let direction = to.normalize();
                    if let Some((t, normal)) = shape.hit(Local::zeros(), direction) {
                        hits += 1;
                        assert!(shape.distance(direction * t) < 1e-9);
                        assert!((normal.norm() - 1.0).abs() < 1e-9);
                        let (low, high) = shape.bounds();
                        let at = direction * t;
                        assert!((0..3).all(|k| low[k] - 1e-9 <= at[k] && at[k] <= high[k] + 1e-9));
                    }
                }
            }
            assert!(hits > 50, "{shape:?}");
        }
    }

    #[test]
    fn the_distance_to_a_sphere_is_known() {
        let sphere = shapes()[2];
        for (x, truth) in [(0.0, 2.8), (4.0, 1.2), (9.0, 3.8)] {
            assert!((sphere.distance(Local::new(x, 0.5, 0.0)) - truth).abs() < 1e-12);
        }
    }
}
