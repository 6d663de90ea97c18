//! Isolated returns: rain, echoes and beams that meet two surfaces.

use std::path::{Path, PathBuf};

use las::Reader;

use crate::running::{points, report, run, simulated, succeed};

/// A street whose returns are one in 200 strays.
fn rainy_street(dir: &Path) -> PathBuf {
    simulated(
        dir,
        &["--length", "40", "--points", "400K", "--strays", "0.005"],
    )
}

/// The classes of the points of a file.
fn classes(path: &Path) -> Vec<u8> {
    let all = Reader::from_path(path).unwrap().read_all().unwrap();
    all.classification().collect()
}

/// The number of isolated returns by the report of `output`, and by its squares.
fn reported(output: &Path) -> [u64; 2] {
    let isolated = &report(output)["isolated"];
    let squares = isolated["squares"].as_array().unwrap().iter();
    let in_squares = squares
        .map(|square| square["count"].as_u64().unwrap())
        .sum();
    [isolated["count"].as_u64().unwrap(), in_squares]
}

const SPACING: [&str; 4] = ["--spacing", "0.3", "--iterations", "8"];

#[test]
fn isolated_returns_stay_go_or_are_marked_and_are_always_counted() {
    let dir = tempfile::tempdir().unwrap();
    let scans = rainy_street(dir.path());
    let outputs = ["keep", "drop", "mark"].map(|rule| {
        let output = dir.path().join(format!("{rule}.laz"));
        succeed(
            &scans,
            &output,
            &[&SPACING[..], &["--isolated", rule]].concat(),
        );
        output
    });
    let [kept, dropped, marked] = outputs.each_ref().map(|output| classes(output));
    let counts = outputs.each_ref().map(|output| reported(output));
    let [count, in_squares] = counts[0];
    assert_eq!(counts, [[count, in_squares]; 3]);
    assert!(count == in_squares && count > 500, "{count} {in_squares}");
    let noise = |classes: &[u8]| classes.iter().filter(|&&class| class == 7).count() as u64;
    // All others are where they would be, but for the neighbours of what has left.
    assert_eq!(dropped.len() as u64, kept.len() as u64 - count);
    assert_eq!(kept.len(), marked.len());
    // Strays within a spacing of a surface are one with it.
    assert!(
        10 * noise(&dropped) < noise(&kept),
        "{} of {}",
        noise(&dropped),
        noise(&kept)
    );
    // Those that are strays in truth have the class already.
    assert!(noise(&marked) >= noise(&kept) && noise(&marked) >= count);
    let default = dir.path().join("default.laz");
    succeed(&scans, &default, &SPACING);
    assert!(points(&default) == points(&outputs[0]));
}

#[test]
fn what_is_isolated_does_not_depend_on_tiles() {
    let dir = tempfile::tempdir().unwrap();
    let scans = rainy_street(dir.path());
    for rule in ["drop", "mark"] {
        let cloud = |name: &str, more: &[&str]| {
            let output = dir.path().join(format!("{rule}-{name}.laz"));
            let options = [&SPACING[..], &["--isolated", rule], more].concat();
            succeed(&scans, &output, &options);
            (points(&output), reported(&output))
        };
        let whole = cloud("whole", &["--threads", "1"]);
        for edge in ["9", "17"] {
            assert!(
                whole == cloud(edge, &["--tile-size", edge]),
                "{rule}, tiles of {edge} m"
            );
        }
    }
}

#[test]
fn a_count_is_met_without_isolated_returns() {
    let dir = tempfile::tempdir().unwrap();
    let scans = rainy_street(dir.path());
    let output = dir.path().join("even.laz");
    // One in three seeds is a stray.
    let options = ["--count", "2000", "--isolated", "drop", "--iterations", "8"];
    succeed(&scans, &output, &options);
    let report = report(&output);
    let dropped = report["isolated"]["count"].as_u64().unwrap();
    assert!(dropped > 500, "{dropped}");
    let count = points(&output).len();
    assert!(count.abs_diff(2000) <= 6, "{count}");
    let delta = report["uniformity"]["delta"].as_f64().unwrap();
    assert!(delta < 0.08, "{delta}");
}

#[test]
fn a_scan_of_which_all_is_isolated_leaves_a_clear_error() {
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("three.xyz.ply");
    std::fs::write(
        &scan,
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
         property double z\nend_header\n0 0 0\n50 0 0\n0 50 9\n",
    )
    .unwrap();
    let output = dir.path().join("even.ply");
    let done = run(&scan, &output, &["--spacing", "1", "--isolated", "drop"]);
    let said = String::from_utf8(done.stderr).unwrap();
    assert_eq!(done.status.code(), Some(1), "{said}");
    assert!(
        said.contains("all 3 ") && said.contains("--isolated keep"),
        "{said}"
    );
    assert!(!output.exists());
}
