//! The points of a scan near a position.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use super::{points::Scan, thinned::PointSum};
use crate::geometry::{ITEMS_PER_TASK, Local, OccupiedCells, Stored, cell_of};

impl Scan {
    /// Whether a point of the scan or of its filling lies within `radius` (CRS units) of
    /// `position`.
    pub(crate) fn has_point_within(&self, position: Local, radius: f64) -> bool {
        self.some_point_within(position, radius).is_some()
    }

    /// Some point of the scan or of its filling within `radius` (CRS units) of `position`, if
    /// there is one.
    pub(crate) fn some_point_within(&self, position: Local, radius: f64) -> Option<Local> {
        let radius_squared = radius * radius;
        let find = |points: &[Stored]| {
            let mut positions = points.iter().map(|&point| self.quantization.local(point));
            positions.find(|point| (point - position).norm_squared() <= radius_squared)
        };
        // The voxel of the position itself suffices nearly always.
        let own = self.voxels.range(cell_of(position, self.voxel));
        find(&self.points[own]).or_else(|| {
            self.parts().into_iter().find_map(|(voxels, points)| {
                let search = self.voxels_around(voxels, position, radius, |range| {
                    match find(&points[range]) {
                        Some(point) => ControlFlow::Break(point),
                        None => ControlFlow::Continue(()),
                    }
                });
                search.break_value()
            })
        })
    }

    /// The mean of the points of the scan and of its filling within `radius` (CRS units) of
    /// `position`, if there are any.
    pub(crate) fn mean_within(&self, position: Local, radius: f64) -> Option<Local> {
        let mut sum = PointSum::default();
        for (voxels, points) in self.parts() {
            let _ = self.voxels_around(voxels, position, radius, |range| {
                let near = points[range].iter().filter(|&&point| {
                    let way = self.quantization.local(point) - position;
                    way.norm_squared() <= radius * radius
                });
                near.for_each(|&point| sum.add(point));
                ControlFlow::<()>::Continue(())
            });
        }
        (sum.count > 0).then(|| sum.local_mean(&self.quantization))
    }

    /// The point of the scan nearest to `position` within `radius` (CRS units), and its
    /// distance (CRS units); of equally near points the smallest.
    pub fn nearest(&self, position: Local, radius: f64) -> Option<(Stored, f64)> {
        self.nearest_but(None, position, radius)
    }

    /// The points of the scan and those of its filling, with the voxels that they lie in.
    fn parts(&self) -> [(&OccupiedCells, &[Stored]); 2] {
        [(&self.voxels, &self.points), (&self.filled, &self.filling)]
    }

    /// Calls `visit` with the range of points of every voxel of `voxels` that a ball touches,
    /// until it breaks.
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

    /// Distances (CRS units) from points of the scan to the nearest other one within `radius`
    /// (CRS units), for a sample of the points for which `wanted` is true. The inclusion
    /// probability of every point is `share`.
    pub fn sampled_distances(
        &self,
        share: f64,
        radius: f64,
        wanted: impl Fn(Stored) -> bool + Sync,
    ) -> Vec<f64> {
        // The hash of the elections would not do: their winners are no unbiased sample.
        let threshold = (share.clamp(0.0, 1.0) * u64::MAX as f64) as u64;
        let is_chosen = |point: Stored| point.priority(!0) <= threshold && wanted(point);
        (0..self.points.len())
            .into_par_iter()
            .with_max_len(ITEMS_PER_TASK)
            .filter(|&own| is_chosen(self.points[own]))
            .filter_map(|own| {
                self.nearest_but(Some(own), self.quantization.local(self.points[own]), radius)
            })
            .map(|(_, distance)| distance)
            .collect()
    }

    /// The point of the scan nearest to `position` within `radius` (CRS units) other than that
    /// with the index `own`, and its distance, searched in balls of growing radius.
    fn nearest_but(
        &self,
        own: Option<usize>,
        position: Local,
        radius: f64,
    ) -> Option<(Stored, f64)> {
        let mut reach = self.voxel.min(radius);
        loop {
            match self.nearest_within(own, position, reach) {
                Some((point, squared)) => return Some((point, squared.sqrt())),
                None if reach >= radius => return None,
                None => reach = (2.0 * reach).min(radius),
            }
        }
    }

    /// The point of the scan nearest to `position` within `radius` (CRS units) other than that
    /// with the index `own`, and its squared distance.
    fn nearest_within(
        &self,
        own: Option<usize>,
        position: Local,
        radius: f64,
    ) -> Option<(Stored, f64)> {
        let mut best: Option<(Stored, f64)> = None;
        let mut limit = radius * radius;
        let _ = self.voxels_around(&self.voxels, position, radius, |range| {
            for index in range.filter(|&index| Some(index) != own) {
                let point = self.points[index];
                let squared = (self.quantization.local(point) - position).norm_squared();
                if squared < limit || squared == limit && best.is_none_or(|(b, _)| point < b) {
                    best = Some((point, squared));
                    limit = squared;
                }
            }
            ControlFlow::<()>::Continue(())
        });
        best
    }
}

#[cfg(test)]
mod tests {
    use crate::lloyd::scan::points::tests::{cloud, scan};

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
}
