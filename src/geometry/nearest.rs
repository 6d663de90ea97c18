//! The nearest of many points, however far away.
//!
//! A k-d tree (J. L. Bentley, Multidimensional Binary Search Trees, 1975). Where the
//! distance is bounded by a few spacings [`NeighborGrid`](super::NeighborGrid) is as
//! fast to ask and twice as fast to build. Where it is not, a grid looks through all the
//! empty cells between: of 5 M points of a street and 100 K places, one in a hundred of
//! them up to 70 m away, it took 27 µs for a place, and the tree 4 µs.
//!
//! Of equally near points the first in the input is the nearest, whatever the shape of
//! the tree. Coincident points would cost the tree its balance: it is built of the first
//! point at each place.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::Local;

/// Widens a ball by more than two ways of rounding a squared distance differ by.
const ROUNDING: f64 = 1.0 + 1e-12;

/// Points, to be asked for the nearest to a place. Some 30 bytes to a point beside the
/// points themselves, twice that while it is built.
#[derive(Debug)]
pub(crate) struct NearestPoints<'a> {
    points: &'a [Local],
    /// For each point of the tree its index in `points`, ascending.
    indices: Vec<u32>,
    tree: ImmutableKdTree<f64, 3>,
}

impl<'a> NearestPoints<'a> {
    /// A tree of `points`. Time goes with n log n.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points, all of them finite.
    pub(crate) fn new(points: &'a [Local]) -> Self {
        let count = u32::try_from(points.len()).expect("there are under 2^32 points");
        assert!(
            points.iter().all(|p| p.iter().all(|c| c.is_finite())),
            "a coordinate is not finite"
        );
        let by_place = |&a: &u32, &b: &u32| {
            let (p, q) = (points[a as usize], points[b as usize]);
            let by_axis = |axis: usize| p[axis].partial_cmp(&q[axis]).expect("both are finite");
            by_axis(0).then_with(|| by_axis(1)).then_with(|| by_axis(2))
        };
        let mut indices: Vec<u32> = (0..count).collect();
        indices.sort_unstable_by(|a, b| by_place(a, b).then(a.cmp(b)));
        indices.dedup_by(|a, b| by_place(a, b).is_eq());
        indices.sort_unstable();
        let places: Vec<[f64; 3]> = indices.iter().map(|&i| points[i as usize].into()).collect();
        Self {
            points,
            tree: ImmutableKdTree::new_from_slice(&places).expect("their number is a u32"),
            indices,
        }
    }

    /// The index of the point nearest to `place` and the squared distance to it; `None`
    /// if there are no points. Of equally near ones the first in the input.
    ///
    /// # Panics
    ///
    /// Unless `place` is finite.
    pub(crate) fn nearest(&self, place: Local) -> Option<(u32, f64)> {
        self.nearest_from(place, 1)
    }

    /// The same of the points that are not at `place` itself.
    ///
    /// # Panics
    ///
    /// As [`nearest`](Self::nearest).
    #[allow(dead_code, reason = "measure is to use it")]
    pub(crate) fn nearest_elsewhere(&self, place: Local) -> Option<(u32, f64)> {
        self.nearest_from(place, 2)
    }

    /// The nearest point, if `neighbors` is 1, or the nearest that is not at `place`, if it
    /// is 2: one point of the tree at the most is.
    fn nearest_from(&self, place: Local, neighbors: usize) -> Option<(u32, f64)> {
        assert!(place.iter().all(|c| c.is_finite()), "{place} is not finite");
        let entry = |item: u32| {
            let index = self.indices[item as usize];
            let squared = (self.points[index as usize] - place).norm_squared();
            (index, squared)
        };
        let is_wanted = |&(_, squared): &(u32, f64)| neighbors == 1 || squared > 0.0;
        let count = NonZero::new(neighbors)?;
        let query = self.tree.query(place.as_ref());
        let found = query.nearest_n::<SquaredEuclidean<f64>>(count).execute();
        let (_, limit) = found.iter().map(|n| entry(n.item)).find(is_wanted)?;
        // All that are as near, of which the tree found any.
        let query = self.tree.query(place.as_ref());
        let ball = query.within::<SquaredEuclidean<f64>>(limit * ROUNDING);
        let as_near = ball.unsorted().execute();
        as_near
            .iter()
            .map(|n| entry(n.item))
            .filter(is_wanted)
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// The twin: every point looked at.
    fn by_brute_force(points: &[Local], place: Local, elsewhere: bool) -> Option<(u32, f64)> {
        (0..)
            .zip(points)
            .map(|(index, p)| (index, (p - place).norm_squared()))
            .filter(|&(_, squared)| !elsewhere || squared > 0.0)
            .min_by(|a: &(u32, f64), b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
    }

    fn whole(k: u64, most: u64) -> f64 {
        (spread(k) % most) as f64
    }

    /// Whole coordinates: ties and coincident points abound. Extents of one are points in
    /// a plane, on a line, and at one place.
    #[test]
    fn the_nearest_point_matches_brute_force() {
        for extent in [[12, 12, 12], [40, 40, 1], [300, 1, 1], [1, 1, 1]] {
            let cloud: Vec<Local> = (0..1500)
                .map(|i| Local::from([0, 1, 2].map(|k| whole(3 * i + k, extent[k as usize]))))
                .collect();
            let tree = NearestPoints::new(&cloud);
            let beside =
                |i: u64| Local::from([5, 6, 7].map(|k| 0.5 * whole(9 * i + k, 900) - 200.0));
            let between = |i: u64| cloud[i as usize] + Local::repeat(0.5);
            for i in 0..200 {
                for place in [cloud[i as usize], between(i), beside(i)] {
                    assert_eq!(tree.nearest(place), by_brute_force(&cloud, place, false));
                    let elsewhere = by_brute_force(&cloud, place, true);
                    assert_eq!(tree.nearest_elsewhere(place), elsewhere);
                }
            }
        }
    }

    #[test]
    fn a_million_points_at_one_place_are_no_burden() {
        let points = vec![Local::new(1.0, 2.0, 3.0); 1_000_000];
        let tree = NearestPoints::new(&points);
        for i in 0..10_000 {
            let place = Local::new(f64::from(i), 2.0, 3.0);
            let squared = (f64::from(i) - 1.0).powi(2);
            assert_eq!(tree.nearest(place), Some((0, squared)));
        }
        assert_eq!(tree.nearest_elsewhere(points[0]), None);
    }

    #[test]
    fn of_no_points_none_is_nearest() {
        assert_eq!(NearestPoints::new(&[]).nearest(Local::zeros()), None);
    }

    #[test]
    #[should_panic(expected = "not finite")]
    fn what_is_not_a_number_is_refused() {
        NearestPoints::new(&[Local::new(0.0, f64::NAN, 0.0)]);
    }
}
