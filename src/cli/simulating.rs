//! `simulate`: scans of a street whose true surfaces are known.

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::{exit::DONE, printing::result};
use crate::{
    config::{ConfigError, Count, Share},
    geometry::Quantization,
    job::{JobError, write_file},
    las::{
        CloudHeader, CloudWriter, Crs, Format, LasError, RecordFormat, RecordView, standard_length,
    },
    report::counted,
    simulate::{SimulatedPoint, Street, StreetOptions},
};

/// The street to simulate, and how it is scanned.
#[derive(clap::Args)]
pub(super) struct Simulation {
    /// Length of the street in metres
    #[arg(long, value_name = "LENGTH", default_value_t = 120.0)]
    length: f64,
    /// Number of points, of all passes together
    #[arg(long, value_name = "N", default_value = "2M")]
    points: Count,
    /// Number of times that the vehicle drives down the street; one file for each
    #[arg(long, value_name = "N", default_value_t = 2)]
    passes: u32,
    /// Standard deviation of the ranges in metres
    #[arg(long, value_name = "LENGTH", default_value_t = 0.01)]
    noise: f64,
    /// Points that are strays (rain, echoes, beams that meet two surfaces; class 7), as a share of all points: 1% or
    /// 0.01
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, value_parser = share_or_none)]
    strays: f64,
    /// Cars and people of which each is there in one pass only (class 64)
    #[arg(long, value_name = "N", default_value_t = 0)]
    passing: u32,
    /// Seed of the street and of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Replace an existing street
    #[arg(long)]
    overwrite: bool,
}

/// Reads a share of the points that may be nought: `1%`, `0.01`, `0`.
fn share_or_none(text: &str) -> Result<f64, String> {
    match text.trim_end_matches('%').parse() {
        Ok(0.0) => Ok(0.0),
        _ => text.parse().map(|Share(share)| share),
    }
}

/// Simulates a street, writes its scans and its description into the directory `output`, and prints
/// the scans.
pub(super) fn simulate(simulation: &Simulation, output: &Path) -> Result<u8, JobError> {
    for (path, points) in write_simulation(simulation, output)? {
        result!("{}: {}", counted(points, "point"), path.display());
    }
    Ok(DONE)
}

/// Simulates a street, and writes its scans and its description into the directory `output`. Returns
/// the scans with their numbers of points.
pub(super) fn write_simulation(
    simulation: &Simulation,
    output: &Path,
) -> Result<Vec<(PathBuf, u64)>, JobError> {
    // Written so that NaN is refused.
    let is_street = (20.0..=1e6).contains(&simulation.length)
        && (1..=100).contains(&simulation.passes)
        && (0.0..=1.0).contains(&simulation.noise)
        && (0.0..=0.5).contains(&simulation.strays)
        && simulation.passing <= 1000;
    if !is_street {
        return Err(ConfigError::Words(
            "a street is 20 m to 1000 km long, driven down 1 to 100 times, with a noise of 0 to 1 m, up to half of \
             its points strays, and up to 1000 cars and people in passing"
                .into(),
        )
        .into());
    }
    let street = Street::new(StreetOptions {
        length: simulation.length,
        passes: simulation.passes,
        points: simulation.points.0,
        noise: simulation.noise,
        strays: simulation.strays,
        passing: simulation.passing,
        seed: simulation.seed,
    });
    if !simulation.overwrite {
        check_free(&street, output)?;
    }
    let scans = write_street(&street, output)?;
    let path = output.join(STREET_FILE);
    let text = serde_json::to_string_pretty(street.options()).unwrap_or_default();
    write_file(&path, text.as_bytes())?;
    let line = |(time, [x, y, z]): (f64, [f64; 3])| format!("{time:.3},{x:.4},{y:.4},{z:.4}\n");
    let lines: String = street.way().into_iter().map(line).collect();
    let text = format!("time,x,y,z\n{lines}");
    write_file(&output.join(TRAJECTORY_FILE), text.as_bytes())?;
    Ok(scans)
}

