//! Write: one cloud of all tiles, with the distances between its points, across seams as elsewhere.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{stitch::adjacent, tile_solver::BAND_IN_SPACINGS};
use crate::{
    geometry::{Local, NeighborGrid, Rect, Stored},
    job::{error::JobError, progress::Progress},
    quality::{SpacingTally, UniformityTally},
    tile::SeamTally,
    tiling::Tile,
    views::{CloudPair, UniformityMap},
};

/// Largest distance of a point on a seam from the core of another tile, in spacings.
const SEAM_IN_SPACINGS: f64 = 2.0;

/// Largest distance at which sites end from the core in which they are at home, in spacings.
const FARTHEST_SITE_IN_SPACINGS: f64 = 2.0 * BAND_IN_SPACINGS;

/// The figures of the whole cloud, as written. Lengths are CRS units; where the spacing varies, those of points that are scaled
/// to the coarsest spacing, each by its own.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Stitched {
    /// How well tiles agreed on the sites that they share.
    pub(crate) seams: SeamTally,
    /// Nearest distances of all points.
    pub(crate) all: UniformityTally,
    /// Nearest distances of points within two spacings of another tile.
    pub(crate) on_seams: UniformityTally,
    /// Nearest distances of all other points.
    pub(crate) elsewhere: UniformityTally,
    /// Number of points that were written at the position of another one.
    pub(crate) duplicates: u64,
    /// The wanted spacings, if they vary.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) spacings: Option<SpacingTally>,
}

impl Stitched {
    fn new(seams: SeamTally, spacing: f64) -> Self {
        let tally = || UniformityTally::new(spacing);
        Self {
            seams,
            all: tally(),
            on_seams: tally(),
            elsewhere: tally(),
            duplicates: 0,
            spacings: None,
        }
    }

    /// Adds a point by the distance to its nearest neighbour; `None` if that is out of reach.
    fn push(&mut self, nearest: Option<f64>, is_on_seam: bool) {
        let Some(distance) = nearest else {
            self.all.push_alone();
            return;
        };
        self.duplicates += u64::from(distance == 0.0);
        self.all.push_distance(distance);
        match is_on_seam {
            true => self.on_seams.push_distance(distance),
            false => self.elsewhere.push_distance(distance),
        }
    }
}

/// Passes the records of the settled tiles of `cloud` to `write` in the order of the plan, and adds their points to `map`.
/// Returns the figures of the cloud, and δ of the points of each tile.
///
/// # Errors
///
/// [`JobError`] if settled tiles cannot be read, or the output cannot be written.
pub(super) fn write_tiles(
    cloud: &CloudPair<'_>,
    seams: SeamTally,
    map: &mut UniformityMap,
    write: &mut dyn FnMut(&[u8]) -> Result<(), JobError>,
    progress: &dyn Progress,
) -> Result<(Stitched, Vec<f64>), JobError> {
    let seam = cloud.quantization.units(SEAM_IN_SPACINGS * cloud.spacing);
    let mut stitched = Stitched::new(seams, cloud.spacing);
    stitched.spacings = (cloud.spacing_at_points).map(|_| SpacingTally::new(cloud.spacing));
    let mut delta_by_tile = Vec::new();
    for tile in &cloud.plan.tiles {
        // Measure the nearest distances, to points of neighbouring tiles, too.
        let records = cloud.settled.records(tile.id)?;
        let nearest = nearest_distances(cloud, tile, &records)?;

        // Tally them.
        let others = adjacent(cloud.plan, tile, reach(cloud)).map(|other| other.core);
        let others: Vec<Rect> = others.collect();
        let mut tile_tally = UniformityTally::new(cloud.spacing);
        let records_of_points = records.chunks_exact(cloud.record_length);
        for (record, nearest) in records_of_points.zip(nearest) {
            let point = Stored::of_record(record);
            let scale = cloud.scale_at(record);
            if let Some(spacings) = &mut stitched.spacings {
                spacings.push(cloud.spacing / scale);
            }
            let nearest = nearest.map(|distance| scale * distance);
            map.push(point, nearest, cloud.spacing);
            stitched.push(nearest, others.iter().any(|core| core.depth(point) > -seam));
            if let Some(distance) = nearest {
                tile_tally.push_distance(distance);
            }
        }
        delta_by_tile.push(tile_tally.figures().delta);

        // Write the records.
        write(&records)?;
        progress.advance(1);
    }
    Ok((stitched, delta_by_tile))
}

/// The distance of each point in the `records` of `tile` to the nearest other point of the cloud;
/// `None` if there is none within a band.
fn nearest_distances(
    cloud: &CloudPair<'_>,
    tile: &Tile,
    records: &[u8],
) -> Result<Vec<Option<f64>>, JobError> {
    let (quantization, spacing, length) = (cloud.quantization, cloud.spacing, cloud.record_length);
    let mut positions: Vec<Local> = records
        .chunks_exact(length)
        .map(|record| quantization.local(Stored::of_record(record)))
        .collect();
    let own = positions.len();
    let wide = tile.core.grown(reach(cloud));
    for other in adjacent(cloud.plan, tile, reach(cloud)) {
        positions.extend(
            cloud
                .settled
                .records(other.id)?
                .chunks_exact(length)
                .map(Stored::of_record)
                .filter(|&point| wide.contains(point))
                .map(|point| quantization.local(point)),
        );
    }
    let grid = NeighborGrid::new(&positions, spacing);
    Ok((0..own)
        .into_par_iter()
        .map(|index| {
            let is_own = |other: u32| other as usize == index;
            let nearest = grid.nearest(positions[index], BAND_IN_SPACINGS * spacing, is_own);
            nearest.map(|(_, squared)| squared.sqrt())
        })
        .collect())
}

/// [`FARTHEST_SITE_IN_SPACINGS`] in stored units.
fn reach(cloud: &CloudPair<'_>) -> i64 {
    cloud
        .quantization
        .units(FARTHEST_SITE_IN_SPACINGS * cloud.spacing)
}
