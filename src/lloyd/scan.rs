//! The input of one solve: the points of a tile, and their even thinning.
//!
//! Scans are dense near the scanner and sparse far away. Two views serve the
//! solver, both on a cubic lattice of voxels anchored at the run's origin:
//!
//! * the *points*, sorted by voxel, for what must hold of the scan itself
//!   (where seeds come from, how near the scan is);
//! * one *sample* a voxel, the mean of its points, for the patches: a bounded
//!   number in any neighbourhood, evenly spread, with the noise averaged.
//!
//! Sums are of integers, so they do not depend on the order of the points.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use super::{SolverOptions, filling::filling, smoothing::smoothed};
use crate::geometry::{
    AT_ONCE, Local, NeighborGrid, OccupiedCells, Quantization, Stored, cell_of, spread,
};

/// Voxels to a spacing. Three give some forty samples to a patch of radius
/// 1.2 spacings; more cost time and moved no figure.
const VOXELS_PER_SPACING: f64 = 3.0;

/// Points of a voxel that are kept: six hundred to a seed of a plane. What a scanner
/// that stands still heaps up beyond that tells nothing more.
const MOST_PER_VOXEL: usize = 64;

/// Edge of the cells in which samples are looked up, in fit radii.
const SAMPLE_CELL: f64 = 0.4;

/// The points of a tile, with their samples.
#[derive(Debug)]
pub struct Scan {
    quantization: Quantization,
    seed: u64,
    voxel: f64,
    points: Vec<Stored>,
    voxels: OccupiedCells,
    /// Places on the surface where it was not scanned, one to a voxel without a
    /// point.
    filling: Vec<Stored>,
    filled: OccupiedCells,
    samples: NeighborGrid,
    /// Points in the voxel of each sample, in the order of the voxels; none for
    /// the filling.
    counts: Vec<u32>,
}

impl Scan {
    /// Thins `points`, smooths them, sorts them by voxel, takes the samples, and closes
    /// the holes, for what `options` ask for.
    ///
    /// # Panics
    ///
    /// Unless spacing and fit radius are positive; and as
    /// [`OccupiedCells::sort`].
    pub fn new(points: Vec<Stored>, quantization: Quantization, options: &SolverOptions) -> Self {
        let points = if options.smooth > 0.0 {
            smoothed(
                Self::thinned(points, &quantization, options),
                &quantization,
                options,
            )
        } else {
            points
        };
        let mut scan = Self::as_scanned(points, quantization, options);
        if scan
            .voxels
            .ranges()
            .any(|range| range.len() > MOST_PER_VOXEL)
        {
            let kept = Self::thinned(scan.points, &quantization, options);
            scan = Self::as_scanned(kept, quantization, options);
        }
        let filling = filling(&scan, options);
        if !filling.is_empty() {
            scan.fill(filling, options);
        }
        scan
    }

