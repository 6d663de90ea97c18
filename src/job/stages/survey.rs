//! Headers only: what there is, and whether it can be merged.

use std::path::PathBuf;

use rayon::prelude::*;

use crate::job::{JobError, LeftOut};
use crate::{
    config::Settings,
    geometry::Quantization,
    las::{Crs, InputFile, PointFilter, RecordFormat, Vlr, expand_inputs},
    spacing::Target,
};

/// What the headers of all inputs say, and what follows for the run.
#[derive(Clone, Debug)]
pub(crate) struct Survey {
    /// The files, in the order of their paths.
    pub(crate) inputs: Vec<InputFile>,
    /// The run's record.
    pub(crate) record: RecordFormat,
    /// The run's scale and offset.
    pub(crate) quantization: Quantization,
    /// The CRS that all inputs share, if they state one.
    pub(crate) crs: Option<Crs>,
    /// Whether GPS times are adjusted standard times.
    pub(crate) has_standard_time: bool,
    /// What is odd about the inputs.
    pub(crate) notes: Vec<String>,
    /// Files that cannot be read, and are left out.
    pub(crate) left_out: Vec<LeftOut>,
    /// Which points take part.
    pub(crate) filter: PointFilter,
    asked: Asked,
}

/// What was asked for that headers decide on.
#[derive(Clone, Debug)]
struct Asked {
    target: Target,
    crs: Option<Crs>,
    filter: PointFilter,
}

impl Survey {
    /// Reads the headers of the files that `arguments` name; those that cannot be read
    /// are left out if `skip` says so.
    ///
    /// # Errors
    ///
    /// [`JobError::BadFiles`] with every file that is not readable or no LAS, and
    /// [`JobError::Inputs`] with every one that cannot be merged with the others:
    /// another CRS or another kind of GPS time than the first, degrees.
    pub(crate) fn of(
        arguments: &[PathBuf],
        settings: &Settings,
        skip: bool,
    ) -> Result<Self, JobError> {
        let paths = expand_inputs(arguments)?;
        let surveyed: Vec<_> = paths
            .par_iter()
            .map(|path| InputFile::survey(path))
            .collect();
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
        if !left_out.is_empty() && !skip {
            return Err(JobError::BadFiles(left_out));
        }
        let asked = Asked {
            target: settings.target,
            crs: settings.crs.clone(),
            filter: settings.filter.clone(),
        };
        Self::merge(inputs, left_out, asked)
    }

    /// The survey without the files of `bad`.
    ///
    /// # Errors
    ///
    /// As [`of`](Self::of), if no file is left.
    pub(crate) fn without(self, bad: Vec<LeftOut>) -> Result<Self, JobError> {
        let mut inputs = self.inputs;
        inputs.retain(|input| {
            let path = input.path.display().to_string();
            bad.iter().all(|bad| bad.path != path)
        });
        let left_out = self.left_out.into_iter().chain(bad).collect();
        Self::merge(inputs, left_out, self.asked)
    }

    /// What follows from `inputs`.
    fn merge(
        inputs: Vec<InputFile>,
        mut left_out: Vec<LeftOut>,
        asked: Asked,
    ) -> Result<Self, JobError> {
        left_out.sort_by(|a, b| a.path.cmp(&b.path));
        left_out.dedup();
        if inputs.is_empty() {
            return Err(JobError::BadFiles(left_out));
        }
        let mut inputs = inputs;
        if let Some(crs) = &asked.crs {
            for input in &mut inputs {
                input.crs = Some(crs.clone());
            }
        }
        let problems = differences(&inputs);
        if !problems.is_empty() {
            return Err(JobError::Inputs(problems));
        }
        if inputs.iter().all(|input| input.points_claimed == 0) {
            return Err(JobError::Refused(format!(
                "{}: no input holds any point; there is nothing to resample",
                inputs[0].path.display()
            )));
        }
        let mut notes: Vec<String> = inputs
            .iter()
            .flat_map(|input| {
                let path = input.path.display().to_string();
                input
                    .notes
                    .iter()
                    .map(move |note| format!("{path}: {note}"))
            })
            .collect();
        notes.extend(
            left_out
                .iter()
                .map(|bad| format!("{} is left out: it {}", bad.path, bad.reason)),
        );
        let crs = inputs.iter().find_map(|input| input.crs.clone());
        match &crs {
            None => notes.push("no input states a CRS; the output states none".into()),
            Some(crs) if crs.wkt().is_none() => notes
                .push("the CRS names no EPSG code; its GeoTIFF keys are copied as they are".into()),
            Some(_) => {}
        }
        Ok(Self {
            record: RecordFormat::for_inputs(&inputs)?,
            quantization: quantization(&inputs, asked.target),
            has_standard_time: inputs
                .iter()
                .any(|input| input.format().has_gps_time && input.has_standard_time),
            crs,
            notes,
            inputs,
            left_out,
            filter: asked.filter.clone(),
            asked,
        })
    }

