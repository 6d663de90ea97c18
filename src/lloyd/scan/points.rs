//! The points of a scan by voxel, and their samples.
//!
//! Scans are dense near the scanner and sparse far away. Two views serve the solver, both on
//! cubic voxels anchored at the run's origin:
//!
//! * the *points*, sorted by voxel, for what concerns the scan itself (the candidates for
//!   seeds, the distance to the scan);
//! * one *sample* a voxel, the mean of its points, for the patches: a bounded number in any
//!   neighbourhood, evenly spread, with the noise averaged.
//!
//! Sums are of integers, so they do not depend on the order of the points.

use std::ops::Range;

use rayon::prelude::*;

use super::{
    thinned::{PointSum, ThinnedPoints},
    thinning::keep_first,
    voxel::{VOXELS_PER_SPACING, voxel_edge},
    voxel_points::MOST_IN_VOXEL,
};
use crate::{
    geometry::{LayeredCells, Local, NeighborGrid, OccupiedCells, Quantization, Stored, cell_of},
    lloyd::{SolverOptions, field::SpacingField},
};

/// A sample that is the mean of this many points has half of the weight that a sample can have:
/// more points make a mean more precise, until what the patch leaves unexplained limits its
/// share. On a simulated street with 12 mm of noise sites lie 2.25 mm from the truth on average
/// if all samples weigh the same, 1.93 mm with 2 points, 1.81 mm with 10, 1.79 mm with 20;
/// without noise 20 round edges more.
const HALF_WEIGHT_POINTS: f64 = 10.0;

/// Edge of the cells in which samples are looked up.
const SAMPLE_CELL_IN_FIT_RADII: f64 = 0.4;
/// Least edge of those cells, however small the fit radius is: there is hardly more than a sample in such a cell, and samples are
/// looked for several spacings around.
const SMALLEST_SAMPLE_CELL_IN_SPACINGS: f64 = 0.2;

/// The points of a tile, with their samples.
#[derive(Debug)]
pub struct Scan {
    pub(super) quantization: Quantization,
    /// Seed of the priorities of the points.
    seed: u64,
    /// Edge of a voxel (CRS units).
    pub(super) voxel: f64,
    /// The points, sorted by voxel.
    pub(super) points: Vec<Stored>,
    pub(super) voxels: OccupiedCells,
    /// Positions on the surface where it was not scanned, one to a voxel without a point.
    pub(super) filling: Vec<Stored>,
    /// The voxels of the filling.
    pub(super) filled: OccupiedCells,
    samples: NeighborGrid,
    /// The weight of each sample in a fit: first those of the scan, then those of the filling.
    weights: Vec<f32>,
    /// Where the spacing varies, which voxels have one sample together.
    merged: Option<MergedVoxels>,
    /// The spacing that is wanted everywhere.
    field: SpacingField,
}

/// Voxels that have one sample together: those of a coarser voxel, where the spacing is coarser than the finest.
#[derive(Debug)]
struct MergedVoxels {
    /// The coarser voxels, in layers; their number is that of the samples of the scan.
    cells: LayeredCells,
    /// The number of points that each of them keeps.
    kept: Vec<u32>,
}

impl Scan {
    /// The scan of `points` as they are: neither thinned nor smoothed, and with its holes.
    ///
    /// # Panics
    ///
    /// Unless spacing and fit radius are positive, and there are fewer than 2³² points.
    pub fn as_scanned(
        points: Vec<Stored>,
        quantization: Quantization,
        options: &SolverOptions,
    ) -> Self {
        Self::of_voxels(points.into(), quantization, options, usize::MAX)
    }

    /// The scan of `points`, of which a voxel keeps at most as many as thinning leaves.
    ///
    /// # Panics
    ///
    /// Unless spacing and fit radius are positive, and there are fewer than 2³² points.
    pub(crate) fn thinned(
        points: ThinnedPoints,
        quantization: Quantization,
        options: &SolverOptions,
    ) -> Self {
        Self::of_voxels(points, quantization, options, MOST_IN_VOXEL)
    }

