//! Thinning: no voxel keeps more than 64 points.
//!
//! A scanner that stands still heaps up points that add nothing. The points of the highest
//! priority are kept, so that the result does not depend on the order of the points, nor on
//! whether they are thinned at once or part by part.

use std::ops::Range;

use rayon::prelude::*;

use super::points::{Scan, voxel_edge};
use crate::{
    geometry::{OccupiedCells, Quantization, Stored, cell_of},
    lloyd::SolverOptions,
};

/// Largest number of points that a voxel keeps: six hundred to a seed of a plane.
pub(super) const LARGEST_COUNT_IN_VOXEL: usize = 64;

impl Scan {
    /// Keeps at most 64 of the `points` in each voxel (a third of a spacing wide), those of
    /// the highest priority, in no order that may be relied on. Points may be thinned part by
    /// part: the result at the end is the same.
    ///
    /// # Panics
    ///
    /// Unless the spacing is positive, and there are fewer than 2³² points.
    pub(crate) fn thinned(
        points: Vec<Stored>,
        quantization: &Quantization,
        options: &SolverOptions,
    ) -> Vec<Stored> {
        let voxel = voxel_edge(quantization, options);
        let (voxels, order) =
            OccupiedCells::sort(&points, |&point| cell_of(quantization.local(point), voxel));
        if voxels
            .ranges()
            .all(|range| range.len() <= LARGEST_COUNT_IN_VOXEL)
        {
            return points;
        }
        let ranges: Vec<Range<usize>> = voxels.ranges().collect();
        let rank = |point: &Stored| (point.priority(options.seed), *point);
        let kept = |range: Range<usize>| {
            let in_voxel = order[range].iter().map(|&i| points[i as usize]);
            let mut in_voxel: Vec<Stored> = in_voxel.collect();
            if in_voxel.len() > LARGEST_COUNT_IN_VOXEL {
                in_voxel.select_nth_unstable_by_key(LARGEST_COUNT_IN_VOXEL, rank);
                in_voxel.truncate(LARGEST_COUNT_IN_VOXEL);
            }
            in_voxel
        };
        ranges.into_par_iter().flat_map_iter(kept).collect()
    }

    /// The number of points on a square of edge `edge` (CRS units) of a plane beyond which
    /// some of them are not kept.
    pub(crate) fn most_on_square(
        edge: f64,
        quantization: &Quantization,
        options: &SolverOptions,
    ) -> f64 {
        LARGEST_COUNT_IN_VOXEL as f64 * (edge / voxel_edge(quantization, options)).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lloyd::scan::points::tests::cloud;

    #[test]
    fn points_thinned_part_by_part_are_those_thinned_at_once() {
        let quantization = Quantization {
            scale: 0.001,
            offset: [0.0; 3],
        };
        let options = SolverOptions::new(0.9);
        let points = cloud(60_000);
        let sorted = |mut points: Vec<Stored>| {
            points.sort_unstable();
            points
        };
        let at_once = sorted(Scan::thinned(points.clone(), &quantization, &options));
        let mut part_by_part = Vec::new();
        for part in points.rchunks(7_001) {
            part_by_part.extend_from_slice(part);
            part_by_part = Scan::thinned(part_by_part, &quantization, &options);
        }
        assert_eq!(sorted(part_by_part), at_once);

        // The slow twin sorts a list for each voxel by priority, and cuts it.
        let mut in_voxels: std::collections::HashMap<_, Vec<Stored>> =
            std::collections::HashMap::new();
        for point in points {
            let voxel = cell_of(quantization.local(point), 0.3);
            in_voxels.entry(voxel).or_default().push(point);
        }
        let truth = in_voxels.into_values().flat_map(|mut points| {
            points.sort_unstable_by_key(|&p| (p.priority(options.seed), p));
            points.truncate(LARGEST_COUNT_IN_VOXEL);
            points
        });
        assert_eq!(sorted(truth.collect()), at_once);
        assert!(at_once.len() < 20_000);
    }
}