    /// The records that the output keeps: of each kind the first that an input has.
    pub(crate) fn kept_records(&self) -> Vec<Vlr> {
        let mut kept: Vec<Vlr> = Vec::new();
        for record in self.inputs.iter().flat_map(|input| &input.kept_records) {
            if kept.iter().all(|known| known.record_id != record.record_id) {
                kept.push(record.clone());
            }
        }
        kept
    }

    /// Points that the headers claim.
    pub(crate) fn points_claimed(&self) -> u64 {
        self.inputs.iter().map(|input| input.points_claimed).sum()
    }

    /// The paths of all inputs, of those that are left out, too.
    pub(crate) fn paths(&self) -> impl Iterator<Item = PathBuf> {
        let inputs = self.inputs.iter().map(|input| input.path.clone());
        let left_out = self.left_out.iter().map(|bad| PathBuf::from(&bad.path));
        inputs.chain(left_out)
    }

    /// The longer side of what the headers claim, in stored units.
    pub(crate) fn extent_claimed(&self) -> i64 {
        let (min, max) = claimed_bounds(&self.inputs);
        let widest = (0..2).map(|axis| max[axis] - min[axis]).fold(0.0, f64::max);
        // `as` saturates, and takes what is not a number for zero.
        (widest / self.quantization.scale) as i64
    }
}

/// What keeps inputs from being merged, file by file.
fn differences(inputs: &[InputFile]) -> Vec<String> {
    let mut problems = Vec::new();
    for input in inputs {
        if input.crs.as_ref().is_some_and(Crs::is_geographic) {
            problems.push(format!(
                "{}: coordinates are degrees, in which a spacing means nothing; reproject it to a \
                 system in metres or feet",
                input.path.display()
            ));
        }
    }
    let name = |crs: &Option<Crs>| crs.as_ref().map_or("none".into(), Crs::name);
    if let Some((first, rest)) = inputs.split_first() {
        for input in rest {
            let same = match (&first.crs, &input.crs) {
                (None, None) => true,
                (Some(one), Some(other)) => one.same_as(other),
                _ => false,
            };
            if !same {
                problems.push(format!(
                    "{}: its CRS ({}) is not that of {} ({}); reproject one of them, or, if they are the same in truth, give \
                     --crs",
                    input.path.display(),
                    name(&input.crs),
                    first.path.display(),
                    name(&first.crs)
                ));
            }
        }
    }
    let mut timed = inputs.iter().filter(|input| input.format().has_gps_time);
    if let Some(first) = timed.next() {
        for input in timed.filter(|i| i.has_standard_time != first.has_standard_time) {
            problems.push(format!(
                "{}: its GPS times are not of the kind of {} (one counts seconds of the week, the \
                 other adjusted standard time); convert one of them",
                input.path.display(),
                first.path.display()
            ));
        }
    }
    problems
}

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
        // No claim can be used; the files' own offsets are near their points.
        let offset = inputs.first().map_or([0.0; 3], |input| input.offset);
        return (offset, offset);
    }
    bounds
}

/// The finest scale of the inputs, finer still if the spacing asks for it.
fn quantization(inputs: &[InputFile], target: Target) -> Quantization {
    let scale = inputs
        .iter()
        .flat_map(|input| input.scale)
        .fold(f64::INFINITY, f64::min);
    let (min, max) = claimed_bounds(inputs);
    Quantization::for_spacing(min, max, scale, target.spacing_of_a_square(min, max))
}
