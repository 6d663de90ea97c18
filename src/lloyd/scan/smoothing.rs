//! Noise is smoothed away before anything else, if the option `smooth` is set.
//!
//! Every point is moved onto the patch of its neighbourhood, of the radius of the noise (paper,
//! section V-D): a site is then elected on the surface, and not in the noise around it. In a
//! second pass the patches are fitted to the points that the first has moved near the surface.

use rayon::prelude::*;

use super::{
    thinned::{PointSum, PointTag, ThinnedPoints},
    thinning::Thinning,
};
use crate::{
    geometry::{Local, NeighborGrid, OccupiedCells, Patch, Quantization, Stored, cell_of},
    lloyd::SolverOptions,
};

/// Cells to a radius: patches are fitted to the means of cells, some forty to a patch.
const CELLS_PER_RADIUS: f64 = 4.0;

/// The smallest detail of a surface, in radii: a patch with a residual that is too large for it
/// stands for no surface.
const SURFACE_DETAIL_IN_RADII: f64 = 1.6;

/// Number of times that points are moved onto patches.
const PASSES: u32 = 2;

/// Moves `points` onto the surface that they are noisy samples of, by patches of the radius
/// `smooth` of `options`. Points without a surface stay.
pub(super) fn smoothed(
    points: ThinnedPoints,
    quantization: &Quantization,
    options: &SolverOptions,
) -> ThinnedPoints {
    let mut points = Thinning::new(quantization, options).thinned(points);
    for _ in 0..PASSES {
        points = on_patches(points, quantization, options);
    }
    points
}

/// Moves every point to its foot point on the patch of its cell, if that patch describes a
/// surface. A sum of points moves as their mean does.
fn on_patches(
    points: ThinnedPoints,
    quantization: &Quantization,
    options: &SolverOptions,
) -> ThinnedPoints {
    let edge = options.smooth / CELLS_PER_RADIUS;
    let has_tags = !points.tags.is_empty();
    let means = points.sums.iter().map(|sum| (sum.mean(), sum.count, None));
    let kept = points.kept.iter().enumerate();
    let kept = kept.map(|(index, &p)| (p, 1, points.tags.get(index).copied()));
    let mut items: Vec<(Stored, u64, Option<PointTag>)> = kept.collect();
    items.extend(means);
    // Items are sorted within a cell, too: sums of floats must not depend on the order of files.
    items.par_sort_unstable_by_key(|&(p, count, tag)| (p, count, tag.map(|tag| tag.rank())));
    let (cells, order) =
        OccupiedCells::sort(&items, |&(p, ..)| cell_of(quantization.local(p), edge));
    let ranges: Vec<_> = cells.ranges().collect();
    let means: Vec<Local> = ranges
        .par_iter()
        .map(|range| {
            let (mut sum, mut count) = (Local::zeros(), 0);
            for &index in &order[range.clone()] {
                let (point, points, _) = items[index as usize];
                sum += quantization.local(point) * points as f64;
                count += points;
            }
            sum / count as f64
        })
        .collect();
    let grid = NeighborGrid::new(&means, 0.5 * options.smooth);
    let moved: Vec<(Stored, u64, Option<PointTag>)> = ranges
        .into_par_iter()
        .zip(&means)
        .map_init(Vec::new, |near, (range, &mean)| {
            grid.gather(mean, options.smooth, near);
            let patch = Patch::fit(mean, near, options.smooth, options.patch)
                .filter(|patch| patch.describes(SURFACE_DETAIL_IN_RADII * options.smooth));
            let moved = |&index: &u32| {
                let (point, points, tag) = items[index as usize];
                let foot = patch
                    .as_ref()
                    .and_then(|p| quantization.stored(p.foot_point(quantization.local(point))));
                (foot.unwrap_or(point), points, tag)
            };
            order[range].iter().map(moved).collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect();
    let mut smoothed = ThinnedPoints::default();
    for (point, count, tag) in moved {
        match (count, tag) {
            (1, Some(tag)) => {
                smoothed.kept.push(point);
                smoothed.tags.push(tag);
            }
            (1, None) if !has_tags => smoothed.kept.push(point),
            _ => smoothed.sums.push(PointSum::of_equal(point, count)),
        }
    }
    smoothed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    const QUANTIZATION: Quantization = Quantization {
        scale: 1e-4,
        offset: [0.0; 3],
    };

    fn unit(k: u64) -> f64 {
        spread(k) as f64 / u64::MAX as f64
    }

    fn smooth(points: Vec<Stored>, radius: f64) -> Vec<Stored> {
        let options = SolverOptions {
            smooth: radius,
            ..SolverOptions::new(0.2)
        };
        smoothed(points.into(), &QUANTIZATION, &options).kept
    }

    /// Points of a bent sheet with noise of this thickness.
    fn noisy(thickness: f64) -> Vec<Stored> {
        (0..40_000)
            .filter_map(|i| {
                let (x, y) = (10.0 * unit(3 * i), 10.0 * unit(3 * i + 1));
                let noise = thickness * (unit(3 * i + 2) - 0.5);
                QUANTIZATION.stored(Local::new(x, y, 0.05 * x * x + noise))
            })
            .collect()
    }

    fn mean_height(points: &[Stored]) -> f64 {
        let inner = points.iter().map(|&p| QUANTIZATION.local(p));
        let inner = inner.filter(|p| (1.0..9.0).contains(&p.x) && (1.0..9.0).contains(&p.y));
        let heights: Vec<f64> = inner.map(|p| (p.z - 0.05 * p.x * p.x).abs()).collect();
        heights.iter().sum::<f64>() / heights.len() as f64
    }

    #[test]
    fn noise_is_taken_off_a_bent_sheet() {
        let points = noisy(0.2);
        let before = mean_height(&points);
        let after = mean_height(&smooth(points, 0.8));
        assert!(after < 0.2 * before, "{before} {after}");
    }

    #[test]
    fn the_order_of_the_points_does_not_matter() {
        let points = noisy(0.2);
        let mut turned = points.clone();
        turned.reverse();
        let mut all = [points, turned].map(|points| smooth(points, 0.8));
        all.iter_mut().for_each(|points| points.sort_unstable());
        assert_eq!(all[0], all[1]);
    }

    #[test]
    fn leaves_stay_where_they_are() {
        let points: Vec<Stored> = (0..30_000)
            .filter_map(|i| {
                let position = Local::new(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2));
                QUANTIZATION.stored(position * 2.0)
            })
            .collect();
        // The outside of a crown does resemble a surface.
        let is_inner = |p: &&Stored| [p.x, p.y, p.z].iter().all(|c| (6_000..14_000).contains(c));
        let known: std::collections::BTreeSet<Stored> = points.iter().copied().collect();
        let after = smooth(points, 0.5);
        let inner: Vec<&Stored> = after.iter().filter(is_inner).collect();
        let same = inner.iter().filter(|point| known.contains(point)).count();
        assert!(same > inner.len() * 9 / 10, "{same} of {}", inner.len());
    }
}