    /// The scan of `points` by voxel; a voxel keeps at most `most` of them.
    fn of_voxels(
        points: ThinnedPoints,
        quantization: Quantization,
        options: &SolverOptions,
        most: usize,
    ) -> Self {
        let SolverOptions {
            fit_radius, seed, ..
        } = *options;
        assert!(fit_radius > 0.0, "a fit radius of {fit_radius}");
        let voxel = voxel_edge(&quantization, options);
        let ThinnedPoints { kept, sums, tags } = points;
        let field = match &options.grading {
            Some(grading) if !tags.is_empty() => {
                let shares: Vec<f32> = tags.iter().map(|tag| tag.share).collect();
                SpacingField::new(&kept, &shares, &quantization, options.spacing, grading)
            }
            _ => SpacingField::constant(options.spacing),
        };
        drop(tags);
        let (mut voxels, mut points) =
            OccupiedCells::sort_points(&kept, |p| cell_of(quantization.local(p), voxel));
        drop(kept);

        // The sum of each voxel is that of all its points, kept or not.
        let sum = |range: Range<usize>| {
            let mut sum = PointSum::default();
            let in_voxel = points[range].iter();
            in_voxel.for_each(|&point| sum.add(point));
            sum
        };
        let ranges: Vec<Range<usize>> = voxels.ranges().collect();
        let mut totals: Vec<PointSum> = ranges.into_par_iter().map(sum).collect();
        let voxel_of =
            |sum: &PointSum| voxels.index_of(cell_of(quantization.local(sum.mean()), voxel));
        let voxels_of_sums: Vec<Option<usize>> = sums.par_iter().map(voxel_of).collect();
        for (sum, index) in sums.iter().zip(voxels_of_sums) {
            // A voxel on the rim of what is known may have lost its points.
            if let Some(index) = index {
                totals[index].merge(sum);
            }
        }
        drop(sums);
        keep_first(&mut voxels, &mut points, &totals, most, seed);

        let mean = |total: &PointSum| total.local_mean(&quantization);
        let mut means: Vec<Local> = totals.par_iter().map(mean).collect();
        let merged = (!field.is_constant()).then(|| {
            let merged = MergedVoxels::new(&means, &totals, &voxels, &field);
            totals = merged.1;
            means = totals.par_iter().map(mean).collect();
            merged.0
        });
        let weights = totals.iter().map(|total| weight_of(total.count)).collect();
        Self {
            samples: field.grid_of_edge(&means, sample_cell(options)),
            quantization,
            seed,
            voxel,
            points,
            voxels,
            filling: Vec::new(),
            filled: OccupiedCells::sort(&[], |&cell| cell).0,
            weights,
            merged,
            field,
        }
    }

    /// The spacing that is wanted everywhere.
    #[inline]
    pub(crate) fn field(&self) -> &SpacingField {
        &self.field
    }

    /// Number of samples that are not of the filling.
    fn scanned_samples(&self) -> usize {
        match &self.merged {
            None => self.voxels.len(),
            Some(merged) => merged.kept.len(),
        }
    }

    /// Adds the positions `filling`; of several in one voxel the smallest is kept.
    pub(super) fn fill(&mut self, mut filling: Vec<Stored>, options: &SolverOptions) {
        let voxel_of = |position: Stored| cell_of(self.quantization.local(position), self.voxel);
        filling.sort_unstable_by_key(|&position| (voxel_of(position), position));
        filling.dedup_by_key(|position| voxel_of(*position));
        let (filled, order) = OccupiedCells::sort(&filling, |&position| voxel_of(position));
        let mut means = vec![Local::zeros(); self.weights.len()];
        self.samples
            .visit_all(|sample, position| means[sample as usize] = position);
        self.filling = order.iter().map(|&i| filling[i as usize]).collect();
        means.extend(
            self.filling
                .iter()
                .map(|&position| self.quantization.local(position)),
        );
        self.weights.resize(means.len(), weight_of(1));
        self.samples = self.field.grid_of_edge(&means, sample_cell(options));
        self.filled = filled;
    }

    /// The positions that close the holes of the scan, one to a voxel.
    pub(crate) fn filling(&self) -> &[Stored] {
        &self.filling
    }

    /// Whether there is a point in the voxel of `position`.
    #[inline]
    pub(crate) fn is_occupied(&self, position: Local) -> bool {
        match &self.merged {
            None => self
                .voxels
                .index_of(cell_of(position, self.voxel))
                .is_some(),
            Some(merged) => merged.cells.containing(position).next().is_some(),
        }
    }

    /// The points, sorted by voxel.
    #[inline]
    pub(crate) fn points(&self) -> &[Stored] {
        &self.points
    }

    /// The quantization of the run.
    #[inline]
    pub fn quantization(&self) -> &Quantization {
        &self.quantization
    }

    /// The samples: one to an occupied voxel, the mean of its points.
    #[inline]
    pub fn samples(&self) -> &NeighborGrid {
        &self.samples
    }

    /// Number of points that the voxel of sample `index` keeps; 0 for the filling.
    #[inline]
    pub fn count(&self, index: u32) -> u32 {
        let voxel = index as usize;
        match (voxel < self.scanned_samples(), &self.merged) {
            (true, None) => self.voxels.points_of(voxel).len() as u32,
            (true, Some(merged)) => merged.kept[voxel],
            (false, _) => 0,
        }
    }

    /// The weight of sample `index` in a fit: the larger the more points it is the mean of.
    #[inline]
    pub(crate) fn weight(&self, index: u32) -> f32 {
        self.weights[index as usize]
    }

    /// Number of points that sample `index` is the mean of, as nearly as its weight tells; 0 for the filling.
    pub(crate) fn points_of_sample(&self, index: u32) -> f64 {
        match (index as usize) < self.scanned_samples() {
            true => points_of(self.weights[index as usize]),
            false => 0.0,
        }
    }

    /// The points of every occupied voxel.
    pub(crate) fn points_by_voxel(&self) -> impl ParallelIterator<Item = &[Stored]> {
        let voxels: Vec<Range<usize>> = self.voxels.ranges().collect();
        voxels.into_par_iter().map(|voxel| &self.points[voxel])
    }

