//! The figures of a cloud, collected part by part; points whose nearest neighbour no part sees, at the end.

use super::{bare_points::gather_bare, far_neighbors::FarNeighbors, measurement::Measurement};
use crate::{
    geometry::{Rect, Stored},
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
}

impl Measurement<'_> {
    /// Measures all parts.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read.
    pub(super) fn tally(&self) -> Result<CloudTally, JobError> {
        let mut points = 0;
        let mut uniformity = UniformityTally::new(self.spacing);
        let mut alone = FarNeighbors::new(self);
        for part in &self.plan.tiles {
            let known = part.core.grown(self.plan.halo);
            let cloud = gather_bare(self.spill, &known)?;
            points += cloud.iter().filter(|&&p| part.core.contains(p)).count() as u64;
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
        })
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
