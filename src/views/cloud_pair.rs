//! The input and the output of a job, side by side.

use super::error::ViewError;
use crate::{
    geometry::{Quantization, Rect, Stored},
    las::{RealAttribute, RecordView},
    tile::{SettledTiles, Spill},
    tiling::Plan,
};

/// The input of a job in its spill, and the output in the settled tiles. Lengths are CRS units.
pub(crate) struct CloudPair<'a> {
    /// The tiles of the job.
    pub(crate) plan: &'a Plan,
    /// The points of the input.
    pub(crate) spill: &'a Spill,
    /// The points of the output.
    pub(crate) settled: &'a SettledTiles,
    /// The length of a record, in bytes.
    pub(crate) record_length: usize,
    /// Whether records contain a colour.
    pub(crate) has_color: bool,
    /// The number of points of the output for each point of the input.
    pub(crate) sites_per_point: f64,
    /// Scale and offset of both clouds.
    pub(crate) quantization: &'a Quantization,
    /// The spacing of the output; the coarsest one if it varies.
    pub(crate) spacing: f64,
    /// Where records contain the spacing that is wanted at their point; `None` if it is the same everywhere.
    pub(crate) spacing_at_points: Option<RealAttribute>,
}

impl CloudPair<'_> {
    /// The factor by which distances from the point of `record` are those of a cloud with one spacing.
    pub(crate) fn scale_at(&self, record: &[u8]) -> f64 {
        let wanted = self.spacing_at_points;
        wanted.map_or(1.0, |at| {
            self.spacing / f64::from(RecordView::new(record).real(at))
        })
    }

    /// Calls `visit` with every record of the output, in the order of the plan.
    ///
    /// # Errors
    ///
    /// [`ViewError::Tile`] if the settled tiles cannot be read.
    pub(crate) fn visit_output(&self, visit: &mut dyn FnMut(&[u8])) -> Result<(), ViewError> {
        for tile in &self.plan.tiles {
            self.visit_tile(tile.id, &mut *visit)?;
        }
        Ok(())
    }

    /// Calls `visit` with the point and the record of every point of the output in `square`. A
    /// site may have moved out of the core of its tile by up to `margin` (stored units).
    pub(super) fn gather_output(
        &self,
        square: &Rect,
        margin: i64,
        mut visit: impl FnMut(Stored, &[u8]),
    ) -> Result<(), ViewError> {
        let near = square.grown(margin);
        for tile in self.plan.tiles.iter().filter(|t| t.core.intersects(&near)) {
            self.visit_tile(tile.id, |record| {
                let point = Stored::of_record(record);
                if square.contains(point) {
                    visit(point, record);
                }
            })?;
        }
        Ok(())
    }

    /// Returns the horizontal coordinates of the site of `tile` that is nearest to `target` (stored
    /// units), or to the mean of the tile's sites without a target; `None` if it has no site.
    pub(super) fn site_near(
        &self,
        tile: u32,
        target: Option<[i64; 2]>,
    ) -> Result<Option<[i64; 2]>, ViewError> {
        let mut sites = Vec::new();
        self.visit_tile(tile, |record| {
            let Stored { x, y, .. } = Stored::of_record(record);
            sites.push([i64::from(x), i64::from(y)]);
        })?;
        let Some([x, y]) = target.or_else(|| mean(&sites)) else {
            return Ok(None);
        };
        let distance_squared =
            |&[a, b]: &[i64; 2]| i128::from(a - x).pow(2) + i128::from(b - y).pow(2);
        Ok(sites
            .into_iter()
            .min_by_key(|site| (distance_squared(site), *site)))
    }

    fn visit_tile(&self, tile: u32, visit: impl FnMut(&[u8])) -> Result<(), ViewError> {
        let records = self.settled.records(tile)?;
        records.chunks_exact(self.record_length).for_each(visit);
        Ok(())
    }
}

/// The mean of `points`, rounded towards zero; `None` if there are none.
fn mean(points: &[[i64; 2]]) -> Option<[i64; 2]> {
    let count = i64::try_from(points.len()).ok().filter(|&n| n > 0)?;
    Some([0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<i64>() / count))
}
