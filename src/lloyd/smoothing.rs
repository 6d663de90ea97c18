//! Noise is smoothed away before anything else is done, where that is asked for.
//!
//! Every point is put on the patch of what lies around it, as far as the noise
//! reaches (paper, section V-D): a site is then elected on the surface, and not
//! in the band of noise about it. A second time the patches are fitted to what
//! the first has put near the surface.

use rayon::prelude::*;

use super::SolverOptions;
use crate::geometry::{Local, NeighborGrid, OccupiedCells, Patch, Quantization, Stored, cell_of};

/// Cells to a radius: their means, some forty to a patch, are what it is fitted
/// to.
const CELLS: f64 = 4.0;

/// Of what scatters more about its patch than is allowed for this many radii
/// nobody knows where its surface is.
const NOISE: f64 = 1.6;

/// Times that points are put on patches.
const PASSES: u32 = 2;

/// `points` on the surface that they are the noisy samples of, for patches of
/// the radius that `options` ask for. Where there is no surface they stay.
pub(super) fn smoothed(
    mut points: Vec<Stored>,
    quantization: &Quantization,
    options: &SolverOptions,
) -> Vec<Stored> {
    for _ in 0..PASSES {
        points = on_patches(points, quantization, options);
    }
    points
}

fn on_patches(
    points: Vec<Stored>,
    quantization: &Quantization,
    options: &SolverOptions,
) -> Vec<Stored> {
    let edge = options.smooth / CELLS;
    // By coordinates within a cell: sums must not depend on the order of files.
    let (cells, points) =
        OccupiedCells::sort_points(&points, |p| cell_of(quantization.local(p), edge));
    let ranges: Vec<_> = cells.ranges().collect();
    let means: Vec<Local> = ranges
        .par_iter()
        .map(|range| {
            let held = points[range.clone()].iter().map(|&p| quantization.local(p));
            held.sum::<Local>() / range.len() as f64
        })
        .collect();
    let grid = NeighborGrid::new(&means, 0.5 * options.smooth);
    ranges
        .into_par_iter()
        .zip(&means)
        .map_init(Vec::new, |near, (range, &mean)| {
            grid.gather(mean, options.smooth, near);
            let patch = Patch::fit(mean, near, options.smooth, options.patch)
                .filter(|patch| patch.describes(NOISE * options.smooth));
            let put = |&point: &Stored| {
                let place = patch
                    .as_ref()
                    .map(|p| p.foot_point(quantization.local(point)));
                place
                    .and_then(|place| quantization.stored(place))
                    .unwrap_or(point)
            };
            points[range].iter().map(put).collect::<Vec<_>>()
        })
        .flatten_iter()
        .collect()
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
        smoothed(points, &QUANTIZATION, &options)
    }

    /// Points of a bent sheet, and beside it one by one their heights above it.
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
                let place = Local::new(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2));
                QUANTIZATION.stored(place * 2.0)
            })
            .collect();
        // In the middle: the outside of a crown does look like a surface.
        let is_inner = |p: &&Stored| [p.x, p.y, p.z].iter().all(|c| (6_000..14_000).contains(c));
        let known: std::collections::BTreeSet<Stored> = points.iter().copied().collect();
        let after = smooth(points, 0.5);
        let inner: Vec<&Stored> = after.iter().filter(is_inner).collect();
        let same = inner.iter().filter(|point| known.contains(point)).count();
        assert!(same > inner.len() * 9 / 10, "{same} of {}", inner.len());
    }
}