    /// The same without a change: noisy, and with its holes.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub fn as_scanned(
        points: Vec<Stored>,
        quantization: Quantization,
        options: &SolverOptions,
    ) -> Self {
        let SolverOptions {
            fit_radius, seed, ..
        } = *options;
        assert!(fit_radius > 0.0, "a fit radius of {fit_radius}");
        let voxel = voxel_edge(&quantization, options);
        let (voxels, points) =
            OccupiedCells::sort_points(&points, |p| cell_of(quantization.local(p), voxel));

        let ranges: Vec<Range<usize>> = voxels.ranges().collect();
        let mean = |range: Range<usize>| {
            let held = &points[range];
            let mut sum = [0_i64; 3];
            for p in held {
                sum[0] += i64::from(p.x);
                sum[1] += i64::from(p.y);
                sum[2] += i64::from(p.z);
            }
            let weight = quantization.scale / held.len() as f64;
            let count = u32::try_from(held.len()).expect("a tile has under 2^32 points");
            (Local::from(sum.map(|s| s as f64 * weight)), count)
        };
        let (means, counts): (Vec<Local>, Vec<u32>) = ranges.into_par_iter().map(mean).unzip();
        Self {
            quantization,
            seed,
            voxel,
            points,
            voxels,
            filling: Vec::new(),
            filled: OccupiedCells::sort(&[], |&cell| cell).0,
            samples: NeighborGrid::new(&means, SAMPLE_CELL * fit_radius),
            counts,
        }
    }

    /// Of `points` in one voxel (a third of a spacing wide) no more than 64, those of the
    /// highest priority, in no order that may be relied on. Points may be thinned by and by:
    /// what is left at the end is the same.
    ///
    /// # Panics
    ///
    /// As [`new`](Self::new).
    pub(crate) fn thinned(
        points: Vec<Stored>,
        quantization: &Quantization,
        options: &SolverOptions,
    ) -> Vec<Stored> {
        let voxel = voxel_edge(quantization, options);
        let (voxels, order) =
            OccupiedCells::sort(&points, |&point| cell_of(quantization.local(point), voxel));
        if voxels.ranges().all(|range| range.len() <= MOST_PER_VOXEL) {
            return points;
        }
        let ranges: Vec<Range<usize>> = voxels.ranges().collect();
        let rank = |point: &Stored| (priority(*point, options.seed), *point);
        let kept = |range: Range<usize>| {
            let mut held: Vec<Stored> = order[range].iter().map(|&i| points[i as usize]).collect();
            if held.len() > MOST_PER_VOXEL {
                held.select_nth_unstable_by_key(MOST_PER_VOXEL, rank);
                held.truncate(MOST_PER_VOXEL);
            }
            held
        };
        ranges.into_par_iter().flat_map_iter(kept).collect()
    }

    /// Points to a square of edge `edge` (CRS units) of a plane beyond which some of
    /// them are not kept.
    pub(crate) fn most_on_square(
        edge: f64,
        quantization: &Quantization,
        options: &SolverOptions,
    ) -> f64 {
        MOST_PER_VOXEL as f64 * (edge / voxel_edge(quantization, options)).powi(2)
    }

    /// Adds `filling`, of places in one voxel the smallest.
    fn fill(&mut self, mut filling: Vec<Stored>, options: &SolverOptions) {
        let voxel_of = |place: Stored| cell_of(self.quantization.local(place), self.voxel);
        filling.sort_unstable_by_key(|&place| (voxel_of(place), place));
        filling.dedup_by_key(|place| voxel_of(*place));
        let (filled, order) = OccupiedCells::sort(&filling, |&place| voxel_of(place));
        let mut means = vec![Local::zeros(); self.counts.len()];
        self.samples
            .visit_all(|sample, place| means[sample as usize] = place);
        self.filling = order.iter().map(|&i| filling[i as usize]).collect();
        means.extend(
            self.filling
                .iter()
                .map(|&place| self.quantization.local(place)),
        );
        self.counts.resize(means.len(), 0);
        self.samples = NeighborGrid::new(&means, SAMPLE_CELL * options.fit_radius);
        self.filled = filled;
    }

    /// The places that close the holes of the scan.
    pub(crate) fn filling(&self) -> &[Stored] {
        &self.filling
    }

    /// Whether there is a point in the voxel of `place`.
    pub(super) fn is_occupied(&self, place: Local) -> bool {
        self.voxels.place(cell_of(place, self.voxel)).is_some()
    }

    /// The points, sorted by voxel.
    pub(crate) fn points(&self) -> &[Stored] {
        &self.points
    }

    /// The quantization of the run.
    pub fn quantization(&self) -> &Quantization {
        &self.quantization
    }

    /// The samples, to be visited around a place.
    pub fn samples(&self) -> &NeighborGrid {
        &self.samples
    }

    /// How many points sample `index` stands for.
    pub fn count(&self, index: u32) -> u32 {
        self.counts[index as usize]
    }

    /// Whether a point of the scan, or of what closes its holes, lies within
    /// `radius` (CRS units) of `place`.
    pub(crate) fn has_point_within(&self, place: Local, radius: f64) -> bool {
        self.some_point_within(place, radius).is_some()
    }

    /// Such a point, if there is one.
    pub(super) fn some_point_within(&self, place: Local, radius: f64) -> Option<Local> {
        let radius_squared = radius * radius;
        let find = |points: &[Stored]| {
            let mut places = points.iter().map(|&point| self.quantization.local(point));
            places.find(|point| (point - place).norm_squared() <= radius_squared)
        };
        // The voxel of the place itself answers nearly always.
        let home = self.voxels.range(cell_of(place, self.voxel));
        find(&self.points[home]).or_else(|| {
            let layers = [(&self.voxels, &self.points), (&self.filled, &self.filling)];
            layers.into_iter().find_map(|(voxels, points)| {
                let search =
                    self.voxels_around(voxels, place, radius, |range| match find(&points[range]) {
                        Some(point) => ControlFlow::Break(point),
                        None => ControlFlow::Continue(()),
                    });
                search.break_value()
            })
        })
    }

    /// The point of the scan nearest to `place` within `radius` (CRS units)
    /// and its distance; of equally near ones the smallest.
    pub fn nearest(&self, place: Local, radius: f64) -> Option<(Stored, f64)> {
        self.nearest_but(None, place, radius)
    }

    fn local(&self, place: usize) -> Local {
        self.quantization.local(self.points[place])
    }

    /// Calls `visit` with the points of every voxel of `voxels` that a ball
    /// touches, until it breaks.
    fn voxels_around<B>(
        &self,
        voxels: &OccupiedCells,
        center: Local,
        radius: f64,
        mut visit: impl FnMut(Range<usize>) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let reach = Local::repeat(radius);
        voxels.visit_box(
            cell_of(center - reach, self.voxel),
            cell_of(center + reach, self.voxel),
            |voxel| visit(voxels.points_of(voxel)),
        )
    }

    /// Distances from points of the scan to the nearest other one within
    /// `radius` (CRS units), for an unbiased choice of about `share` of the
    /// points that `wanted` holds for.
    pub fn sampled_distances(
        &self,
        share: f64,
        radius: f64,
        wanted: impl Fn(Stored) -> bool + Sync,
    ) -> Vec<f64> {
        // Not the hash of the elections: their winners are no fair choice.
        let threshold = (share.clamp(0.0, 1.0) * u64::MAX as f64) as u64;
        let is_chosen = |point: Stored| priority(point, !0) <= threshold && wanted(point);
        (0..self.points.len())
            .into_par_iter()
            .with_max_len(AT_ONCE)
            .filter(|&own| is_chosen(self.points[own]))
            .filter_map(|own| self.nearest_but(Some(own), self.local(own), radius))
            .map(|(_, distance)| distance)
            .collect()
    }

    /// As [`nearest`](Self::nearest), but for the point at `own`: in balls of
    /// growing reach.
    fn nearest_but(&self, own: Option<usize>, place: Local, radius: f64) -> Option<(Stored, f64)> {
        let mut reach = self.voxel.min(radius);
        loop {
            match self.nearest_within(own, place, reach) {
                Some((point, squared)) => return Some((point, squared.sqrt())),
                None if reach >= radius => return None,
                None => reach = (2.0 * reach).min(radius),
            }
        }
    }

    fn nearest_within(
        &self,
        own: Option<usize>,
        place: Local,
        radius: f64,
    ) -> Option<(Stored, f64)> {
        let mut best: Option<(Stored, f64)> = None;
        let mut limit = radius * radius;
        let _ = self.voxels_around(&self.voxels, place, radius, |range| {
            for index in range.filter(|&index| Some(index) != own) {
                let point = self.points[index];
                let squared = (self.quantization.local(point) - place).norm_squared();
                if squared < limit || squared == limit && best.is_none_or(|(b, _)| point < b) {
                    best = Some((point, squared));
                    limit = squared;
                }
            }
            ControlFlow::<()>::Continue(())
        });
        best
    }

    /// The points of every occupied voxel.
    pub(super) fn points_by_voxel(&self) -> impl ParallelIterator<Item = &[Stored]> {
        let voxels: Vec<Range<usize>> = self.voxels.ranges().collect();
        voxels.into_par_iter().map(|voxel| &self.points[voxel])
    }

    /// Of the points of a voxel the one of highest priority, a hash of its coordinates and the
    /// seed.
    pub(super) fn representative(&self, voxel: &[Stored]) -> Option<Stored> {
        let rank = |point: &Stored| (priority(*point, self.seed), *point);
        voxel.iter().copied().min_by_key(rank)
    }

    /// One point of every occupied voxel: an even, unbiased choice of places of the scan.
    pub fn representatives(&self) -> Vec<Stored> {
        let voxels = self.points_by_voxel();
        voxels.filter_map(|v| self.representative(v)).collect()
    }
}

