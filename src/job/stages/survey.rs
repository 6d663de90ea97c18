//! Survey: the headers of all inputs, and what follows from them for the run.

use std::path::PathBuf;

use super::{compatibility::differences, reprojection::reprojected};
use crate::{
    config::Settings,
    geometry::{MIN_STEPS_PER_SPACING, Quantization, longest_side},
    job::error::{JobError, LeftOut},
    las::{
        Crs, InputFile, OctreeLevels, PointFilter, RecordFormat, ReprojectionTarget, Vlr,
        expand_inputs,
    },
    spacing::Target,
};

/// Steps of the coordinates across a scan, at least.
const FEWEST_STEPS: f64 = 1000.0;

/// The headers of all inputs, and what follows from them for the run.
#[derive(Clone, Debug)]
pub(crate) struct Survey {
    /// The input files, in the order of their paths.
    pub(crate) inputs: Vec<InputFile>,
    /// The format of the run's records, which loses nothing of any input.
    pub(crate) record: RecordFormat,
    /// Scale and offset of the run.
    pub(crate) quantization: Quantization,
    /// The CRS that all inputs share; `None` if they state none.
    pub(crate) crs: Option<Crs>,
    /// Whether GPS times are adjusted standard times.
    pub(crate) has_standard_time: bool,
    /// Notes on irregularities of the inputs.
    pub(crate) notes: Vec<String>,
    /// Files that cannot be read, and are left out.
    pub(crate) left_out: Vec<LeftOut>,
    /// The condition on the points that are resampled.
    pub(crate) filter: PointFilter,
    requested: Requested,
}

/// The settings that decide, together with the headers, what follows for the run.
#[derive(Clone, Debug)]
struct Requested {
    target: Target,
    /// The finest spacing, as a share of the coarsest.
    finest: f64,
    /// The CRS of all inputs, whatever their headers state.
    crs: Option<Crs>,
    /// The CRS to which they are reprojected.
    reproject: Option<ReprojectionTarget>,
    /// Which levels of octrees are read.
    levels: OctreeLevels,
    filter: PointFilter,
}

impl Requested {
    /// The finest spacing of the output (CRS units); `None` if it follows from a count.
    fn finest_spacing(&self) -> Option<f64> {
        match self.target {
            Target::Spacing(coarsest) => Some(self.finest * coarsest),
            Target::Count(_) | Target::Ratio(_) => None,
        }
    }
}

impl Survey {
    /// Reads the headers of the files that `arguments` name. Files that cannot be read are left out
    /// if `leaves_out` says so.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] with every file that is unreadable or no LAS, and
    /// [`JobError::Inputs`] with every file that cannot be merged with the others: its coordinates
    /// are degrees, or its CRS or kind of GPS time differs from the first.
    pub(crate) fn of(
        arguments: &[PathBuf],
        settings: &Settings,
        leaves_out: bool,
    ) -> Result<Self, JobError> {
        // Bounds in another CRS than that of the files say nothing of those that a catalogue lists.
        let filter = match settings.input.reproject {
            Some(_) => &PointFilter::default(),
            None => &settings.input.filter,
        };
        let paths = expand_inputs(arguments, filter)?;
        let surveyed = InputFile::survey_all(&paths);
        let mut left_out = Vec::new();
        let mut inputs = Vec::new();
        for result in surveyed {
            match result {
                Ok(input) => inputs.push(input),
                Err(error) => left_out.push(LeftOut {
                    path: error.path,
                    reason: error.problem,
                }),
            }
        }
        if !left_out.is_empty() && !leaves_out {
            return Err(JobError::BadFiles(left_out));
        }
        let requested = Requested {
            target: settings.target,
            finest: settings
                .solver
                .grading
                .map_or(1.0, |grading| grading.finest),
            crs: settings.input.crs.clone(),
            reproject: settings.input.reproject,
            levels: settings.input.levels,
            filter: settings.input.filter.clone(),
        };
        Self::merge(inputs, left_out, requested)
    }

    /// The survey without the files in `bad`.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] if no file is left.
    pub(super) fn without(self, bad: Vec<LeftOut>) -> Result<Self, JobError> {
        let mut inputs = self.inputs;
        inputs.retain(|input| {
            let path = input.path.display().to_string();
            bad.iter().all(|bad| bad.path != path)
        });
        let left_out = self.left_out.into_iter().chain(bad).collect();
        Self::merge(inputs, left_out, self.requested)
    }

