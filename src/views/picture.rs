//! A picture of clouds, in two passes over their points.
//!
//! The first pass takes a sample of the points, from which camera and colours are chosen; the
//! second draws every point as a disc.

use std::path::{Path, PathBuf};

use super::{
    coloring::{ColorRanges, Coloring},
    error::ViewError,
};
use crate::{
    geometry::{Quantization, Stored},
    las::{DisplayAttributes, InputFile, PointFilter, PointStream, RecordFormat, expand_inputs},
    picture::{Camera, Canvas, Scene, View},
};

/// How a picture is made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PictureOptions {
    /// The position and direction of the camera.
    pub(crate) view: View,
    /// What decides the colours of the points.
    pub(crate) coloring: Coloring,
    /// Width and height, in pixels.
    pub(crate) size: [u32; 2],
    /// The diameter of the points (CRS units); `None` takes it from their density.
    pub(crate) point_size: Option<f64>,
}

/// The expected number of points in the sample, at most.
const PICTURE_SAMPLE_POINTS: u64 = 200_000;
/// The share of the sample that counts as strays at either end of an axis.
const STRAY_COORDINATE_SHARE: f64 = 0.002;

/// Parses the path of a picture that is to be written, and checks that its name asks for PNG.
///
/// # Errors
///
/// A message with the formats that can be written and a name to give.
pub(crate) fn png_path(text: &str) -> Result<PathBuf, String> {
    let path = Path::new(text);
    match path.extension() {
        Some(extension) if extension.eq_ignore_ascii_case("png") => Ok(path.to_owned()),
        _ => Err(format!(
            "pictures are written as PNG only (.png); give {}",
            path.with_extension("png").display()
        )),
    }
}

/// Draws the points of `files`, and encodes the picture as PNG.
///
/// # Errors
///
/// [`ViewError::Las`] if a file cannot be read, [`ViewError::NoPoint`] if all are empty.
pub(crate) fn render(files: &[PathBuf], options: &PictureOptions) -> Result<Vec<u8>, ViewError> {
    let inputs = expand_inputs(files, &PointFilter::default())?
        .iter()
        .map(|path| InputFile::survey(path))
        .collect::<Result<Vec<InputFile>, _>>()?;
    let record = RecordFormat::for_inputs(&inputs)?;
    let quantization = InputFile::common_quantization(inputs.iter());
    let count = inputs.iter().map(|input| input.points_claimed).sum();
    let visit = |draw: &mut dyn FnMut(&[u8])| visit_records(&inputs, &record, quantization, draw);
    let png = draw_picture(options, count, record.has_color(), &quantization, &visit)?;
    match png.is_empty() {
        true => Err(ViewError::NoPoint),
        false => Ok(png),
    }
}

/// A function that calls its argument with every record of a cloud.
pub(super) type VisitRecords<'a> = dyn Fn(&mut dyn FnMut(&[u8])) -> Result<(), ViewError> + 'a;

/// Draws the `count` points of a cloud, which `visit` goes through twice, and encodes the picture
/// as PNG; the result is empty if there are no points.
///
/// # Errors
///
/// The errors of `visit`; [`ViewError::Encoding`] if the encoder fails.
pub(crate) fn draw_picture(
    options: &PictureOptions,
    count: u64,
    has_color: bool,
    quantization: &Quantization,
    visit: &VisitRecords<'_>,
) -> Result<Vec<u8>, ViewError> {
    // The first pass: a sample with equal inclusion probabilities.
    let mut sample = PictureSample::default();
    sample.add_cloud(count, has_color, quantization, visit)?;
    let Some(scene) = sample.scene() else {
        return Ok(Vec::new());
    };
    // The second pass: every point as a disc.
    let Scene { min, max, .. } = scene;
    let ground_area = (max[0] - min[0]) * (max[1] - min[1]);
    let frame = Frame {
        camera: Camera::new(options.view, &scene, options.size),
        heights: [min[2], max[2]],
        colors: &sample.colors,
        coloring: sample.colors.resolve(options.coloring),
        has_color,
        diameter: options
            .point_size
            .unwrap_or_else(|| (ground_area / count as f64).sqrt()),
    };
    let mut canvas = Canvas::new(options.size);
    visit(&mut |record| frame.draw(record, quantization, &mut canvas))?;
    let mut png = Vec::new();
    canvas.write_png(&mut png).map_err(ViewError::Encoding)?;
    Ok(png)
}