/// The edge of a voxel: whole stored units at least, as one finer than the lattice
/// would hold one point for ever.
fn voxel_edge(quantization: &Quantization, options: &SolverOptions) -> f64 {
    let spacing = options.spacing;
    assert!(spacing > 0.0, "a spacing of {spacing}");
    (spacing / VOXELS_PER_SPACING).max(quantization.scale)
}

/// The priority of a point in every election: a hash of what it is, not of
/// where in which file it stood.
pub(super) fn priority(point: Stored, seed: u64) -> u64 {
    let [x, y, z] = [point.x, point.y, point.z].map(|c| u64::from(c as u32));
    spread(spread(x << 32 | y) ^ spread(z ^ spread(seed)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(points: Vec<Stored>) -> Scan {
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

    fn cloud(n: u64) -> Vec<Stored> {
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
    fn the_nearest_point_matches_brute_force() {
        let points = cloud(3000);
        let scan = scan(points.clone());
        for place in cloud(300) {
            let place = scan.quantization().local(place) * 1.1;
            let truth = points
                .iter()
                .map(|&p| ((scan.quantization().local(p) - place).norm(), p))
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
                .unwrap();
            let (point, distance) = scan.nearest(place, 100.0).unwrap();
            assert!((distance - truth.0).abs() < 1e-12);
            assert_eq!(point, truth.1);
            assert_eq!(scan.has_point_within(place, 0.05), truth.0 <= 0.05);
        }
    }

    #[test]
    fn sampled_distances_match_brute_force() {
        let mut points = cloud(800);
        points.push(points[0]);
        let scan = scan(points.clone());
        let mut sampled = scan.sampled_distances(1.0, 100.0, |_| true);
        let mut truth: Vec<f64> = (0..points.len())
            .map(|i| {
                let place = |k: usize| scan.quantization().local(points[k]);
                let others = (0..points.len()).filter(|&k| k != i);
                others
                    .map(|k| (place(k) - place(i)).norm())
                    .fold(f64::INFINITY, f64::min)
            })
            .collect();
        sampled.sort_by(f64::total_cmp);
        truth.sort_by(f64::total_cmp);
        assert_eq!(sampled.len(), truth.len());
        assert!(
            sampled
                .iter()
                .zip(&truth)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
        assert!(scan.sampled_distances(0.1, 100.0, |_| true).len() < 160);
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
    fn points_thinned_by_and_by_are_those_thinned_at_once() {
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
        let mut by_and_by = Vec::new();
        for part in points.rchunks(7_001) {
            by_and_by.extend_from_slice(part);
            by_and_by = Scan::thinned(by_and_by, &quantization, &options);
        }
        assert_eq!(sorted(by_and_by), at_once);

        // The twin: a list for each voxel, sorted by priority, cut.
        let mut held: std::collections::HashMap<_, Vec<Stored>> = std::collections::HashMap::new();
        for point in points {
            let voxel = cell_of(quantization.local(point), 0.3);
            held.entry(voxel).or_default().push(point);
        }
        let truth = held.into_values().flat_map(|mut points| {
            points.sort_unstable_by_key(|&p| (priority(p, options.seed), p));
            points.truncate(MOST_PER_VOXEL);
            points
        });
        assert_eq!(sorted(truth.collect()), at_once);
        assert!(at_once.len() < 20_000);
    }

    #[test]
    fn a_million_equal_points_are_one_sample() {
        let scan = scan(vec![Stored { x: 5, y: 6, z: 7 }; 1_000_000]);
        assert_eq!(scan.samples().points().len(), 1);
        assert_eq!(scan.representatives().len(), 1);
    }
}
