//! Thinning: a voxel keeps a few points, and the sum of the others.
//!
//! Of a scan that is dense at the scale of the output an output point can use some tens of points;
//! the others add nothing but precision to the mean of their voxel. So a voxel keeps the points of
//! the highest priority, for seeds to be elected from and attributes to be taken from, and the
//! others become a sum:
//!
//! ```text
//!   ┌───────────┐        ┌───────────┐
//!   │ · ·· · ·· │        │ ·      ·  │
//!   │· ··· ·· · │   ─►   │     Σ     │     · kept    Σ count and sum of the others
//!   │ ·· · ·· · │        │  ·      · │
//!   └───────────┘        └───────────┘
//! ```
//!
//! What is kept depends on the points alone: points may be thinned in any order, at once or part by
//! part, while they are decoded or when a tile is read.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::{
    thinned::{PointSum, PointTag, ThinnedPoints},
    voxel::voxel_edge,
    voxel_points::{MOST_IN_VOXEL, PointsByIndex, VoxelPoints},
};
use crate::{
    geometry::{CellIndex, CellOrder, Local, OccupiedCells, Quantization, Rect, Stored, cell_of},
    lloyd::SolverOptions,
};

/// The rule by which points are thinned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Thinning {
    quantization: Quantization,
    /// Edge of a voxel (CRS units).
    voxel: f64,
    /// Seed of the priorities.
    seed: u64,
}

impl Thinning {
    /// The thinning of scans that are solved by `options`.
    ///
    /// # Panics
    ///
    /// Unless the spacing is positive.
    pub(crate) fn new(quantization: &Quantization, options: &SolverOptions) -> Self {
        Self {
            quantization: *quantization,
            voxel: voxel_edge(quantization, options),
            seed: options.seed,
        }
    }

    /// The voxel of `point`.
    #[inline]
    pub(crate) fn voxel_of(&self, point: Stored) -> CellIndex {
        cell_of(self.quantization.local(point), self.voxel)
    }

    /// The priority of `point` among those of its voxel: the lowest is kept first.
    #[inline]
    pub(crate) fn priority(&self, point: Stored) -> u64 {
        point.priority(self.seed)
    }

    /// The double voxel of `point`, two voxels wide on each axis. Which ones are occupied does not depend
    /// on whether the points have been thinned, since every occupied voxel keeps a point.
    #[inline]
    pub(crate) fn double_voxel_of(&self, point: Stored) -> CellIndex {
        self.voxel_of(point).map(|c| c.div_euclid(2))
    }

    /// The middle of the double voxel `cell`.
    pub(crate) fn middle_of_double_voxel(&self, cell: CellIndex) -> Local {
        Local::from(cell.map(|c| (2.0 * f64::from(c) + 1.0) * self.voxel))
    }

    /// `rect` with each side moved back to where the double voxel that it cuts begins, so that it contains voxels as wholes: what it
    /// keeps is the same, whether points have been thinned before or not. Rectangles that share a side still do.
    pub(crate) fn of_whole_voxels(&self, rect: &Rect) -> Rect {
        let Rect { min, max } = *rect;
        let [min, max] = [min, max].map(|corner| corner.map(|side| self.beginning(side)));
        Rect { min, max }
    }

    /// The first coordinate of the double voxel that `coordinate` is in (stored units).
    fn beginning(&self, coordinate: i64) -> i64 {
        let along = |coordinate: i64| {
            let x = i32::try_from(coordinate).ok()?;
            Some(self.double_voxel_of(Stored { x, y: 0, z: 0 })[0])
        };
        // Where nothing can be stored there are no voxels.
        let own = along(coordinate);
        let width = (2.0 * self.voxel / self.quantization.scale).ceil() as i64;
        let (mut before, mut first) = (coordinate - width - 1, coordinate);
        while own.is_some() && first - before > 1 {
            let middle = before + (first - before) / 2;
            match along(middle) == own {
                true => first = middle,
                false => before = middle,
            }
        }
        first
    }

    /// The number of points on a square of edge `edge` (CRS units) of a plane beyond which
    /// some of them are not kept.
    pub(crate) fn most_on_square(&self, edge: f64) -> f64 {
        MOST_IN_VOXEL as f64 * (edge / self.voxel).powi(2)
    }

    /// Thins `points`, in no order that may be relied on.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points and sums.
    pub(crate) fn thinned(&self, points: ThinnedPoints) -> ThinnedPoints {
        let equal = |_, _| Ordering::Equal;
        let (kept, sums) = self.thin(&points.kept, &points.tags, &points.sums, equal);
        let tags = match points.tags.is_empty() {
            true => Vec::new(),
            false => kept
                .iter()
                .map(|&index| points.tags[index as usize])
                .collect(),
        };
        let kept = kept.iter().map(|&index| points.kept[index as usize]);
        ThinnedPoints {
            kept: kept.collect(),
            sums,
            tags,
        }
    }

