//! The figures of a cloud, collected part by part; points whose nearest neighbour no part sees, at the end.

use super::{
    far_neighbors::FarNeighbors,
    marked_points::{Mark, gather_marked},
    measurement::Measurement,
};
use crate::{
    geometry::{NeighborGrid, Rect, Stored},
    job::JobError,
    lloyd::{Scan, Site, SolverOptions, TileRegion, describe_points, uniformity as tally_sites},
    quality::{DistanceTally, UniformityTally},
};

/// The reach of a patch through a finished cloud, in spacings: two rings of neighbours,
/// approximately eighteen points.
const MEASURED_FIT_RADIUS_IN_SPACINGS: f64 = 2.3;

/// The figures of the parts that have been measured.
pub(super) struct CloudTally {
    /// The number of points of the cloud.
    pub(super) points: u64,
    /// Nearest distances and cells of the cloud.
    pub(super) uniformity: UniformityTally,
    /// The nearest distances of the points that have no part in the figures of uniformity, because they
    /// have no neighbour within a few spacings.
    pub(super) alone: DistanceTally,
    /// The distances from the cloud to the scans.
    pub(super) accuracy: DistanceTally,
    /// The distances from the scans to the cloud.
    pub(super) coverage: DistanceTally,
}

/// A direction in which clouds are compared: the distances within reach, and the points beyond.
struct Comparison<'a> {
    tally: DistanceTally,
    far: FarNeighbors<'a>,
}

impl<'a> Comparison<'a> {
    fn new(measurement: &'a Measurement<'a>, is_target: fn(&[u8]) -> bool) -> Self {
        Self {
            tally: DistanceTally::new(measurement.spacing),
            far: FarNeighbors::new(measurement, is_target),
        }
    }

    fn into_distances(mut self) -> Result<DistanceTally, JobError> {
        self.tally.add(&self.far.into_distances()?);
        Ok(self.tally)
    }
}

impl Measurement<'_> {
    /// Measures all parts.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read.
    pub(super) fn tally(&self) -> Result<CloudTally, JobError> {
        let is_cloud = |record: &[u8]| Mark::of_record(record) == Mark::Cloud;
        let is_scan = |record: &[u8]| Mark::of_record(record) == Mark::Scan;
        let mut points = 0;
        let mut uniformity = UniformityTally::new(self.spacing);
        let mut alone = FarNeighbors::new(self, is_cloud);
        let mut accuracy = Comparison::new(self, is_scan);
        let mut coverage = Comparison::new(self, is_cloud);
        for part in &self.plan.tiles {
            let known = part.core.grown(self.plan.halo);
            let (cloud, scan) = gather_marked(self.spill, &known)?;
            points += cloud.iter().filter(|&&p| part.core.contains(p)).count() as u64;
            if let Some(reach) = self.comparison_reach {
                self.compare(&part.core, &cloud, &scan, reach, &mut accuracy)?;
                self.compare(&part.core, &scan, &cloud, reach, &mut coverage)?;
            }
            let sites = self.describe(cloud, known, part.core);
            let in_core = || {
                sites
                    .iter()
                    .filter(|site| part.core.contains(site.identity))
            };
            uniformity.add(&tally_sites(in_core(), self.spacing));
            for site in in_core().filter(|site| !site.nearest.is_finite()) {
                alone.push(site.identity)?;
            }
        }
        Ok(CloudTally {
            points,
            uniformity,
            alone: alone.into_distances()?,
            accuracy: accuracy.into_distances()?,
            coverage: coverage.into_distances()?,
        })
    }

    /// Adds the distances from the points of `from` in `core` to the nearest points of `to`; a point that
    /// has none within `reach` waits.
    fn compare(
        &self,
        core: &Rect,
        from: &[Stored],
        to: &[Stored],
        reach: f64,
        comparison: &mut Comparison<'_>,
    ) -> Result<(), JobError> {
        let to: Vec<_> = to.iter().map(|&p| self.quantization.local(p)).collect();
        let grid = NeighborGrid::new(&to, self.spacing);
        for &point in from.iter().filter(|&&p| core.contains(p)) {
            match grid.nearest(self.quantization.local(point), reach, |_| false) {
                Some((_, distance_squared)) => comparison.tally.push(distance_squared.sqrt()),
                None => comparison.far.push(point)?,
            }
        }
        Ok(())
    }

    /// The points of the cloud in `core` and around it as sites, given those in `known`.
    fn describe(&self, cloud: Vec<Stored>, known: Rect, core: Rect) -> Vec<Site> {
        let options = SolverOptions {
            fit_radius: MEASURED_FIT_RADIUS_IN_SPACINGS * self.spacing,
            ..SolverOptions::new(self.spacing)
        };
        let scan = Scan::as_scanned(cloud, self.quantization, &options);
        let region = TileRegion {
            available: known,
            core,
            band: self.plan.halo,
        };
        describe_points(&scan, &region, &options)
    }
}
