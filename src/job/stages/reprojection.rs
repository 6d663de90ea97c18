//! Inputs of any CRS, brought to one.

use std::sync::Arc;

use crate::{
    job::error::JobError,
    las::{Crs, InputFile, Reprojection, ReprojectionTarget, zone_around},
};

/// Brings all `inputs` to the CRS `target`. Inputs without points, whose headers may state anything, are brought
/// nowhere.
///
/// # Errors
///
/// [`JobError::Inputs`] with every input that states no CRS, or from whose CRS there is no way.
pub(super) fn reprojected(
    inputs: Vec<InputFile>,
    target: ReprojectionTarget,
) -> Result<Vec<InputFile>, JobError> {
    let about = |input: &InputFile, problem: &str| format!("{}: {problem}", input.path.display());
    let mut problems: Vec<String> = inputs
        .iter()
        .filter(|input| input.crs.is_none())
        .map(|input| {
            about(
                input,
                "states no CRS to reproject it from; give it with --crs",
            )
        })
        .collect();
    if !problems.is_empty() {
        return Err(JobError::Inputs(problems));
    }
    let code = match target {
        ReprojectionTarget::Epsg(code) => code,
        ReprojectionTarget::Auto => {
            let placed: Vec<(&InputFile, &Crs)> = inputs
                .iter()
                .filter(|input| input.points_claimed > 0)
                .filter_map(|input| Some((input, input.crs.as_ref()?)))
                .collect();
            let areas: Vec<_> = placed
                .iter()
                .map(|(input, crs)| (*crs, input.bounds.map(|[x, y, _]| [x, y])))
                .collect();
            let zone = zone_around(&areas).map_err(|(number, problem)| {
                let input = placed.get(number).map_or(&inputs[0], |(input, _)| *input);
                JobError::Inputs(vec![about(input, &problem)])
            })?;
            zone.code
        }
    };
    let mut done = Vec::new();
    for input in inputs {
        let path = input.path.clone();
        let wrong = |problem: String| format!("{}: {problem}", path.display());
        let way = input
            .crs
            .as_ref()
            .map_or(Ok(None), |crs| Reprojection::new(crs, code));
        let brought = way.and_then(|way| match way {
            Some(way) => input.reprojected(&Arc::new(way)),
            None => Ok(input),
        });
        match brought {
            Ok(input) => done.push(input),
            Err(problem) => problems.push(wrong(problem)),
        }
    }
    match problems.is_empty() {
        true => Ok(done),
        false => Err(JobError::Inputs(problems)),
    }
}
