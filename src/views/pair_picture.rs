//! A picture of two clouds side by side, seen alike.
//!
//! ```text
//!   the whole of A   | the whole of B      one camera, chosen for both
//!   -----------------+----------------
//!   a place of A     | that place of B     from above, so near that each point is seen
//! ```

use std::path::PathBuf;

use super::{
    coloring::Coloring,
    error::ViewError,
    picture::{Frame, PictureSample, visit_records},
};
use crate::{
    geometry::{Quantization, Stored},
    las::{InputFile, PointFilter, RecordFormat, expand_inputs},
    picture::{Camera, Canvas, Scene, View, write_sheet},
};

/// How a picture of two clouds is made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairPictureOptions {
    /// The view of the whole clouds.
    pub(crate) view: View,
    /// What decides the colours of the points.
    pub(crate) coloring: Coloring,
    /// Width and height of each of the four frames, in pixels.
    pub(crate) size: [u32; 2],
    /// The spacings of the clouds (CRS units).
    pub(crate) spacings: [f64; 2],
}

/// The width of the place that is seen from near by, in spacings of the coarser cloud.
const PLACE_IN_SPACINGS: f64 = 30.0;
/// The number of positions around which a place is looked at.
const PLACES: usize = 100;
/// The share of the points of a plane that a place has at least, so that it is not at a border.
const FULL_SHARE: f64 = 0.8;
/// The area of a point of an even cloud, in squared spacings: √3 / 2.
const AREA_PER_POINT: f64 = 0.866_025_403_784_438_6;
/// The diameter of the points there, in spacings of their cloud.
const DOT_IN_SPACINGS: f64 = 0.4;

/// Draws the clouds in two files, directories or patterns, and encodes the picture as PNG.
///
/// # Errors
///
/// [`ViewError::Las`] if a file cannot be read, [`ViewError::NoPoint`] if both are empty.
pub(crate) fn render_pair(
    clouds: [&PathBuf; 2],
    options: &PairPictureOptions,
) -> Result<Vec<u8>, ViewError> {
    let survey = |cloud: &PathBuf| -> Result<Vec<InputFile>, ViewError> {
        let paths = expand_inputs(std::slice::from_ref(cloud), &PointFilter::default())?;
        let inputs = paths.iter().map(|path| InputFile::survey(path));
        Ok(inputs.collect::<Result<_, _>>()?)
    };
    let clouds = [survey(clouds[0])?, survey(clouds[1])?];
    let all: Vec<InputFile> = clouds.concat();
    let pair = Pair {
        record: RecordFormat::for_inputs(&all)?,
        quantization: InputFile::common_quantization(all.iter()),
        clouds,
    };

    // One sample of both, so that they have one camera and one range of colours.
    let mut sample = PictureSample::default();
    for cloud in 0..2 {
        pair.add_to(&mut sample, cloud)?;
    }
    let scene = sample.scene().ok_or(ViewError::NoPoint)?;
    let points = pair.points(0) + pair.points(1);
    let share = sample.positions.len() as f64 / points.max(1) as f64;
    let place = place(&scene, &sample.positions, share, options);
    let mut png = Vec::new();
    let whole = pair.frames(options, &sample, &scene, None)?;
    let near = pair.frames(options, &sample, &place, Some(DOT_IN_SPACINGS))?;
    write_sheet(&[whole, near], &mut png).map_err(ViewError::Encoding)?;
    Ok(png)
}