    /// The indices of those `points` that are kept, voxel by voxel, and the sums of all others,
    /// `sums` included, one to a voxel. Of equal points in a voxel with too many the one that
    /// `order` puts first is kept; points with different `tags`, which may be empty, are not equal.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points and sums.
    pub(crate) fn thin(
        &self,
        points: &[Stored],
        tags: &[PointTag],
        sums: &[PointSum],
        order: impl Fn(u32, u32) -> Ordering,
    ) -> (Vec<u32>, Vec<PointSum>) {
        let first_sum = points.len();
        let means = sums.iter().map(PointSum::mean);
        let items = points.iter().copied().chain(means);
        let voxels: Vec<CellIndex> = items.map(|point| self.voxel_of(point)).collect();
        let (mut kept, mut others) = (Vec::new(), Vec::new());
        let by_index = Tagged {
            points,
            tags,
            order,
        };
        for in_voxel in CellOrder::new(&voxels).cells() {
            let count = in_voxel.partition_point(|&index| (index as usize) < first_sum);
            let (of_points, of_sums) = in_voxel.split_at(count);
            if of_sums.is_empty() && count <= MOST_IN_VOXEL {
                kept.extend_from_slice(of_points);
                continue;
            }
            let mut voxel = VoxelPoints::crowded();
            for &index in of_points {
                let point = points[index as usize];
                voxel.add(point, self.priority(point), index, &by_index, |_| {});
            }
            kept.extend_from_slice(voxel.kept());
            let mut other = voxel.others(|index| points[index as usize]);
            for &index in of_sums {
                other.merge(&sums[index as usize - first_sum]);
            }
            if other.count > 0 {
                others.push(other);
            }
        }
        (kept, others)
    }
}

/// Points with tags, which may be empty.
struct Tagged<'a, Order> {
    points: &'a [Stored],
    tags: &'a [PointTag],
    /// The order of points that are equal.
    order: Order,
}

impl<Order: Fn(u32, u32) -> Ordering> PointsByIndex for Tagged<'_, Order> {
    type Identity = (Stored, Option<(u32, u16, bool)>);

    fn identity(&self, index: u32) -> Self::Identity {
        let tag = self.tags.get(index as usize).map(PointTag::rank);
        (self.points[index as usize], tag)
    }

    fn order(&self, a: u32, b: u32) -> Ordering {
        (self.order)(a, b)
    }
}

/// Keeps at most `most` of the `points` of each of `voxels`, by which they are sorted, and sorts
/// them in their voxel. `totals` are the sums of all points of the voxels, those included that
/// were thinned before.
pub(super) fn keep_first(
    voxels: &mut OccupiedCells,
    points: &mut Vec<Stored>,
    totals: &[PointSum],
    most: usize,
    seed: u64,
) {
    if totals.iter().all(|total| total.count <= most as u64) {
        return;
    }
    let by_voxel = voxels.split(points).into_par_iter().zip(totals);
    let counts: Vec<u32> = by_voxel
        .map(|(points, total)| match total.count > most as u64 {
            true => keep_first_of_voxel(points, seed) as u32,
            false => points.len() as u32,
        })
        .collect();
    let mut end = 0;
    for (range, &count) in voxels.ranges().zip(&counts) {
        points.copy_within(range.start..range.start + count as usize, end);
        end += count as usize;
    }
    points.truncate(end);
    points.shrink_to_fit();
    voxels.set_counts(&counts);
}

