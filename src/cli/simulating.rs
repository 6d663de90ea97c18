//! `simulate` and `demo`: data to try everything on, with known surfaces.

use std::path::{Path, PathBuf};

use crate::{
    config::{Choices, Count, Length},
    geometry::Quantization,
    job::{JobDescription, JobError, default_directory},
    las::{CloudHeader, CloudWriter, Format, RecordFormat, RecordView, Workspace, standard_length},
    report::REPORT_PAGE,
    simulate::{SimulatedPoint, Street, StreetOptions},
};
use rayon::prelude::*;

use super::{printing::result, terminal::Look};

/// What street is simulated.
#[derive(clap::Args)]
pub(super) struct Simulation {
    /// Length of the street in metres
    #[arg(long, value_name = "LENGTH", default_value_t = 120.0)]
    length: f64,
    /// Points of all passes
    #[arg(long, value_name = "N", default_value = "2M")]
    points: Count,
    /// Times that the vehicle drives down the street; a file each
    #[arg(long, value_name = "N", default_value_t = 2)]
    passes: u32,
    /// Standard deviation of the ranges in metres
    #[arg(long, value_name = "LENGTH", default_value_t = 0.01)]
    noise: f64,
    /// Another seed, another street
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

pub(super) fn simulate(simulation: &Simulation, output: &Path) -> Result<u8, JobError> {
    // Written so that NaN is refused.
    let is_street = (20.0..=1e6).contains(&simulation.length)
        && (1..=100).contains(&simulation.passes)
        && (0.0..=1.0).contains(&simulation.noise);
    if !is_street {
        return Err(JobError::Refused(
            "a street is 20 m to 1000 km long, driven down 1 to 100 times, with a noise of 0 to 1 m"
                .into(),
        ));
    }
    let street = Street::new(StreetOptions {
        length: simulation.length,
        passes: simulation.passes,
        points: simulation.points.0,
        noise: simulation.noise,
        seed: simulation.seed,
    });
    for (path, points) in write_street(&street, simulation.passes, output)? {
        result!("{} points: {}", points, path.display());
    }
    let path = output.join(TRUTH);
    let text = serde_json::to_string_pretty(street.options()).unwrap_or_default();
    std::fs::write(&path, text).map_err(|source| JobError::Io {
        action: "write",
        path: path.display().to_string(),
        source,
    })?;
    Ok(0)
}

/// What a street was simulated by, beside its scans.
const TRUTH: &str = "street.json";

/// The street whose scans are in `dir`.
pub(super) fn street_of(dir: &Path) -> Result<Street, JobError> {
    let path = dir.join(TRUTH);
    let text = std::fs::read_to_string(&path).map_err(|source| JobError::Io {
        action: "read",
        path: path.display().to_string(),
        source,
    })?;
    let options = serde_json::from_str(&text)
        .map_err(|e| JobError::Refused(format!("{}: describes no street: {e}", path.display())))?;
    Ok(Street::new(options))
}

/// Simulates a street and resamples it, as anyone would with own data.
pub(super) fn demo(output: &Path) -> Result<u8, JobError> {
    let scans = output.join("scans");
    result!("simulating a street: 2 400 000 points in 3 passes");
    let street = Street::new(StreetOptions {
        length: 100.0,
        passes: 3,
        points: 2_400_000,
        ..StreetOptions::default()
    });
    write_street(&street, 3, &scans)?;
    let cloud = output.join("street.laz");
    result!(
        "lloydar run {} -o {} --spacing 0.2 --memory 256MiB",
        scans.display(),
        cloud.display()
    );
    let choices = Choices {
        spacing: Some(Length::plain(0.2)),
        memory: Some(crate::config::Bytes(256 << 20)),
        ..Choices::default()
    };
    let page = super::with_ending(&cloud, REPORT_PAGE);
    let job = JobDescription {
        inputs: vec![scans],
        dir: default_directory(&cloud),
        scratch: None,
        output: cloud,
        settings: choices.settings(None)?,
        overwrite: true,
        keep: false,
        skip_bad_files: false,
        restart: false,
    };
    let code = super::run_and_report(&job, Look::choose(false, false))?;
    if let Ok(page) = std::path::absolute(page) {
        result!("\nsee it:   file://{}", page.display());
    }
    Ok(code)
}

/// Slices simulated at once: what is held in memory.
const SLICES_AT_ONCE: u64 = 8;

/// One LAZ file a pass; each with its points.
fn write_street(street: &Street, passes: u32, dir: &Path) -> Result<Vec<(PathBuf, u64)>, JobError> {
    std::fs::create_dir_all(dir).map_err(|source| JobError::Io {
        action: "make",
        path: dir.display().to_string(),
        source,
    })?;
    let header = CloudHeader {
        record: RecordFormat {
            point_format: SCAN_FORMAT,
            extra_bytes: Vec::new(),
        },
        quantization: Quantization {
            scale: 0.001,
            offset: [431_000.0, 5_400_000.0, 100.0],
        },
        crs: crate::las::Crs::of_epsg(32_633),
        kept_records: Vec::new(),
        has_standard_time: false,
        provenance: "simulated".to_owned(),
    };
    let workspace = Workspace {
        spacing: header.quantization.scale,
        tile_edge: 0.0,
        stem: dir.join("sorting"),
        buffer_bytes: 0,
        sort_bytes: 0,
    };
    (0..passes)
        .map(|pass| {
            let path = dir.join(format!("pass-{}.laz", pass + 1));
            let mut writer = CloudWriter::create(&path, Format::Laz, &header, &workspace)?;
            let slices = street.slices(pass);
            for first in (0..slices).step_by(SLICES_AT_ONCE as usize) {
                let batch: Vec<Vec<u8>> = (first..slices.min(first + SLICES_AT_ONCE))
                    .into_par_iter()
                    .map(|slice| {
                        let points = street.slice(pass, slice);
                        points
                            .iter()
                            .flat_map(|point| record(point, &header.quantization))
                            .collect()
                    })
                    .collect();
                for records in batch {
                    writer.write(&records)?;
                }
            }
            let cloud = writer.complete(&|_| {})?;
            let points = cloud.points();
            cloud.deliver()?;
            Ok((path, points))
        })
        .collect()
}

/// The point format of simulated scans: it has GPS time and colour.
const SCAN_FORMAT: u8 = 7;

/// A return as a record of [`SCAN_FORMAT`].
fn record(
    point: &SimulatedPoint,
    quantization: &Quantization,
) -> [u8; standard_length(SCAN_FORMAT)] {
    let position = quantization
        .quantise(point.position)
        .expect("a street of 1000 km is within two million metres of its start");
    let mut record = RecordView::new([0; standard_length(SCAN_FORMAT)]);
    record.set_position(position);
    record.set_intensity(point.intensity);
    record.set_single_return();
    record.set_classification(point.class);
    record.set_scan_angle(point.angle);
    record.set_point_source(point.pass);
    record.set_gps_time(point.gps_time);
    record.set_color(point.color);
    record.into_bytes()
}
