//! The nearest of many points, however far away.
//!
//! A k-d tree (J. L. Bentley, *Multidimensional Binary Search Trees*, 1975). Where the distance is bounded by a
//! few spacings [`NeighborGrid`](super::NeighborGrid) is as fast to ask and twice as fast to build. Where it is
//! not, a grid searches all the empty cells between: of 5 M points of a street and 100 K positions, one in a
//! hundred of them up to 70 m away, it took 27 µs a query, and the tree 4 µs.
//!
//! Of equally near points the first in the input is the nearest, whatever the shape of
//! the tree. Coincident points would cost the tree its balance, so it is built of the first point at each
//! position.

use std::num::NonZero;

use kiddo::{ImmutableKdTree, SquaredEuclidean};

use super::{Local, by_position};

/// Widens a ball by more than two ways of rounding a squared distance differ by.
const ROUNDING: f64 = 1.0 + 1e-12;

/// A search tree for the nearest of many points. It takes some 30 bytes to a point beside the points
/// themselves, twice that while it is built.
#[derive(Debug)]
pub(crate) struct NearestPoints<'a> {
    points: &'a [Local],
    /// For each point of the tree its index in `points`, ascending.
    indices: Vec<u32>,
    tree: ImmutableKdTree<f64, 3>,
}

impl<'a> NearestPoints<'a> {
    /// A tree of `points`, built in O(n log n).
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
        let order = |&a: &u32, &b: &u32| by_position(&points[a as usize], &points[b as usize]);
        let mut indices: Vec<u32> = (0..count).collect();
        indices.sort_unstable_by(|a, b| order(a, b).then(a.cmp(b)));
        indices.dedup_by(|a, b| order(a, b).is_eq());
        indices.sort_unstable();
        let positions: Vec<[f64; 3]> = indices.iter().map(|&i| points[i as usize].into()).collect();
        Self {
            points,
            tree: ImmutableKdTree::new_from_slice(&positions).expect("their number is a u32"),
            indices,
        }
    }

    /// The index of the point nearest to `position` and the squared distance to it; `None` if there are no
    /// points. Of equally near points the first in the input.
    ///
    /// # Panics
    ///
    /// Unless `position` is finite.
    pub(crate) fn nearest(&self, position: Local) -> Option<(u32, f64)> {
        self.nearest_from(position, 1)
    }

    /// The index of the nearest point that is not at `position` itself and the squared distance to it; `None`
    /// if there is no such point. Of equally near points the first in the input.
    ///
    /// # Panics
    ///
    /// Unless `position` is finite.
    pub(crate) fn nearest_elsewhere(&self, position: Local) -> Option<(u32, f64)> {
        self.nearest_from(position, 2)
    }

    /// The nearest point if `neighbors` is 1; the nearest that is not at `position` if it is 2, because one point
    /// of the tree at most is there.
    fn nearest_from(&self, position: Local, neighbors: usize) -> Option<(u32, f64)> {
        assert!(
            position.iter().all(|c| c.is_finite()),
            "{position} is not finite"
        );
        let entry = |item: u32| {
            let index = self.indices[item as usize];
            let squared = (self.points[index as usize] - position).norm_squared();
            (index, squared)
        };
        let is_wanted = |&(_, squared): &(u32, f64)| neighbors == 1 || squared > 0.0;
        let count = NonZero::new(neighbors)?;
        let query = self.tree.query(position.as_ref());
        let found = query.nearest_n::<SquaredEuclidean<f64>>(count).execute();
        let (_, limit) = found.iter().map(|n| entry(n.item)).find(is_wanted)?;
        // All points that are as near: the tree found any one of them.
        let query = self.tree.query(position.as_ref());
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

    /// The slow twin examines every point.
    fn by_brute_force(points: &[Local], position: Local, elsewhere: bool) -> Option<(u32, f64)> {
        (0..)
            .zip(points)
            .map(|(index, p)| (index, (p - position).norm_squared()))
            .filter(|&(_, squared)| !elsewhere || squared > 0.0)
            .min_by(|a: &(u32, f64), b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)))
    }

    fn whole(k: u64, most: u64) -> f64 {
        (spread(k) % most) as f64
    }

    /// Whole coordinates: ties and coincident points abound. Extents of one are points in
    /// a plane, on a line, and at one position.
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
                for position in [cloud[i as usize], between(i), beside(i)] {
                    assert_eq!(
                        tree.nearest(position),
                        by_brute_force(&cloud, position, false)
                    );
                    let elsewhere = by_brute_force(&cloud, position, true);
                    assert_eq!(tree.nearest_elsewhere(position), elsewhere);
                }
            }
        }
    }

    #[test]
    fn a_million_points_at_one_position_are_no_burden() {
        let points = vec![Local::new(1.0, 2.0, 3.0); 1_000_000];
        let tree = NearestPoints::new(&points);
        for i in 0..10_000 {
            let position = Local::new(f64::from(i), 2.0, 3.0);
            let squared = (f64::from(i) - 1.0).powi(2);
            assert_eq!(tree.nearest(position), Some((0, squared)));
        }
        assert_eq!(tree.nearest_elsewhere(points[0]), None);
    }

    #[test]
    fn without_points_none_is_nearest() {
        assert_eq!(NearestPoints::new(&[]).nearest(Local::zeros()), None);
    }

    #[test]
    #[should_panic(expected = "not finite")]
    fn what_is_not_a_number_is_refused() {
        NearestPoints::new(&[Local::new(0.0, f64::NAN, 0.0)]);
    }
}
