//! `measure`: how even a cloud is, and how near it is to scans and to true surfaces.

use std::path::PathBuf;

use clap::Args;

use super::{exit::DONE, inputs::Inputs, printing::result, simulating};
use crate::{
    config::Bytes,
    job::{JobError, Measured, measure, measure_against_surface},
    quality::DistanceFigures,
    report::{figure, thousands},
};

/// Which cloud is measured, and against what.
#[derive(Args)]
pub(super) struct MeasureArguments {
    #[command(flatten)]
    files: Inputs,
    /// The scans that the cloud was made from: adds the distances from the cloud to them, and
    /// from them to the cloud
    #[arg(long, num_args = 1.., value_name = "INPUT")]
    against: Vec<PathBuf>,
    /// The directory of the simulated street that the cloud was made from: adds the distances
    /// from the cloud to the true surfaces
    #[arg(long, value_name = "DIR")]
    truth: Option<PathBuf>,
    /// Peak memory
    #[arg(long, value_name = "SIZE")]
    memory: Option<Bytes>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Measures a cloud and prints its figures.
pub(super) fn print_measured(arguments: &MeasureArguments) -> Result<u8, JobError> {
    let measured = measured(arguments)?;
    if arguments.json {
        result!(
            "{}",
            serde_json::to_string_pretty(&measured).unwrap_or_default()
        );
        return Ok(DONE);
    }
    for (name, value) in rows(&measured) {
        result!("{name:<32} {value}");
    }
    Ok(DONE)
}

/// Measures a cloud.
pub(super) fn measured(arguments: &MeasureArguments) -> Result<Measured, JobError> {
    let files = &arguments.files.paths()?;
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let memory = arguments.memory.map(|bytes| bytes.0);
    let temporary = std::env::temp_dir();
    let mut measured = measure(files, &arguments.against, &temporary, memory, threads)?;
    if let Some(dir) = &arguments.truth {
        let street = simulating::street_in(dir)?;
        let distance = |position| street.distance_to_surface(position);
        let figures = measure_against_surface(files, measured.spacing, distance)?;
        measured.truth = Some(figures);
    }
    Ok(measured)
}

/// The name of the share of distances beyond 1.5 spacings.
pub(super) const BEYOND: &str = "  farther than 1.5 spacings";

/// Returns names and values of all figures.
pub(super) fn rows(measured: &Measured) -> Vec<(String, String)> {
    let u = &measured.uniformity;
    let uniformity = [
        ("points", thousands(measured.points)),
        ("delta", figure(u.delta)),
        ("  without the largest 1 %", figure(u.delta_trimmed)),
        ("energy over hexagonal", figure(u.energy_ratio)),
        ("cell-area CV", figure(u.cell_area_cv)),
        ("packing", figure(u.packing)),
        ("share with six neighbours", figure(u.six_neighbors)),
        ("  within a quarter of the mean area", figure(u.even_cells)),
        ("mean nearest distance", figure(u.mean)),
        ("min / mean", figure(u.min)),
        ("p1 / mean", figure(u.p1)),
        ("p50 / mean", figure(u.p50)),
        ("p99 / mean", figure(u.p99)),
        ("sigma", figure(u.sigma)),
        ("sigma / mean", figure(u.sigma_over_mean)),
        ("epsilon", figure(u.epsilon)),
        ("none within four spacings", thousands(u.alone)),
    ];
    let distances = |from_to: &str, d: &DistanceFigures| {
        [("mean", d.mean), ("p99", d.p99), ("max", d.max)]
            .map(|(name, value)| (format!("{from_to}, {name}"), figure(value)))
    };
    let mut rows: Vec<(String, String)> = uniformity
        .map(|(name, value)| (name.to_owned(), value))
        .into();
    if let Some(alone) = &measured.alone {
        rows.extend([
            ("  their nearest, mean".to_owned(), figure(alone.mean)),
            ("  their nearest, max".to_owned(), figure(alone.max)),
        ]);
    }
    if let (Some(accuracy), Some(coverage)) = (&measured.accuracy, &measured.coverage) {
        rows.extend(distances("cloud to scans", accuracy));
        rows.extend(distances("scans to cloud", coverage));
        let share = format!("{:.3} %", 100.0 * coverage.share_beyond);
        rows.push((BEYOND.to_owned(), share));
    }
    if let Some(truth) = &measured.truth {
        rows.extend(distances("cloud to true surfaces", truth));
    }
    rows
}
