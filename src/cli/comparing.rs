//! `compare`: the figures of two clouds side by side, and a picture of both.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::{
    exit::DONE,
    measuring::{BEYOND, rows},
    options::by_name,
    printing::result,
    rendering::pixels,
};
use crate::{
    config::Bytes,
    job::{JobError, Measured, measure, write_file},
    picture::View,
    quality::DistanceFigures,
    report::figure,
    views::{Coloring, PairPictureOptions, png_path, render_pair},
};

/// Which clouds are compared, and how.
#[derive(Args)]
pub(super) struct CompareArguments {
    /// The first cloud: a LAS, LAZ, COPC or PLY file, a directory, a pattern
    #[arg(value_name = "A")]
    first: PathBuf,
    /// The second cloud
    #[arg(value_name = "B")]
    second: PathBuf,
    /// The scans that both were made from: the distances are those between each cloud and the
    /// scans, in place of those between the clouds
    #[arg(long, num_args = 1.., value_name = "INPUT")]
    against: Vec<PathBuf>,
    /// The picture of both (.png): A on the left, B on the right; below them a flat place from
    /// above, thirty spacings wide
    #[arg(short, long, value_name = "FILE", default_value = "compare.png", value_parser = png_path)]
    output: PathBuf,
    /// View of the whole clouds: top, oblique or street (from within, along the longer side)
    #[arg(long, default_value = "oblique", value_parser = by_name::<View>)]
    view: View,
    /// auto (colour if there is one, else height), height, intensity or class
    #[arg(long, default_value = "auto", value_parser = by_name::<Coloring>)]
    by: Coloring,
    /// Width and height of each of the four parts of the picture, in pixels
    #[arg(long, value_name = "WxH", default_value = "800x600", value_parser = pixels)]
    size: [u32; 2],
    /// Peak memory
    #[arg(long, value_name = "SIZE")]
    memory: Option<Bytes>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Two clouds side by side. Lengths are CRS units.
#[derive(Serialize)]
pub(super) struct Compared {
    /// The first cloud.
    a: MeasuredCloud,
    /// The second cloud.
    b: MeasuredCloud,
    /// The distances from the points of each to the other; none if both are compared with scans.
    #[serde(skip_serializing_if = "Option::is_none")]
    between: Option<Between>,
    /// The picture.
    picture: PathBuf,
}

/// A cloud with its figures.
#[derive(Serialize)]
struct MeasuredCloud {
    file: PathBuf,
    /// The spacing of the measured cloud, by the name that scripts know.
    lattice_spacing: f64,
    #[serde(flatten)]
    measured: Measured,
}

/// The distances between two clouds; their shares beyond 1.5 spacings refer to the spacing of the first.
#[derive(Serialize)]
struct Between {
    a_to_b: DistanceFigures,
    b_to_a: DistanceFigures,
}

/// Compares two clouds, and prints their figures.
pub(super) fn print_compared(arguments: &CompareArguments) -> Result<u8, JobError> {
    let compared = compared(arguments)?;
    if arguments.json {
        result!(
            "{}",
            serde_json::to_string_pretty(&compared).unwrap_or_default()
        );
        return Ok(DONE);
    }
    for [name, a, b, ideal] in table(&compared) {
        let line = format!("{name:<40} {a:>16} {b:>16}  {ideal}");
        result!("{}", line.trim_end());
    }
    Ok(DONE)
}

/// Measures both clouds, one after the other, each within the memory, and draws them.
pub(super) fn compared(arguments: &CompareArguments) -> Result<Compared, JobError> {
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let memory = arguments.memory.map(|bytes| bytes.0);
    let measured = |cloud: &Path, against: &[PathBuf]| {
        let temporary = std::env::temp_dir();
        measure(&[cloud.to_owned()], against, &temporary, memory, threads)
    };
    let [first, second] = [&arguments.first, &arguments.second];
    let is_against_scans = !arguments.against.is_empty();
    let others = match is_against_scans {
        true => &arguments.against,
        false => std::slice::from_ref(second),
    };
    let mut a = measured(first, others)?;
    let b = measured(second, &arguments.against)?;
    let between = match is_against_scans {
        true => None,
        false => a.accuracy.take().zip(a.coverage.take()),
    };

    let cloud = |file: &PathBuf, measured: Measured| MeasuredCloud {
        file: file.clone(),
        lattice_spacing: measured.spacing,
        measured,
    };
    let (a, b) = (cloud(first, a), cloud(second, b));
    let options = PairPictureOptions {
        view: arguments.view,
        coloring: arguments.by,
        size: arguments.size,
        spacings: [a.lattice_spacing, b.lattice_spacing],
    };
    let picture = render_pair([first, second], &options)?;
    write_file(&arguments.output, &picture)?;
    Ok(Compared {
        a,
        b,
        between: between.map(|(a_to_b, b_to_a)| Between { a_to_b, b_to_a }),
        picture: arguments.output.clone(),
    })
}

/// The value of a figure of an ideal cloud, by the name of the figure.
fn ideal(name: &str) -> &'static str {
    match name {
        "delta" | "  without the largest 1 %" | "cell-area CV" | "sigma / mean" => "even: 0",
        "energy over hexagonal"
        | "packing"
        | "share with six neighbours"
        | "  within a quarter of the mean area" => "even: 1",
        _ => "",
    }
}

