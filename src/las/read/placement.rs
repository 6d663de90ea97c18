//! Inputs in another CRS than that of the run: their points are brought to it as they are read.

use std::sync::Arc;

use super::input::{EntryPoints, InputFile, Placement};
use crate::las::{
    format::{chunk_table::Chunk, crs::Crs},
    reproject::{Reprojection, UtmZone, zone_around},
};

/// The coarsest scale that points are given in another CRS (CRS units).
const COARSEST_SCALE: f64 = 0.001;
/// How much the rectangle of a node of an octree is widened, in its edges: its image has curved sides.
const WIDENED: f64 = 0.01;

impl InputFile {
    /// The input with its points brought to another CRS.
    ///
    /// # Errors
    ///
    /// A text that says why they cannot be.
    pub(crate) fn reprojected(self, reprojection: &Arc<Reprojection>) -> Result<Self, String> {
        let surveyed = self.into_surveyed();
        let outside = || {
            format!(
                "its bounds, {:?} to {:?}, lie where {} is not defined; is its CRS right? give another with --crs, or \
                 another target",
                surveyed.bounds[0],
                surveyed.bounds[1],
                reprojection.crs.name()
            )
        };
        let bounds = match surveyed.points_claimed {
            0 => surveyed.bounds,
            _ => reprojection.bounds(surveyed.bounds).ok_or_else(outside)?,
        };
        let [min, max] = surveyed.bounds;
        let middle = [0, 1, 2].map(|axis| 0.5 * (min[axis] + max[axis]));
        let step = reprojection.step(middle, surveyed.scale);
        let decimal = 10_f64.powf(step.unwrap_or(COARSEST_SCALE).log10().floor());
        // So that a decimal scale is written as the decimal it is.
        let decimal = format!("{decimal:.12e}").parse().unwrap_or(decimal);
        let mut notes = surveyed.notes.clone();
        notes.extend(reprojection.notes.iter().cloned());
        Ok(Self {
            bounds,
            crs: Some(reprojection.crs.clone()),
            notes,
            entry_points: surveyed.entry_points.in_other_crs(reprojection),
            placement: Some(Placement {
                reprojection: reprojection.clone(),
                surveyed: Arc::new(surveyed.clone()),
                scale: decimal.min(COARSEST_SCALE),
            }),
            ..surveyed
        })
    }

    /// The input in the CRS `target`; as it is if it states no CRS, or if neither system has a code by which they could
    /// be told apart.
    ///
    /// # Errors
    ///
    /// A text that says why there is no way to it.
    pub(crate) fn in_crs(self, target: &Crs) -> Result<Self, String> {
        let Some(own) = &self.crs else {
            return Ok(self);
        };
        let codes = (own.horizontal_code(), target.horizontal_code());
        match codes {
            (Some(_), Some(code)) => match Reprojection::new(own, code)? {
                Some(way) => self.reprojected(&Arc::new(way)),
                None => Ok(self),
            },
            _ if own.is_geographic() != target.is_geographic() => Err(format!(
                "its CRS ({}) is not {}, and one of them has no EPSG code by which it could be reprojected",
                own.name(),
                target.name()
            )),
            _ => Ok(self),
        }
    }

    /// The input as its headers have it, before any reprojection.
    pub(crate) fn into_surveyed(self) -> Self {
        match self.placement {
            Some(placement) => Arc::unwrap_or_clone(placement.surveyed),
            None => self,
        }
    }

    /// The UTM zone of the middle of the file.
    ///
    /// # Errors
    ///
    /// A text that says why there is none.
    pub(crate) fn utm_zone(&self) -> Result<UtmZone, String> {
        let crs = self
            .crs
            .as_ref()
            .ok_or("states no CRS; give it with --crs")?;
        let area = self.bounds.map(|[x, y, _]| [x, y]);
        zone_around(&[(crs, area)]).map_err(|(_, problem)| problem)
    }

    /// The scale that loses nothing of the points, in units of their CRS.
    pub(crate) fn finest_scale(&self) -> f64 {
        let own = self.scale.into_iter().fold(f64::INFINITY, f64::min);
        self.placement
            .as_ref()
            .map_or(own, |placement| placement.scale)
    }

    /// The bounds in the coordinates of the file: min, max.
    pub(super) fn surveyed_bounds(&self) -> [[f64; 3]; 2] {
        let surveyed = self.placement.as_ref().map(|placement| &placement.surveyed);
        surveyed.map_or(self.bounds, |surveyed| surveyed.bounds)
    }

    /// The way of the points to the CRS of the run, if they take one.
    pub(super) fn reprojection(&self) -> Option<Arc<Reprojection>> {
        let placement = self.placement.as_ref();
        placement.map(|placement| placement.reprojection.clone())
    }

    /// A place in the coordinates of the file, in the CRS of the run; `None` where that has none.
    #[cfg(feature = "e57")]
    pub(super) fn placed(&self, place: [f64; 3]) -> Option<[f64; 3]> {
        match &self.placement {
            Some(placement) => placement.reprojection.point(place),
            None => Some(place),
        }
    }
}

impl EntryPoints {
    /// The entry points with the rectangles of chunks in another CRS.
    fn in_other_crs(&self, reprojection: &Reprojection) -> Self {
        let Self::Chunks { chunks, is_octree } = self else {
            return self.clone();
        };
        let image = |[min, max]: [[f64; 2]; 2]| {
            let flat = |[x, y]: [f64; 2]| [x, y, 0.0];
            // A rectangle without an image may have points all the same.
            let [min, max] = reprojection.bounds([flat(min), flat(max)])?;
            let wider = [0, 1].map(|axis| WIDENED * (max[axis] - min[axis]));
            Some([
                [min[0] - wider[0], min[1] - wider[1]],
                [max[0] + wider[0], max[1] + wider[1]],
            ])
        };
        let chunks = chunks.iter().map(|chunk| {
            let rectangle = chunk.rectangle.and_then(image);
            let stretched = chunk.rectangle.zip(rectangle).map(stretching);
            Chunk {
                rectangle,
                spacing_above: chunk
                    .spacing_above
                    .zip(stretched)
                    .map(|(above, by)| above * by),
                ..*chunk
            }
        });
        Self::Chunks {
            chunks: chunks.collect(),
            is_octree: *is_octree,
        }
    }
}

/// How many times as long a rectangle becomes along the axis on which it grows more.
fn stretching((rectangle, image): ([[f64; 2]; 2], [[f64; 2]; 2])) -> f64 {
    let along = |[min, max]: [[f64; 2]; 2], axis: usize| max[axis] - min[axis];
    let ratios = [0, 1].map(|axis| along(image, axis) / along(rectangle, axis));
    ratios[0].max(ratios[1])
}