    /// The survey of `inputs`.
    fn merge(
        inputs: Vec<InputFile>,
        mut left_out: Vec<LeftOut>,
        requested: Requested,
    ) -> Result<Self, JobError> {
        left_out.sort_by(|a, b| a.path.cmp(&b.path));
        left_out.dedup();

        // Refuse inputs that make no cloud.
        if inputs.is_empty() {
            return Err(JobError::BadFiles(left_out));
        }
        let mut inputs: Vec<InputFile> = inputs.into_iter().map(InputFile::into_surveyed).collect();
        if let Some(crs) = &requested.crs {
            for input in &mut inputs {
                input.crs = Some(crs.clone());
            }
        }
        if let Some(target) = requested.reproject {
            inputs = reprojected(inputs, target)?;
        }
        let finest = requested.levels.finest_spacing(requested.finest_spacing());
        for input in &mut inputs {
            input.finest_spacing = finest;
        }
        let problems = differences(&inputs);
        if !problems.is_empty() {
            return Err(JobError::Inputs(problems));
        }
        if inputs.iter().all(|input| input.points_claimed == 0) {
            return Err(JobError::Refused(format!(
                "{}: no input contains any point; there is nothing to resample",
                inputs[0].path.display()
            )));
        }

        check_size(&inputs)?;

        // Decide what follows for the run.
        let crs = inputs.iter().find_map(|input| input.crs.clone());
        let quantization = quantization(&inputs, &requested);
        let mut notes = notes(&inputs, &left_out, crs.as_ref());
        notes.extend(note_on_scale(&inputs, &quantization));
        notes.extend(note_on_small_scan(&inputs));
        Ok(Self {
            record: RecordFormat::for_inputs(&inputs)?,
            quantization,
            has_standard_time: inputs
                .iter()
                .any(|input| input.format().has_gps_time && input.has_standard_time),
            notes,
            crs,
            inputs,
            left_out,
            filter: requested.filter.clone(),
            requested,
        })
    }

    /// The variable-length records that the output keeps: the first record of each kind.
    pub(super) fn carried_records(&self) -> Vec<Vlr> {
        let mut kept: Vec<Vlr> = Vec::new();
        for record in self.inputs.iter().flat_map(|input| &input.carried_records) {
            if kept.iter().all(|known| known.record_id != record.record_id) {
                kept.push(record.clone());
            }
        }
        kept
    }

    /// Whether an input is remote.
    pub(super) fn is_remote(&self) -> bool {
        self.inputs.iter().any(InputFile::is_remote)
    }

    /// The number of points that the headers claim.
    pub(crate) fn points_claimed(&self) -> u64 {
        self.inputs.iter().map(|input| input.points_claimed).sum()
    }

    /// The corners of the bounding box that the headers claim, in world coordinates.
    pub(super) fn claimed_bounds(&self) -> ([f64; 3], [f64; 3]) {
        claimed_bounds(&self.inputs)
    }

    /// The longer side of the rectangle that the headers claim, in stored units.
    pub(super) fn extent_claimed(&self) -> i64 {
        let (min, max) = self.claimed_bounds();
        let widest = (0..2).map(|axis| max[axis] - min[axis]).fold(0.0, f64::max);
        // `as` saturates, and turns NaN into zero.
        (widest / self.quantization.scale) as i64
    }
}

/// Notes on irregularities of `inputs`, on files `left_out`, and on the `crs` of the output.
fn notes(inputs: &[InputFile], left_out: &[LeftOut], crs: Option<&Crs>) -> Vec<String> {
    let of_input = |input: &InputFile| {
        let path = input.path.display().to_string();
        let notes = input.notes.iter().cloned().chain(input.note_on_levels());
        let notes: Vec<String> = notes.map(|note| format!("{path}: {note}")).collect();
        notes
    };
    let mut notes: Vec<String> = inputs.iter().flat_map(of_input).collect();
    notes.extend(
        left_out
            .iter()
            .map(|bad| format!("{} is left out ({})", bad.path, bad.reason)),
    );
    match crs {
        None => notes.push("no input states a CRS; the output states none".into()),
        Some(crs) if crs.wkt().is_none() => {
            notes
                .push("the CRS names no EPSG code; its GeoTIFF keys are copied as they are".into());
        }
        Some(_) => {}
    }
    notes
}