/// The place whose points are seen from near by: of some sampled positions with a full square around them the one
/// where the heights differ least, so that a surface is seen, or else the one nearest to the middle of `scene`.
///
/// The sample contains the `share` of the points.
fn place(scene: &Scene, positions: &[[f64; 3]], share: f64, options: &PairPictureOptions) -> Scene {
    let half = 0.5 * PLACE_IN_SPACINGS * options.spacings[0].max(options.spacings[1]);
    let areas = options.spacings.map(|h| AREA_PER_POINT * h * h);
    let of_plane = share * (2.0 * half).powi(2) * (1.0 / areas[0] + 1.0 / areas[1]);
    let off_middle = |[x, y, _]: &[f64; 3]| {
        let [dx, dy] = [x - scene.middle[0], y - scene.middle[1]];
        dx * dx + dy * dy
    };
    let unevenness = |at: &[f64; 3]| {
        let is_near = |p: &&[f64; 3]| (0..2).all(|axis| (p[axis] - at[axis]).abs() <= half);
        let heights = positions.iter().filter(is_near).map(|p| p[2] - at[2]);
        let (n, sum, squares) = heights.fold((0.0, 0.0, 0.0), |(n, sum, squares), z| {
            (n + 1.0, sum + z, squares + z * z)
        });
        match n >= FULL_SHARE * of_plane {
            true => squares / n - (sum / n) * (sum / n),
            false => f64::INFINITY,
        }
    };
    let step = positions.len().div_ceil(PLACES).max(1);
    let best = positions
        .iter()
        .step_by(step)
        .map(|at| (unevenness(at), off_middle(at), at))
        .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let middle = best.map_or(scene.middle, |(_, _, at)| *at);
    let corner = |sign: f64, z: f64| [middle[0] + sign * half, middle[1] + sign * half, z];
    Scene {
        min: corner(-1.0, scene.min[2]),
        max: corner(1.0, scene.max[2]),
        middle,
        along: scene.along,
    }
}

/// Two clouds with records of one format.
struct Pair {
    clouds: [Vec<InputFile>; 2],
    record: RecordFormat,
    quantization: Quantization,
}

impl Pair {
    fn points(&self, cloud: usize) -> u64 {
        let inputs = self.clouds[cloud].iter();
        inputs.map(|input| input.points_claimed).sum()
    }

    fn visit(&self, cloud: usize, visit: &mut dyn FnMut(&[u8])) -> Result<(), ViewError> {
        visit_records(&self.clouds[cloud], &self.record, self.quantization, visit)
    }

    fn add_to(&self, sample: &mut PictureSample, cloud: usize) -> Result<(), ViewError> {
        let visit = |draw: &mut dyn FnMut(&[u8])| self.visit(cloud, draw);
        let (points, has_color) = (self.points(cloud), self.record.has_color());
        sample.add_cloud(points, has_color, &self.quantization, &visit)
    }

    /// The frames of both clouds as they show `scene`: the whole clouds in the view of the options or, if points are
    /// `dots` of so many spacings, from above.
    fn frames(
        &self,
        options: &PairPictureOptions,
        sample: &PictureSample,
        scene: &Scene,
        dots: Option<f64>,
    ) -> Result<[Canvas; 2], ViewError> {
        let view = if dots.is_some() {
            View::Top
        } else {
            options.view
        };
        let [width, height] = [0, 1].map(|axis| scene.max[axis] - scene.min[axis]);
        let frame = |cloud: usize| Frame {
            camera: Camera::new(view, scene, options.size),
            heights: [scene.min[2], scene.max[2]],
            colors: &sample.colors,
            coloring: sample.colors.resolve(options.coloring),
            has_color: self.record.has_color(),
            diameter: match dots {
                Some(dots) => dots * options.spacings[cloud],
                None => (width * height / self.points(cloud).max(1) as f64).sqrt(),
            },
        };
        let mut canvases = [Canvas::new(options.size), Canvas::new(options.size)];
        for (cloud, canvas) in canvases.iter_mut().enumerate() {
            let frame = frame(cloud);
            let is_shown = |record: &[u8]| {
                let [x, y, _] = self.quantization.world(Stored::of_record(record));
                let is_in = |c: f64, axis: usize| (scene.min[axis]..=scene.max[axis]).contains(&c);
                dots.is_none() || (is_in(x, 0) && is_in(y, 1))
            };
            self.visit(cloud, &mut |record| {
                if is_shown(record) {
                    frame.draw(record, &self.quantization, canvas);
                }
            })?;
        }
        Ok(canvases)
    }
}