/// The name of the file beside the scans that describes their street.
const STREET_FILE: &str = "street.json";

/// The name of the file beside the scans with the way of the scanner.
const TRAJECTORY_FILE: &str = "trajectory.csv";

/// The path of the scan of `pass`, counted from 0, in the directory `dir`.
fn scan_path(dir: &Path, pass: u32) -> PathBuf {
    dir.join(format!("pass-{}.laz", pass + 1))
}

/// Checks that nothing is replaced in the directory `dir` if the scans of `street` and its description are written there.
///
/// # Errors
///
/// [`JobError::Las`] with the first file that would be.
fn check_free(street: &Street, dir: &Path) -> Result<(), JobError> {
    let beside = [STREET_FILE, TRAJECTORY_FILE].map(|name| dir.join(name));
    let scans = (0..street.options().passes).map(|pass| scan_path(dir, pass));
    match scans.chain(beside).find(|path| path.exists()) {
        Some(path) => {
            let problem = "exists already; give another directory, or --overwrite";
            Err(LasError::new(&path, problem).into())
        }
        None => Ok(()),
    }
}

/// Returns the street whose scans are in the directory `dir`.
pub(super) fn street_in(dir: &Path) -> Result<Street, JobError> {
    let path = dir.join(STREET_FILE);
    let text = std::fs::read_to_string(&path).map_err(|source| JobError::Io {
        action: "read",
        path: path.display().to_string(),
        source,
    })?;
    let options = serde_json::from_str(&text).map_err(|e| {
        JobError::Refused(format!(
            "{}: is not the description of a simulated street: {e}; `lloydar simulate` writes one",
            path.display()
        ))
    })?;
    Ok(Street::new(options))
}

/// The number of slices that are simulated at once, and are in memory together.
const SLICES_AT_ONCE: u64 = 8;

/// Writes one LAZ file for each pass into the directory `dir`. Returns the files with their
/// numbers of points.
pub(super) fn write_street(street: &Street, dir: &Path) -> Result<Vec<(PathBuf, u64)>, JobError> {
    std::fs::create_dir_all(dir).map_err(|source| JobError::Io {
        action: "make",
        path: dir.display().to_string(),
        source,
    })?;
    let header = scan_header();
    (0..street.options().passes)
        .map(|pass| {
            let path = scan_path(dir, pass);
            write_pass(street, pass, &header, &path).map(|points| (path, points))
        })
        .collect()
}

/// Returns the header of a simulated scan.
fn scan_header() -> CloudHeader {
    CloudHeader {
        record: RecordFormat {
            point_format: SCAN_FORMAT,
            extra_bytes: Vec::new(),
        },
        quantization: Quantization {
            scale: 0.001,
            offset: [431_000.0, 5_400_000.0, 100.0],
        },
        crs: Crs::of_epsg(32_633),
        carried_records: Vec::new(),
        has_standard_time: false,
        provenance: "simulated".to_owned(),
    }
}

/// Writes the points of `pass`, counted from 0, to `path`, and returns their number.
fn write_pass(
    street: &Street,
    pass: u32,
    header: &CloudHeader,
    path: &Path,
) -> Result<u64, JobError> {
    let mut writer = CloudWriter::create(path, Format::Laz, header)?;
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
    let cloud = writer.complete()?;
    let points = cloud.points();
    cloud.deliver()?;
    Ok(points)
}

/// The point format of simulated scans: it has GPS time and colour.
const SCAN_FORMAT: u8 = 7;

/// Returns the record of a return, in [`SCAN_FORMAT`].
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_of_strays_is_a_percentage_or_a_number_and_may_be_nought() {
        let shares = ["1%", "0.01", "0", "0%"].map(share_or_none);
        assert_eq!(shares, [0.01, 0.01, 0.0, 0.0].map(Ok));
        assert!(share_or_none("-1%").is_err() && share_or_none("%").is_err());
    }
}
