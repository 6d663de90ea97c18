//! The shape of a triangle, and how it lies beside another one.

use super::Corners;
use crate::geometry::Local;

/// The cosine of the smallest angle at which two triangles meet in an edge: at a smaller one they lie on top of
/// each other. 60°.
const COSINE_OF_LEAST_OPENING: f64 = 0.5;
/// The cosine of the largest angle between the planes of two triangles that can overlap. 60°.
const COSINE_OF_COMMON_PLANE: f64 = 0.5;

/// The vector that is normal to a triangle, twice as long as its area is large; counter-clockwise
/// corners are seen from its tip.
#[inline]
pub(super) fn doubled_area([a, b, c]: [Local; 3]) -> Local {
    (b - a).cross(&(c - a))
}

/// The square of the radius of the circle through the corners; infinite if they lie on a line.
pub(super) fn circumradius_squared([a, b, c]: [Local; 3]) -> f64 {
    let sides = (b - a).norm_squared() * (c - b).norm_squared() * (a - c).norm_squared();
    let height = doubled_area([a, b, c]).norm_squared();
    match height > 0.0 {
        true => sides / (4.0 * height),
        false => f64::INFINITY,
    }
}

/// The cosine of the angle at `tip` between the ways to `one` and to `other`.
pub(super) fn angle_cosine(tip: Local, one: Local, other: Local) -> f64 {
    let (one, other) = (one - tip, other - tip);
    one.dot(&other) / (one.norm() * other.norm())
}

/// The cosine of the smallest angle of a triangle.
pub(super) fn least_angle_cosine([a, b, c]: [Local; 3]) -> f64 {
    let cosines = [(a, b, c), (b, c, a), (c, a, b)];
    let [first, second, third] = cosines.map(|(tip, one, other)| angle_cosine(tip, one, other));
    first.max(second).max(third)
}

/// The cosine of the angle at which the triangles from the edge `from`–`to` to `one` and to `other` meet: −1 in
/// a plane, 1 if they lie on top of each other; NaN if one has no area.
pub(super) fn opening_cosine(from: Local, to: Local, one: Local, other: Local) -> f64 {
    let edge = to - from;
    let length = edge.norm_squared();
    let away = |corner: Local| {
        let way = corner - from;
        way - edge * (edge.dot(&way) / length)
    };
    let (one, other) = (away(one), away(other));
    one.dot(&other) / (one.norm() * other.norm())
}

/// Whether the triangles from the edge `from`–`to` to `one` and to `other` lie on top of each other.
pub(super) fn is_fold(from: Local, to: Local, one: Local, other: Local) -> bool {
    let cosine = opening_cosine(from, to, one, other);
    // A triangle without area folds.
    cosine > COSINE_OF_LEAST_OPENING || cosine.is_nan()
}

/// Whether two triangles with the common corner `tip` and no common edge overlap beside it; the other
/// corners of each are given.
pub(super) fn is_overlap(tip: Local, one: [Local; 2], other: [Local; 2]) -> bool {
    let [one, other] = [one, other].map(|corners| corners.map(|corner| corner - tip));
    let normal = |[from, to]: [Local; 2]| from.cross(&to);
    let (first, second) = (normal(one), normal(other));
    let cosine = first.dot(&second);
    let scale = first.norm() * second.norm();
    if cosine.abs() < COSINE_OF_COMMON_PLANE * scale {
        return false;
    }
    // Both counter-clockwise about their common normal.
    let (other, second) = match cosine < 0.0 {
        true => ([other[1], other[0]], -second),
        false => (other, second),
    };
    let normal = first * second.norm() + second * first.norm();
    let is_left = |from: Local, to: Local| from.cross(&to).dot(&normal) > 0.0;
    let has_inside = |[from, to]: [Local; 2], way: Local| is_left(from, way) && is_left(way, to);
    let middle = |[from, to]: [Local; 2]| from * to.norm() + to * from.norm();
    let others = [other[0], other[1], middle(other)];
    let ones = [one[0], one[1], middle(one)];
    others.into_iter().any(|way| has_inside(one, way))
        || ones.into_iter().any(|way| has_inside(other, way))
}

/// The positions of the corners of a triangle.
#[inline]
pub(super) fn places(positions: &[Local], corners: Corners) -> [Local; 3] {
    corners.map(|corner| positions[corner as usize])
}

/// The corners of a triangle other than `tip`.
#[inline]
pub(super) fn others([a, b, c]: Corners, tip: u32) -> [u32; 2] {
    match tip {
        tip if tip == a => [b, c],
        tip if tip == b => [c, a],
        _ => [a, b],
    }
}

/// The three edges of a triangle, each with its smaller corner first, and the corner opposite.
#[inline]
pub(super) fn edges([a, b, c]: Corners) -> [([u32; 2], u32); 3] {
    [([a, b], c), ([b, c], a), ([c, a], b)].map(|([from, to], tip)| match from < to {
        true => ([from, to], tip),
        false => ([to, from], tip),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: f64, y: f64) -> Local {
        Local::new(x, y, 0.0)
    }

    #[test]
    fn the_circle_through_a_right_triangle_has_half_its_longest_side() {
        let corners = [at(0.0, 0.0), at(3.0, 0.0), at(0.0, 4.0)];
        assert!((circumradius_squared(corners) - 6.25).abs() < 1e-12);
        let line = [at(0.0, 0.0), at(1.0, 0.0), at(2.0, 0.0)];
        assert!(circumradius_squared(line).is_infinite());
    }

    #[test]
    fn triangles_on_the_same_side_of_an_edge_fold() {
        let (from, to) = (at(0.0, 0.0), at(1.0, 0.0));
        assert!(is_fold(from, to, at(0.3, 1.0), at(0.7, 0.5)));
        assert!(!is_fold(from, to, at(0.3, 1.0), at(0.7, -0.5)));
        assert!(!is_fold(from, to, at(0.3, 1.0), Local::new(0.5, 0.0, 1.0)));
        assert!(is_fold(from, to, at(0.3, 1.0), at(2.0, 0.0)), "no area");
    }

    #[test]
    fn triangles_around_a_corner_overlap_or_do_not() {
        let tip = at(0.0, 0.0);
        let right = [at(1.0, -0.3), at(1.0, 0.3)];
        assert!(is_overlap(tip, right, [at(1.0, 0.0), at(0.0, 1.0)]));
        assert!(is_overlap(tip, right, [at(0.0, 1.0), at(1.0, 0.0)]));
        assert!(
            is_overlap(tip, right, [at(1.0, -0.1), at(1.0, 0.1)]),
            "inside"
        );
        assert!(!is_overlap(tip, right, [at(0.0, 1.0), at(-1.0, 0.0)]));
        let upright = [at(1.0, 0.0), Local::new(1.0, 0.0, 1.0)];
        assert!(!is_overlap(tip, right, upright), "in another plane");
    }

    #[test]
    fn edges_have_their_smaller_corner_first() {
        assert_eq!(edges([4, 7, 9]), [([4, 7], 9), ([7, 9], 4), ([4, 9], 7)]);
        assert_eq!(others([4, 7, 9], 7), [9, 4]);
    }
}