/// Brings those `points` of a voxel that are kept to the front, and sorts them. Gives their number.
fn keep_first_of_voxel(points: &mut [Stored], seed: u64) -> usize {
    let by_index = Tagged {
        points: &*points,
        tags: &[],
        order: |_, _| Ordering::Equal,
    };
    let mut voxel = VoxelPoints::crowded();
    for (&point, index) in by_index.points.iter().zip(0..) {
        voxel.add(point, point.priority(seed), index, &by_index, |_| {});
    }
    let mut first = [Stored { x: 0, y: 0, z: 0 }; MOST_IN_VOXEL];
    let count = voxel.kept().len();
    for (first, &index) in first.iter_mut().zip(voxel.kept()) {
        *first = points[index as usize];
    }
    first[..count].sort_unstable();
    points[..count].copy_from_slice(&first[..count]);
    count
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use super::*;
    use crate::lloyd::scan::points::tests::cloud;

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    fn sorted(mut points: ThinnedPoints) -> ThinnedPoints {
        points.kept.sort_unstable();
        points.sums.sort_unstable();
        points
    }

    /// A cloud with crowded voxels, and with equal points.
    fn crowded() -> Vec<Stored> {
        let mut points = cloud(60_000);
        points.extend_from_within(..9_000);
        points.extend_from_within(..3_000);
        points
    }

    #[test]
    fn a_rectangle_of_whole_voxels_keeps_the_same_of_thinned_points() {
        let thinning = Thinning::new(&QUANTIZATION, &SolverOptions::new(0.4));
        let thinned = thinning.thinned(crowded().into());
        let voxel = |x: i64| {
            thinning.double_voxel_of(Stored {
                x: x as i32,
                y: 0,
                z: 0,
            })[0]
        };
        for k in -40..40 {
            let rect = Rect {
                min: [97 * k, -1_500],
                max: [97 * k + 1_234, 97 * k + 61],
            };
            let whole = thinning.of_whole_voxels(&rect);
            for (side, moved) in [(rect.min[0], whole.min[0]), (rect.max[0], whole.max[0])] {
                assert!(moved <= side && voxel(moved) == voxel(side));
                assert!(voxel(moved - 1) < voxel(moved));
            }
            let mut own = ThinnedPoints::from(crowded());
            own.kept.retain(|&point| whole.contains(point));
            let mut expected = thinned.clone();
            expected.kept.retain(|&point| whole.contains(point));
            expected.sums.retain(|sum| whole.contains(sum.mean()));
            let [own, expected] = [thinning.thinned(own), expected].map(sorted);
            assert_eq!(own.kept, expected.kept);
            assert_eq!(own.sums, expected.sums);
        }
        // Beyond what can be stored nothing moves.
        let everything = Rect {
            min: [i64::from(i32::MIN) - 5; 2],
            max: [i64::from(i32::MAX) + 5; 2],
        };
        assert_eq!(thinning.of_whole_voxels(&everything), everything);
    }

    #[test]
    fn points_thinned_part_by_part_are_those_thinned_at_once() {
        let thinning = Thinning::new(&QUANTIZATION, &SolverOptions::new(0.4));
        let at_once = sorted(thinning.thinned(crowded().into()));
        let mut part_by_part = ThinnedPoints::default();
        for part in crowded().rchunks(7_001) {
            part_by_part.kept.extend_from_slice(part);
            part_by_part = thinning.thinned(part_by_part);
        }
        let mut apart = ThinnedPoints::default();
        for part in crowded().chunks(11_003) {
            apart.append(thinning.thinned(part.to_vec().into()));
        }
        for other in [part_by_part, thinning.thinned(apart)] {
            let other = sorted(other);
            assert_eq!(other.kept, at_once.kept);
            assert_eq!(other.sums, at_once.sums);
        }
        assert!(at_once.kept.len() < 20_000 && at_once.sums.len() > 300);
    }

    /// The slow twin sorts a list for each voxel by priority, and cuts it.
    #[test]
    fn a_voxel_keeps_its_first_points_and_the_sum_of_the_others() {
        let options = SolverOptions::new(0.4);
        let thinning = Thinning::new(&QUANTIZATION, &options);
        let thinned = sorted(thinning.thinned(crowded().into()));
        let mut in_voxels: BTreeMap<CellIndex, Vec<Stored>> = BTreeMap::new();
        for point in crowded() {
            in_voxels
                .entry(thinning.voxel_of(point))
                .or_default()
                .push(point);
        }
        let mut truth = ThinnedPoints::default();
        for points in in_voxels.into_values() {
            if points.len() <= MOST_IN_VOXEL {
                truth.kept.extend(points);
                continue;
            }
            let distinct: BTreeSet<_> = points
                .iter()
                .map(|&point| (point.priority(options.seed), point))
                .collect();
            let first: Vec<Stored> = distinct
                .into_iter()
                .map(|(_, p)| p)
                .take(MOST_IN_VOXEL)
                .collect();
            let mut others = points;
            for point in &first {
                let at = others.iter().position(|other| other == point).unwrap();
                others.swap_remove(at);
            }
            let mut sum = PointSum::default();
            others.into_iter().for_each(|point| sum.add(point));
            truth.sums.extend((sum.count > 0).then_some(sum));
            truth.kept.extend(first);
        }
        let truth = sorted(truth);
        assert_eq!(thinned.kept, truth.kept);
        assert_eq!(thinned.sums, truth.sums);
    }

    #[test]
    fn of_equal_points_the_first_by_the_order_is_kept() {
        let point = Stored { x: 5, y: 6, z: 7 };
        let thinning = Thinning::new(&QUANTIZATION, &SolverOptions::new(0.4));
        let (kept, sums) = thinning.thin(&[point; 9], &[], &[], |a, b| b.cmp(&a));
        assert_eq!(kept, [8]);
        assert_eq!(
            sums,
            [PointSum {
                count: 8,
                sum: [40, 48, 56]
            }]
        );
    }
}
