//! The figures of a cloud, collected part by part.

use super::marked_points::gather_marked;
use crate::{
    geometry::{NeighborGrid, Quantization, Rect, Stored},
    job::JobError,
    lloyd::{Scan, SolverOptions, TileRegion, describe_points, uniformity},
    quality::{DistanceTally, UniformityTally},
    tile::Spill,
    tiling::Plan,
};

/// The reach of a patch through a finished cloud, in spacings: two rings of neighbours,
/// approximately eighteen points.
const MEASURED_FIT_RADIUS_IN_SPACINGS: f64 = 2.3;

/// How the parts of a cloud are measured. Lengths are CRS units.
pub(super) struct Measurement<'a> {
    /// The points of the cloud and of the scans it is compared with.
    pub(super) spill: &'a Spill,
    /// The parts.
    pub(super) plan: &'a Plan,
    /// Scale and offset of the points.
    pub(super) quantization: Quantization,
    /// The unit of the distances.
    pub(super) spacing: f64,
    /// The largest distance at which a nearest point is searched for; `None` if the cloud is
    /// compared with no scans.
    pub(super) comparison_reach: Option<f64>,
}

/// The figures of the parts that have been measured.
pub(super) struct CloudTally {
    /// The number of points of the cloud.
    pub(super) points: u64,
    /// Nearest distances and cells of the cloud.
    pub(super) uniformity: UniformityTally,
    /// The distances from the cloud to the scans.
    pub(super) accuracy: DistanceTally,
    /// The distances from the scans to the cloud.
    pub(super) coverage: DistanceTally,
}

impl Measurement<'_> {
    /// Measures all parts.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read.
    pub(super) fn tally(&self) -> Result<CloudTally, JobError> {
        let mut tally = CloudTally {
            points: 0,
            uniformity: UniformityTally::new(self.spacing),
            accuracy: DistanceTally::new(self.spacing),
            coverage: DistanceTally::new(self.spacing),
        };
        for part in &self.plan.tiles {
            let known = part.core.grown(self.plan.halo);
            let (cloud, scan) = gather_marked(self.spill, &known)?;
            tally.points += cloud.iter().filter(|&&p| part.core.contains(p)).count() as u64;
            if let Some(reach) = self.comparison_reach {
                self.compare(&part.core, &cloud, &scan, reach, &mut tally.accuracy);
                self.compare(&part.core, &scan, &cloud, reach, &mut tally.coverage);
            }
            tally
                .uniformity
                .add(&self.uniformity(cloud, known, part.core));
        }
        Ok(tally)
    }

    /// Adds the distances from the points of `from` in `core` to the nearest points of `to`; a
    /// distance beyond `reach` counts as `reach`.
    fn compare(
        &self,
        core: &Rect,
        from: &[Stored],
        to: &[Stored],
        reach: f64,
        tally: &mut DistanceTally,
    ) {
        let to: Vec<_> = to.iter().map(|&p| self.quantization.local(p)).collect();
        let grid = NeighborGrid::new(&to, self.spacing);
        for &point in from.iter().filter(|&&p| core.contains(p)) {
            let nearest = grid.nearest(self.quantization.local(point), reach, |_| false);
            tally.push(nearest.map_or(reach, |(_, distance_squared)| distance_squared.sqrt()));
        }
    }

    /// Measures the nearest distances and the cells of the points in `core`, given the points of
    /// the cloud in `known`.
    fn uniformity(&self, cloud: Vec<Stored>, known: Rect, core: Rect) -> UniformityTally {
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
        let sites = describe_points(&scan, &region, &options);
        let in_core = sites.iter().filter(|site| core.contains(site.identity));
        uniformity(in_core, self.spacing)
    }
}