/// The bounding box of the sound claims of the headers; if there is none, the offset of the first
/// input, which is near its points.
fn claimed_bounds(inputs: &[InputFile]) -> ([f64; 3], [f64; 3]) {
    let mut bounds = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for input in inputs.iter().filter(|input| input.points_claimed > 0) {
        let [min, max] = input.bounds;
        let is_sound = (0..3)
            .all(|axis| min[axis].is_finite() && max[axis].is_finite() && min[axis] <= max[axis]);
        if is_sound {
            for axis in 0..3 {
                bounds.0[axis] = bounds.0[axis].min(min[axis]);
                bounds.1[axis] = bounds.1[axis].max(max[axis]);
            }
        }
    }
    if bounds.0[0] > bounds.1[0] {
        let offset = inputs.first().map_or([0.0; 3], |input| input.offset);
        return (offset, offset);
    }
    bounds
}

/// The longest side of the bounding box of the sound claims of the headers (CRS units).
fn widest_side(inputs: &[InputFile]) -> f64 {
    let (min, max) = claimed_bounds(inputs);
    longest_side(min, max)
}

/// A note where a scan is so small that the finest steps of coordinates are noticeable beside the distances of its points.
fn note_on_small_scan(inputs: &[InputFile]) -> Option<String> {
    let input = inputs.iter().find(|input| input.has_finest_steps())?;
    let points: u64 = inputs.iter().map(|input| input.points_claimed).sum();
    let (widest, step) = (widest_side(inputs), input.finest_scale());
    let distance = widest / (points as f64).sqrt();
    (widest > 0.0 && distance < MIN_STEPS_PER_SPACING * step).then(|| {
        format!(
            "coordinates are rounded to {step:e}, in a scan whose points are about {distance:.1e} apart: multiply its coordinates if \
             that is too coarse"
        )
    })
}

/// Refuses a scan that is so small that it would lose its shape in the finest steps of coordinates.
///
/// # Errors
///
/// [`JobError::Refused`] with the factor by which coordinates may be multiplied.
fn check_size(inputs: &[InputFile]) -> Result<(), JobError> {
    let Some(input) = inputs.iter().find(|input| input.has_finest_steps()) else {
        return Ok(());
    };
    let (widest, step) = (widest_side(inputs), input.finest_scale());
    // Equal points have no shape.
    if widest == 0.0 || widest >= FEWEST_STEPS * step {
        return Ok(());
    }
    let factor = -widest.log10().floor();
    Err(JobError::Refused(format!(
        "{}: the scan is {widest:.1e} across, and coordinates are kept in steps of {step:e} at the finest, in which it would lose its \
         shape: multiply its coordinates, by 1e{factor} for example",
        input.path.display()
    )))
}

/// The smallest scale of `inputs`.
fn finest_scale(inputs: &[InputFile]) -> f64 {
    let scales = inputs.iter().map(InputFile::finest_scale);
    scales.fold(f64::INFINITY, f64::min)
}

/// A note where the inputs are so wide that coordinates on `quantization` have coarser steps than theirs.
fn note_on_scale(inputs: &[InputFile], quantization: &Quantization) -> Option<String> {
    let (finest, scale) = (finest_scale(inputs), quantization.scale);
    let widest = widest_side(inputs);
    (scale > 1.01 * finest).then(|| {
        format!(
            "coordinates are rounded to {scale}, where the inputs have {finest}: with 32 bits they have no finer steps over a width of {widest:.0}; \
             if that is too wide, remove points that are far from all others"
        )
    })
}

/// The smallest scale of the inputs, or a smaller one if the spacing requires it.
fn quantization(inputs: &[InputFile], requested: &Requested) -> Quantization {
    let scale = finest_scale(inputs);
    let (min, max) = claimed_bounds(inputs);
    let spacing = requested.target.spacing_of_a_square(min, max);
    let finest = spacing.map(|coarsest| requested.finest * coarsest);
    Quantization::for_spacing(min, max, scale, finest)
}
