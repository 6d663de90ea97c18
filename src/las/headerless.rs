//! Files that do not say where their points are: all are looked at.

use std::path::Path;

use ::las::point::Format;

#[cfg(feature = "e57")]
use super::e57::E57File;
use super::{
    InputFile, LasError, PlyFile,
    ply::PlyLayout,
    reading::{Access, FARTHEST_OFFSET},
};

/// Where points are, and how many.
struct Places {
    count: u64,
    bounds: [[f64; 3]; 2],
}

impl Places {
    fn none() -> Self {
        Self {
            count: 0,
            bounds: [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
        }
    }

    fn add(&mut self, path: &Path, place: [f64; 3]) -> Result<(), LasError> {
        if !place.iter().all(|c| c.abs() <= FARTHEST_OFFSET) {
            let problem = format!("its point {} is at no place: {place:?}", self.count);
            return Err(LasError::new(path, problem));
        }
        for (axis, &c) in place.iter().enumerate() {
            self.bounds[0][axis] = self.bounds[0][axis].min(c);
            self.bounds[1][axis] = self.bounds[1][axis].max(c);
        }
        self.count += 1;
        Ok(())
    }
}

impl InputFile {
    /// Reads all vertices of the polygon file at `path`.
    pub(super) fn survey_ply(path: &Path, bytes: u64) -> Result<Self, LasError> {
        let file = PlyFile::survey(path)?;
        let mut places = Places::none();
        let mut stream = file.open()?;
        while let Some(place) = stream.next_place()? {
            places.add(path, place)?;
        }
        let (crs, has_standard_time) = (file.crs(), file.has_standard_time());
        Ok(Self {
            crs,
            has_standard_time,
            ..Self::headerless(path, bytes, &file.layout(), &places, Access::Ply(file))?
        })
    }

    /// Reads all points of the E57 file at `path`.
    #[cfg(feature = "e57")]
    pub(super) fn survey_e57(path: &Path, bytes: u64) -> Result<Self, LasError> {
        let file = E57File::survey(path)?;
        let mut places = Places::none();
        let stream = file.open();
        for values in stream {
            let values = values.map_err(|problem| LasError::new(path, problem))?;
            places.add(path, [values[0], values[1], values[2]])?;
        }
        Ok(Self {
            crs: file.crs(),
            ..Self::headerless(path, bytes, &file.layout(), &places, Access::E57(file))?
        })
    }

    fn headerless(
        path: &Path,
        bytes: u64,
        layout: &PlyLayout,
        places: &Places,
        access: Access,
    ) -> Result<Self, LasError> {
        let mut notes = Vec::new();
        let mut bounds = places.bounds;
        if places.count == 0 {
            notes.push("holds no point".to_owned());
            bounds = [[0.0; 3]; 2];
        }
        let [min, max] = bounds;
        let extent = (0..3).map(|axis| max[axis] - min[axis]).fold(0.0, f64::max);
        let sides = bounds.iter().flatten();
        let farthest = sides.fold(0.0, |f: f64, c| f.max(c.abs()));
        // Finer than what single precision can tell, or a billionth across.
        let finest = match layout.is_single {
            true => 0.01 * f64::from(f32::EPSILON) * farthest,
            false => 1e-9 * extent,
        };
        let scale = 10_f64.powf(finest.max(1e-9).log10().ceil());
        // So that a decimal scale is written as the decimal it is.
        let scale = format!("{scale:.12e}").parse().unwrap_or(scale);
        let mut format = Format::new(layout.point_format)
            .map_err(|e| LasError::new(path, format!("cannot be read: {e}")))?;
        let extra: usize = layout.extra_bytes.iter().map(|extra| extra.length).sum();
        format.extra_bytes = u16::try_from(extra)
            .map_err(|_| LasError::new(path, "its vertices have too many properties"))?;
        Ok(Self {
            path: path.to_owned(),
            bytes,
            version: [1, 0],
            points_claimed: places.count,
            bounds_claimed: bounds,
            bounds,
            scale: [scale; 3],
            offset: [0, 1, 2].map(|axis| (0.5 * (min[axis] + max[axis])).round()),
            crs: None,
            extra_bytes: layout.extra_bytes.clone(),
            kept_records: Vec::new(),
            has_standard_time: false,
            generating_software: String::new(),
            notes,
            format,
            access,
        })
    }
}
