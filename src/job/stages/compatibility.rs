//! Whether inputs can be merged into one cloud.

use crate::las::{Crs, InputFile, UtmZone};

/// Lists what keeps `inputs` from being merged, with the path of the input in each: geographic
/// coordinates, another CRS than the first input's, another kind of GPS time.
pub(super) fn differences(inputs: &[InputFile]) -> Vec<String> {
    let mut problems = Vec::new();
    problems.extend(geographic(inputs));
    problems.extend(other_crs(inputs));
    problems.extend(other_gps_time(inputs));
    problems
}

fn geographic(inputs: &[InputFile]) -> impl Iterator<Item = String> {
    let is_geographic = |input: &&InputFile| input.crs.as_ref().is_some_and(Crs::is_geographic);
    inputs.iter().filter(is_geographic).map(|input| {
        let remedy = input.utm_zone().map_or_else(
            |problem| problem,
            |UtmZone { code, name }| {
                format!("reproject it with --reproject EPSG:{code} ({name}), or --reproject auto")
            },
        );
        format!(
            "{}: coordinates are degrees, in which a spacing means nothing; {remedy}",
            input.path.display()
        )
    })
}

fn other_crs(inputs: &[InputFile]) -> Vec<String> {
    let Some((first, rest)) = inputs.split_first() else {
        return Vec::new();
    };
    let name = |crs: &Option<Crs>| crs.as_ref().map_or("none".into(), Crs::name);
    let is_other = |input: &&InputFile| match (&first.crs, &input.crs) {
        (None, None) => false,
        (Some(one), Some(other)) => !one.same_as(other),
        _ => true,
    };
    let others = rest.iter().filter(is_other).map(|input| {
        format!(
            "{}: its CRS ({}) is not that of {} ({}); reproject all of them (--reproject auto, \
             or EPSG:…), or, if they are the same in truth, give --crs",
            input.path.display(),
            name(&input.crs),
            first.path.display(),
            name(&first.crs)
        )
    });
    others.collect()
}

fn other_gps_time(inputs: &[InputFile]) -> Vec<String> {
    let mut timed = inputs.iter().filter(|input| input.format().has_gps_time);
    let Some(first) = timed.next() else {
        return Vec::new();
    };
    let others = timed.filter(|input| input.has_standard_time != first.has_standard_time);
    let others = others.map(|input| {
        format!(
            "{}: its GPS times are not of the kind of {} (one counts seconds of the week, the \
             other adjusted standard time); convert one of them",
            input.path.display(),
            first.path.display()
        )
    });
    others.collect()
}