/// A sample of the points of clouds, by which camera and colours are chosen.
#[derive(Default)]
pub(super) struct PictureSample {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) colors: ColorRanges,
}

impl PictureSample {
    /// Adds a sample, with equal inclusion probabilities, of a cloud of `count` points that `visit` goes through.
    ///
    /// # Errors
    ///
    /// The errors of `visit`.
    pub(super) fn add_cloud(
        &mut self,
        count: u64,
        has_color: bool,
        quantization: &Quantization,
        visit: &VisitRecords<'_>,
    ) -> Result<(), ViewError> {
        let threshold = (u64::MAX / count.max(1)).saturating_mul(PICTURE_SAMPLE_POINTS);
        visit(&mut |record| {
            let point = Stored::of_record(record);
            if count <= PICTURE_SAMPLE_POINTS || point.tie_break_hash() <= threshold {
                self.positions.push(quantization.world(point));
                let attributes = DisplayAttributes::of_record(record, has_color);
                self.colors.add(&attributes);
            }
        })?;
        self.colors.sort();
        Ok(())
    }

    /// The extent of the sample without strays; `None` without points.
    pub(super) fn scene(&self) -> Option<Scene> {
        Scene::of(&self.positions, STRAY_COORDINATE_SHARE)
    }
}

/// How points are drawn on a frame.
pub(super) struct Frame<'a> {
    pub(super) camera: Camera,
    /// The heights of the lowest and the highest colour (CRS units).
    pub(super) heights: [f64; 2],
    pub(super) colors: &'a ColorRanges,
    /// What decides the colours, resolved.
    pub(super) coloring: Coloring,
    /// Whether records contain a colour.
    pub(super) has_color: bool,
    /// The diameter of the points (CRS units).
    pub(super) diameter: f64,
}

impl Frame<'_> {
    /// Draws the point of `record` on `canvas`, if the camera sees it.
    pub(super) fn draw(&self, record: &[u8], quantization: &Quantization, canvas: &mut Canvas) {
        let position = quantization.world(Stored::of_record(record));
        if let Some((at, depth, scale)) = self.camera.project(position) {
            let [lowest, highest] = self.heights;
            let height = (position[2] - lowest) / (highest - lowest).max(1e-9);
            let attributes = DisplayAttributes::of_record(record, self.has_color);
            let color = self.colors.color(self.coloring, &attributes, height);
            canvas.disc(at, depth, 0.5 * self.diameter * scale, color);
        }
    }
}

/// Calls `visit` with every record of `inputs`.
///
/// # Errors
///
/// [`ViewError::Las`] if a file cannot be read.
pub(super) fn visit_records(
    inputs: &[InputFile],
    record: &RecordFormat,
    quantization: Quantization,
    visit: &mut dyn FnMut(&[u8]),
) -> Result<(), ViewError> {
    let mut records = Vec::new();
    for input in inputs {
        let (all, filter) = (0..input.points_claimed, PointFilter::default());
        let mut stream = PointStream::open(input, all, record, quantization, &filter)?;
        while stream.next_batch(&mut records)?.read > 0 {
            records
                .chunks_exact(record.record_length())
                .for_each(&mut *visit);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_is_not_named_png_is_refused_with_a_name_that_is() {
        for good in ["even.png", "a/b.PNG"] {
            assert_eq!(png_path(good).unwrap(), Path::new(good));
        }
        for (bad, remedy) in [("x.jpg", "x.png"), ("a/x", "a/x.png"), ("x.", "x.png")] {
            let error = png_path(bad).unwrap_err();
            assert!(error.contains("PNG") && error.ends_with(remedy), "{error}");
        }
    }
}
