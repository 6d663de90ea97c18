//! `info`: what the headers of scans state.

use std::path::PathBuf;

use super::{
    exit::{DONE, FAILED},
    numbers::rounded,
    printing::{result, say},
};
use crate::{
    job::JobError,
    las::{Crs, InputFile, PointFilter, expand_inputs},
    report::{figure, thousands},
};

/// Prints the headers of scans. A file that cannot be read is reported, and the others are
/// printed all the same.
pub(super) fn print_info(files: &[PathBuf], json: bool) -> Result<u8, JobError> {
    let paths = expand_inputs(files, &PointFilter::default())?;
    let mut code = DONE;
    for path in paths {
        match InputFile::survey(&path) {
            Ok(input) if json => result!("{}", as_json(&input)),
            Ok(input) => print_input(&input),
            Err(error) => {
                say!("lloydar: {error}");
                code = FAILED;
            }
        }
    }
    Ok(code)
}

/// Returns the header of a file as JSON.
pub(super) fn as_json(input: &InputFile) -> serde_json::Value {
    let extra = input.extra_bytes.iter().map(|extra| {
        let (name, bytes) = (&extra.name, extra.length);
        serde_json::json!({ "name": name, "bytes": bytes })
    });
    serde_json::json!({
        "file": input.path,
        "kind": input.kind(),
        "version": input.version,
        "format": input.format_number(),
        "bytes": input.bytes,
        "points": input.points_claimed,
        "min": input.bounds[0],
        "max": input.bounds[1],
        "scale": input.scale,
        "offset": input.offset,
        "crs": input.crs.as_ref().map(Crs::name),
        "metres_per_unit": input.crs.as_ref().and_then(Crs::metres_per_unit),
        "has_standard_time": input.has_standard_time,
        "generating_software": input.generating_software,
        "extra_bytes": extra.collect::<Vec<_>>(),
        "notes": input.notes.iter().cloned().chain(note_on_degrees(input)).collect::<Vec<_>>(),
    })
}

/// Returns what to do about coordinates in degrees, if the file has them.
fn note_on_degrees(input: &InputFile) -> Option<String> {
    let is_geographic = input.crs.as_ref().is_some_and(Crs::is_geographic);
    (is_geographic && input.points_claimed > 0).then(|| match input.utm_zone() {
        Ok(zone) => format!(
            "coordinates are degrees; resample it with --reproject auto (EPSG:{}, {})",
            zone.code, zone.name
        ),
        Err(problem) => format!("coordinates are degrees, but {problem}"),
    })
}

/// Prints the header of a file for people.
fn print_input(input: &InputFile) {
    let [major, minor] = input.version;
    let kind = input.kind();
    result!("{}", input.path.display());
    result!(
        "  {kind} {major}.{minor}, format {}, {} bytes",
        input.format_number(),
        thousands(input.bytes)
    );
    result!("  points   {}", thousands(input.points_claimed));
    let [min, max] = input.bounds;
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        result!(
            "  {name}        {} to {}, scale {}, offset {}",
            rounded(min[axis], input.scale[axis]),
            rounded(max[axis], input.scale[axis]),
            input.scale[axis],
            input.offset[axis]
        );
    }
    let area = (max[0] - min[0]) * (max[1] - min[1]);
    result!(
        "  density  {} points per square CRS unit of its bounds",
        figure(input.points_claimed as f64 / area)
    );
    result!(
        "  CRS      {}",
        input.crs.as_ref().map_or("none".into(), Crs::name)
    );
    for extra in &input.extra_bytes {
        result!("  extra    {} ({} bytes)", extra.name, extra.length);
    }
    for note in input.notes.iter().chain(&note_on_degrees(input)) {
        result!("  note     {note}");
    }
}