/// The rows of the comparison: name, both values, and that of an ideal cloud.
fn table(compared: &Compared) -> Vec<[String; 4]> {
    let (a, b) = (&compared.a, &compared.b);
    let file_name = |cloud: &MeasuredCloud| {
        let name = cloud.file.file_name().unwrap_or(cloud.file.as_os_str());
        name.to_string_lossy().into_owned()
    };
    let row = |name: &str, a: String, b: String| [name.to_owned(), a, b, ideal(name).to_owned()];
    let mut table = vec![
        row("", file_name(a), file_name(b)),
        row(
            "spacing of as many on a lattice",
            figure(a.lattice_spacing),
            figure(b.lattice_spacing),
        ),
    ];

    // The figures of `measure`, each where both or one of them has it.
    let (of_a, of_b) = (rows(&a.measured), rows(&b.measured));
    let value = |rows: &[(String, String)], name: &str| {
        let found = rows.iter().find(|row| row.0 == name);
        found.map_or_else(|| "–".to_owned(), |row| row.1.clone())
    };
    let only_b = of_b.iter().filter(|row| of_a.iter().all(|a| a.0 != row.0));
    // The share beyond 1.5 spacings has another unit for each of the clouds.
    let is_comparable = |row: &&(String, String)| row.0 != BEYOND;
    for (name, _) in of_a.iter().chain(only_b).filter(is_comparable) {
        table.push(row(name, value(&of_a, name), value(&of_b, name)));
    }

    // Distances as multiples of the spacings, and those between the clouds.
    let in_spacings = |cloud: &MeasuredCloud, distances: &Option<DistanceFigures>| {
        let spacing = cloud.lattice_spacing;
        distances.map(|d| [d.mean, d.p99].map(|length| figure(length / spacing)))
    };
    for (name, of) in [
        (
            "cloud to scans",
            (&a.measured.accuracy, &b.measured.accuracy),
        ),
        (
            "scans to cloud",
            (&a.measured.coverage, &b.measured.coverage),
        ),
    ] {
        if let Some(([a_mean, a_p99], [b_mean, b_p99])) =
            in_spacings(a, of.0).zip(in_spacings(b, of.1))
        {
            table.push(row(&format!("{name}, mean / spacing"), a_mean, b_mean));
            table.push(row(&format!("{name}, p99 / spacing"), a_p99, b_p99));
        }
    }
    if let Some(between) = &compared.between {
        let (to, from) = (&between.a_to_b, &between.b_to_a);
        for (name, of) in [
            ("mean", [to.mean, from.mean]),
            ("p99", [to.p99, from.p99]),
            ("max", [to.max, from.max]),
        ] {
            let [to, from] = of.map(figure);
            table.push(row(
                &format!("to the nearest of the other, {name}"),
                to,
                from,
            ));
        }
    }
    table.push(row(
        "picture",
        compared.picture.display().to_string(),
        String::new(),
    ));
    table
}
