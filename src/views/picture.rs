//! A picture of clouds, in one pass over their points.

use std::path::PathBuf;

use serde::Deserialize;

use super::ViewError;
use crate::{
    geometry::{Quantization, Stored, spread},
    las::{DisplayAttributes, InputFile, PointFilter, PointStream, RecordFormat, expand_inputs},
    picture::{Camera, Canvas, Scene, View},
};

/// What points are coloured by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Coloring {
    /// Their colour if they have one, else their height.
    #[default]
    Auto,
    /// Height above the lowest.
    Height,
    /// Intensity.
    Intensity,
    /// Class.
    Class,
}

/// How a picture is made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PictureOptions {
    /// Where it is taken from.
    pub(crate) view: View,
    /// What points are coloured by.
    pub(crate) coloring: Coloring,
    /// Pixels to the right and downwards.
    pub(crate) size: [u32; 2],
    /// Diameter of the points (CRS units); `None`: by how dense they are.
    pub(crate) point_size: Option<f64>,
}

/// Points that are looked at to find out where most are.
const SAMPLED: u64 = 200_000;
/// Of those, the share that is left out at either end of an axis: strays.
const STRAY: f64 = 0.002;

/// The points of `files` as a picture in PNG.
///
/// # Errors
///
/// If a file cannot be read; [`ViewError::NoPoint`] if there is none.
pub(crate) fn render(files: &[PathBuf], picture: &PictureOptions) -> Result<Vec<u8>, ViewError> {
    let inputs = expand_inputs(files)?
        .iter()
        .map(|path| InputFile::survey(path))
        .collect::<Result<Vec<InputFile>, _>>()?;
    let record = RecordFormat::for_inputs(&inputs)?;
    let quantization = InputFile::common_quantization(inputs.iter());
    let count = inputs.iter().map(|input| input.points_claimed).sum();
    let visit = |draw: &mut dyn FnMut(&[u8])| visit(&inputs, &record, quantization, draw);
    let content = draw_picture(picture, count, record.has_color(), &quantization, &visit)?;
    if content.is_empty() {
        return Err(ViewError::NoPoint);
    }
    Ok(content)
}

/// Calls its argument with every record.
pub(crate) type Visit<'a> = dyn Fn(&mut dyn FnMut(&[u8])) -> Result<(), ViewError> + 'a;

/// A picture, in PNG, of the `count` points that `visit` goes through, twice; nothing if
/// there are none.
pub(crate) fn draw_picture(
    picture: &PictureOptions,
    count: u64,
    has_color: bool,
    quantization: &Quantization,
    visit: &Visit<'_>,
) -> Result<Vec<u8>, ViewError> {
    let threshold = (u64::MAX / count.max(1)).saturating_mul(SAMPLED);
    let mut sample = Sample::default();
    visit(&mut |record| {
        let point = Stored::of_record(record);
        if count <= SAMPLED || point.tie_break_hash() <= threshold {
            sample.add(
                quantization.world(point),
                &DisplayAttributes::of_record(record, has_color),
            );
        }
    })?;
    sample.intensities.sort_unstable();
    let Some(scene) = Scene::of(&sample.places, STRAY) else {
        return Ok(Vec::new());
    };
    let Scene { min, max, .. } = scene;
    let camera = Camera::new(picture.view, &scene, picture.size);
    let ground = (max[0] - min[0]) * (max[1] - min[1]);
    let diameter = picture
        .point_size
        .unwrap_or_else(|| (ground / count as f64).sqrt());
    let mut canvas = Canvas::new(picture.size);
    let coloring = match picture.coloring {
        Coloring::Auto if sample.brightest == 0 => Coloring::Height,
        coloring => coloring,
    };
    visit(&mut |record| {
        let place = quantization.world(Stored::of_record(record));
        if let Some((at, depth, scale)) = camera.project(place) {
            let height = (place[2] - min[2]) / (max[2] - min[2]).max(1e-9);
            let looks = DisplayAttributes::of_record(record, has_color);
            let color = sample.color(coloring, &looks, height);
            canvas.disc(at, depth, 0.5 * diameter * scale, color);
        }
    })?;
    let mut content = Vec::new();
    let written = canvas.write_png(&mut content);
    written.map_err(ViewError::Encoding)?;
    Ok(content)
}

/// Calls `draw` with every record of `inputs`.
fn visit(
    inputs: &[InputFile],
    record: &RecordFormat,
    quantization: Quantization,
    draw: &mut dyn FnMut(&[u8]),
) -> Result<(), ViewError> {
    let mut records = Vec::new();
    for input in inputs {
        let (all, filter) = (0..input.points_claimed, PointFilter::default());
        let mut stream = PointStream::open(input, all, record, quantization, &filter)?;
        while stream.next_batch(&mut records)?.read > 0 {
            records
                .chunks_exact(record.record_length())
                .for_each(&mut *draw);
        }
    }
    Ok(())
}

/// What is known of a sample of the points.
#[derive(Default)]
struct Sample {
    places: Vec<[f64; 3]>,
    brightest: u16,
    /// Sorted, once all are there.
    intensities: Vec<u16>,
}

impl Sample {
    fn add(&mut self, place: [f64; 3], looks: &DisplayAttributes) {
        self.places.push(place);
        self.intensities.push(looks.intensity);
        self.brightest = self.brightest.max(looks.brightness());
    }

    fn color(&self, coloring: Coloring, looks: &DisplayAttributes, height: f64) -> [u8; 3] {
        match coloring {
            Coloring::Auto => looks.color_in_bytes(self.brightest),
            Coloring::Height => ramp(height),
            Coloring::Intensity => {
                let rank = self.intensities.partition_point(|&i| i < looks.intensity);
                let share = rank as f64 / self.intensities.len().max(1) as f64;
                [(40.0 + 200.0 * share) as u8; 3]
            }
            Coloring::Class => {
                let hue = spread(looks.class.into()).to_le_bytes();
                [0, 1, 2].map(|c| 60 + (hue[c] >> 1) + (hue[c] >> 3))
            }
        }
    }
}

/// From blue over green to yellow.
fn ramp(share: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 4] = [
        [45.0, 75.0, 140.0],
        [45.0, 140.0, 150.0],
        [110.0, 180.0, 110.0],
        [240.0, 210.0, 80.0],
    ];
    let place = share.clamp(0.0, 1.0) * 3.0;
    let low = (place as usize).min(2);
    let part = place - low as f64;
    [0, 1, 2].map(|c| (STOPS[low][c] + part * (STOPS[low + 1][c] - STOPS[low][c])) as u8)
}
