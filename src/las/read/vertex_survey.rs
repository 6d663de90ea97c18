//! The survey of files whose headers do not state the bounds of their points (PLY, E57):
//! all points are read.

use std::path::Path;

use ::las::point::Format;

#[cfg(feature = "e57")]
use super::e57::E57File;
use super::{
    input::{EntryPoints, FARTHEST_COORDINATE, InputFile},
    ply::PlyFile,
};
use crate::{
    geometry::longest_side,
    las::{
        error::LasError,
        format::{extra_bytes::total_length, vertex_layout::VertexLayout},
    },
    store::Source,
};

/// The finest scale that is given to points, in CRS units.
const FINEST_SCALE: f64 = 1e-9;

/// The number and the bounds of points.
struct PositionTally {
    count: u64,
    bounds: [[f64; 3]; 2],
}

impl PositionTally {
    fn new() -> Self {
        Self {
            count: 0,
            bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
        }
    }

    /// Adds a point of the file at `path`.
    fn add(&mut self, path: &Path, position: [f64; 3]) -> Result<(), LasError> {
        // Written so that NaN fails.
        if !position.iter().all(|c| c.abs() <= FARTHEST_COORDINATE) {
            let problem = format!(
                "point {} is at {position:?}; coordinates have to be numbers of at most \
                 {FARTHEST_COORDINATE:e}: remove the point",
                self.count
            );
            return Err(LasError::new(path, problem));
        }
        for (axis, &c) in position.iter().enumerate() {
            self.bounds[0][axis] = self.bounds[0][axis].min(c);
            self.bounds[1][axis] = self.bounds[1][axis].max(c);
        }
        self.count += 1;
        Ok(())
    }
}

impl InputFile {
    /// Reads all vertices of the polygon file `source`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, or a coordinate is not finite or farther than 10¹².
    pub(super) fn survey_ply(source: Source) -> Result<Self, LasError> {
        let path = source.path();
        let file = PlyFile::survey(path)?;
        let mut tally = PositionTally::new();
        let mut stream = file.open()?;
        while let Some(position) = stream.next_position()? {
            tally.add(path, position)?;
        }
        let (crs, has_standard_time) = (file.crs(), file.has_standard_time());
        let layout = file.layout();
        Ok(Self {
            crs,
            has_standard_time,
            ..Self::of_vertices(source, &layout, &tally, EntryPoints::Ply(file))?
        })
    }

    /// Reads all points of the E57 file `source`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, or a coordinate is not finite or farther than 10¹².
    #[cfg(feature = "e57")]
    pub(super) fn survey_e57(source: Source) -> Result<Self, LasError> {
        let path = source.path();
        let file = E57File::survey(path)?;
        let mut tally = PositionTally::new();
        for values in file.open() {
            let values = values.map_err(|problem| LasError::new(path, problem))?;
            tally.add(path, [values[0], values[1], values[2]])?;
        }
        let layout = file.layout();
        Ok(Self {
            crs: file.crs(),
            ..Self::of_vertices(source, &layout, &tally, EntryPoints::E57(file))?
        })
    }

    fn of_vertices(
        source: Source,
        layout: &VertexLayout,
        tally: &PositionTally,
        entry_points: EntryPoints,
    ) -> Result<Self, LasError> {
        let path = source.path();
        let mut notes = Vec::new();
        let mut bounds = tally.bounds;
        if tally.count == 0 {
            notes.push("has no points".to_owned());
            bounds = [[0.0; 3]; 2];
        }
        let [min, max] = bounds;
        let mut format =
            Format::new(layout.point_format).map_err(|e| LasError::unreadable(path, e))?;
        let extra = total_length(&layout.extra_bytes);
        format.extra_bytes = u16::try_from(extra).map_err(|_| {
            let problem = format!(
                "its vertices have {extra} bytes of properties that LAS has no field for; at \
                 most {} can be carried",
                u16::MAX
            );
            LasError::new(path, problem)
        })?;
        Ok(Self {
            path: path.to_owned(),
            bytes: source.bytes(),
            source,
            version: [1, 0],
            points_claimed: tally.count,
            bounds_claimed: bounds,
            bounds,
            scale: [scale_for(&bounds, layout.is_single); 3],
            offset: [0, 1, 2].map(|axis| (0.5 * (min[axis] + max[axis])).round()),
            crs: None,
            extra_bytes: layout.extra_bytes.clone(),
            carried_records: Vec::new(),
            has_standard_time: false,
            generating_software: String::new(),
            notes,
            points_start: 0,
            format,
            entry_points,
            placement: None,
            finest_spacing: None,
        })
    }

    /// Whether the coordinates of a PLY or E57 file have the finest steps that there are, so that those of a very small
    /// scan are rounded.
    pub(crate) fn has_finest_steps(&self) -> bool {
        self.is_of_vertices() && self.scale.contains(&FINEST_SCALE)
    }
}

/// The scale for points within `bounds`, a power of ten: finer than what single precision
/// can distinguish, or a billionth of the extent.
fn scale_for(bounds: &[[f64; 3]; 2], is_single: bool) -> f64 {
    let [min, max] = bounds;
    let extent = longest_side(*min, *max);
    let sides = bounds.iter().flatten();
    let farthest = sides.fold(0.0, |f: f64, c| f.max(c.abs()));
    let finest = match is_single {
        true => 0.01 * f64::from(f32::EPSILON) * farthest,
        false => 1e-9 * extent,
    };
    let scale = 10_f64.powf(finest.max(FINEST_SCALE).log10().ceil());
    // So that a decimal scale is written as the decimal it is.
    format!("{scale:.12e}").parse().unwrap_or(scale)
}