    /// The point of highest priority among the points of `voxel`.
    pub(crate) fn representative(&self, voxel: &[Stored]) -> Option<Stored> {
        let rank = |point: &Stored| (point.priority(self.seed), *point);
        voxel.iter().copied().min_by_key(rank)
    }

    /// One point of every occupied voxel: an even sample of the scanned surface.
    pub fn representatives(&self) -> Vec<Stored> {
        let voxels = self.points_by_voxel();
        voxels.filter_map(|v| self.representative(v)).collect()
    }
}

impl MergedVoxels {
    /// Merges the `voxels` whose points have the `means`, and the sums `totals`, as the spacing of `field` says. Gives the
    /// sums of the merged voxels beside them.
    fn new(
        means: &[Local],
        totals: &[PointSum],
        voxels: &OccupiedCells,
        field: &SpacingField,
    ) -> (Self, Vec<PointSum>) {
        let (cells, order) = field.cells(means, 1.0 / VOXELS_PER_SPACING);
        let (mut kept, mut sums) = (Vec::new(), Vec::new());
        for range in cells.ranges() {
            let mut sum = PointSum::default();
            let mut count = 0;
            for &voxel in &order[range] {
                sum.merge(&totals[voxel as usize]);
                count += voxels.points_of(voxel as usize).len() as u32;
            }
            kept.push(count);
            sums.push(sum);
        }
        (Self { cells, kept }, sums)
    }
}

/// The edge of the cells in which samples are looked up (CRS units).
fn sample_cell(options: &SolverOptions) -> f64 {
    let smallest = SMALLEST_SAMPLE_CELL_IN_SPACINGS * options.spacing;
    smallest.max(SAMPLE_CELL_IN_FIT_RADII * options.fit_radius)
}

/// The weight of the mean of `count` points.
fn weight_of(count: u64) -> f32 {
    let count = count as f64;
    (count / (count + HALF_WEIGHT_POINTS)) as f32
}

/// The number of points whose mean has `weight`: exact up to a thousand, at most some hundred million.
fn points_of(weight: f32) -> f64 {
    let missing = f64::max(1.0 - f64::from(weight), f64::from(f32::EPSILON));
    (HALF_WEIGHT_POINTS * (1.0 / missing - 1.0)).round()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::spread;

    /// The scan of `points` at a scale of a millimetre, for a spacing of 0.3.
    pub(in crate::lloyd::scan) fn scan(points: Vec<Stored>) -> Scan {
        let quantization = Quantization {
            scale: 0.001,
            offset: [0.0; 3],
        };
        let options = SolverOptions {
            seed: 1,
            ..SolverOptions::new(0.3)
        };
        Scan::as_scanned(points, quantization, &options)
    }

    /// `n` scattered points in a box of 2 × 2 × 0.2 at a scale of a millimetre.
    pub(in crate::lloyd::scan) fn cloud(n: u64) -> Vec<Stored> {
        let coordinate = |k: u64| (spread(k) % 2000) as i32 - 1000;
        (0..n)
            .map(|i| Stored {
                x: coordinate(3 * i),
                y: coordinate(3 * i + 1),
                z: coordinate(3 * i + 2) / 10,
            })
            .collect()
    }

    #[test]
    fn the_order_of_the_points_does_not_matter() {
        let points = cloud(2000);
        let mut turned = points.clone();
        turned.reverse();
        let (one, other) = (scan(points), scan(turned));
        assert_eq!(one.points(), other.points());
        assert_eq!(one.samples().points(), other.samples().points());
    }

    #[test]
    fn samples_stand_for_every_point_once() {
        let scan = scan(cloud(5000));
        let total: u32 = (0..scan.samples().points().len() as u32)
            .map(|i| scan.count(i))
            .sum();
        assert_eq!(total as usize, scan.points().len());
    }

    #[test]
    fn weights_tell_of_how_many_points_samples_are_the_mean() {
        for count in (1..=1000).chain([10_000, 1_000_000]) {
            let told = points_of(weight_of(count));
            let tolerance = if count <= 1000 { 0.0 } else { 0.05 };
            let count = count as f64;
            assert!(
                (told - count).abs() <= tolerance * count,
                "{told} of {count}"
            );
        }
        assert!(points_of(weight_of(u64::MAX)).is_finite());
    }

    #[test]
    fn cells_of_samples_follow_the_fit_radius_but_not_to_nothing() {
        let of_fit_radius = |fit_radius| {
            let options = SolverOptions::new(0.3);
            sample_cell(&SolverOptions {
                fit_radius,
                ..options
            })
        };
        assert_eq!(of_fit_radius(1.0), SAMPLE_CELL_IN_FIT_RADII);
        assert_eq!(of_fit_radius(1e-6), 0.3 * SMALLEST_SAMPLE_CELL_IN_SPACINGS);
    }

    #[test]
    fn a_million_equal_points_are_one_sample() {
        let scan = scan(vec![Stored { x: 5, y: 6, z: 7 }; 1_000_000]);
        assert_eq!(scan.samples().points().len(), 1);
        assert_eq!(scan.representatives().len(), 1);
    }
}
