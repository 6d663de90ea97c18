//! What `measure`, `info` and `plan` print, for people and for machines.

use std::path::{Path, PathBuf};

use crate::{
    config::Bytes,
    job::{JobError, JobPlan, measure, measure_against_surface},
    las::{InputFile, expand_inputs},
    report::{figure, thousands},
};

use super::{
    FAILED, cores,
    printing::{result, say},
    simulating,
};

/// Measures a cloud and prints its figures.
pub(super) fn measure_cloud(
    files: &[PathBuf],
    against: &[PathBuf],
    truth: Option<&Path>,
    memory: Option<Bytes>,
    json: bool,
) -> Result<u8, JobError> {
    let threads = cores();
    let memory = memory.map(|bytes| bytes.0);
    let mut measured = measure(files, against, &std::env::temp_dir(), memory, threads)?;
    if let Some(dir) = truth {
        let street = simulating::street_of(dir)?;
        let distance = |place| street.distance_to_surface(place);
        let figures = measure_against_surface(files, measured.spacing, distance)?;
        measured.truth = Some(figures);
    }
    if json {
        result!(
            "{}",
            serde_json::to_string_pretty(&measured).unwrap_or_default()
        );
        return Ok(0);
    }
    let u = &measured.uniformity;
    let mut rows = vec![
        ("points", thousands(measured.points)),
        ("delta", figure(u.delta)),
        ("  largest 1 % left out", figure(u.delta_trimmed)),
        ("energy over hexagonal", figure(u.energy_ratio)),
        ("cell-area CV", figure(u.cell_area_cv)),
        ("packing", figure(u.packing)),
        ("six neighbours", figure(u.six_neighbors)),
        ("mean distance", figure(u.mean)),
        ("min / mean", figure(u.min)),
        ("p1 / mean", figure(u.p1)),
        ("p50 / mean", figure(u.p50)),
        ("p99 / mean", figure(u.p99)),
        ("sigma", figure(u.sigma)),
        ("sigma / mean", figure(u.sigma_over_mean)),
        ("epsilon", figure(u.epsilon)),
        ("alone", thousands(u.alone)),
    ];
    if let (Some(accuracy), Some(coverage)) = (&measured.accuracy, &measured.coverage) {
        rows.extend([
            ("to the scans, mean", figure(accuracy.mean)),
            ("              99 %", figure(accuracy.p99)),
            ("              max", figure(accuracy.max)),
            ("from the scans, mean", figure(coverage.mean)),
            ("                99 %", figure(coverage.p99)),
            ("                max", figure(coverage.max)),
            ("  share beyond 1.5 h", figure(coverage.share_beyond)),
        ]);
    }
    if let Some(truth) = &measured.truth {
        rows.extend([
            ("to the truth, mean", figure(truth.mean)),
            ("              99 %", figure(truth.p99)),
            ("              max", figure(truth.max)),
        ]);
    }
    for (name, value) in rows {
        result!("{name:<24} {value}");
    }
    Ok(0)
}

/// Prints what the headers of scans say.
pub(super) fn print_info(files: &[PathBuf], json: bool) -> Result<u8, JobError> {
    let paths = expand_inputs(files)?;
    let mut code = 0;
    for path in paths {
        match InputFile::survey(&path) {
            Ok(input) if json => result!("{}", described(&input)),
            Ok(input) => print_input(&input),
            Err(error) => {
                say!("lloydar: {error}");
                code = FAILED;
            }
        }
    }
    Ok(code)
}

/// What the headers of a file say, for machines.
fn described(input: &InputFile) -> serde_json::Value {
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
        "crs": input.crs.as_ref().map(crate::las::Crs::name),
        "metres_per_unit": input.crs.as_ref().and_then(crate::las::Crs::metres_per_unit),
        "has_standard_time": input.has_standard_time,
        "generating_software": input.generating_software,
        "extra_bytes": extra.collect::<Vec<_>>(),
        "notes": input.notes,
    })
}

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
            min[axis],
            max[axis],
            input.scale[axis],
            input.offset[axis]
        );
    }
    let area = (max[0] - min[0]) * (max[1] - min[1]);
    result!(
        "  density  {} points to the square unit of its bounds",
        figure(input.points_claimed as f64 / area)
    );
    result!(
        "  CRS      {}",
        input
            .crs
            .as_ref()
            .map_or("none".into(), crate::las::Crs::name)
    );
    for extra in &input.extra_bytes {
        result!("  extra    {} ({} bytes)", extra.name, extra.length);
    }
    for note in &input.notes {
        result!("  note     {note}");
    }
}

/// Prints what would be done.
pub(super) fn print_plan(plan: &JobPlan) {
    let mebibytes = |bytes: u64| format!("{} MiB", thousands(bytes >> 20));
    let rows = [
        ("points in", thousands(plan.points)),
        ("points out, about", thousands(plan.points_out)),
        ("spacing", format!("{:.4}", plan.spacing)),
        ("tiles", thousands(plan.plan.tiles.len() as u64)),
        ("halo", format!("{:.3}", plan.halo)),
        (
            "peak memory",
            format!("{} of {}", mebibytes(plan.memory), mebibytes(plan.budget)),
        ),
        ("temporary disk", mebibytes(plan.temporary)),
        ("time, roughly", format!("{:.0} s", plan.seconds)),
    ];
    for (name, value) in rows {
        result!("{name:<20} {value}");
    }
}
