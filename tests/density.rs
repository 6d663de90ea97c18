//! Clouds whose spacing follows rules.

use std::{fs, path::Path};

use las::Reader;
use lloydar::internals::{Street, StreetOptions};

use crate::{
    running::{points, report, run, simulated, succeed},
    solver::Dice,
};

/// Facades are twice, trees and poles three times as dense as the ground.
const RULES: &str = "class=6:0.15,14,15:0.1";

#[test]
fn tiles_of_any_size_and_tiles_in_two_rounds_agree() {
    let dir = tempfile::tempdir().unwrap();
    let scans = simulated(dir.path(), &["--length", "40", "--points", "500K"]);
    let cloud = |name: &str, more: &[&str]| {
        let output = dir.path().join(name);
        let few = ["--iterations", "12", "--fill", "0"];
        let rules = ["--spacing", "0.3", "--spacing-of", RULES];
        succeed(&scans, &output, &[&few[..], &rules[..], more].concat());
        output
    };
    let whole = cloud("whole.laz", &["--tile-size", "1000"]);
    let tiles = cloud("tiles.laz", &["--tile-size", "11", "--threads", "1"]);
    let of_tiles = report(&tiles);
    assert!(of_tiles["tiles"].as_array().unwrap().len() > 8);
    // The first of two rounds is a stage of its own.
    let mut stages = of_tiles["stages"].as_array().unwrap().iter();
    assert!(stages.any(|stage| stage["stage"] == "start"));
    assert!(points(&whole) == points(&tiles));

    // The report tells which spacings there are, and every point has its own.
    let classes = report(&whole)["spacings"].as_array().unwrap().clone();
    let of_classes = classes
        .iter()
        .map(|class| class["points"].as_u64().unwrap());
    assert_eq!(of_classes.sum::<u64>(), points(&whole).len() as u64);
    let finest = classes[0]["finest"].as_f64().unwrap();
    assert!((finest - 0.1).abs() < 1e-6, "{finest}");
}

/// A PLY file of `n` points at random in a cube of this `edge`, as those of leaves are.
fn leaves(path: &Path, n: u64, edge: f64) {
    let mut dice = Dice(7);
    let axes = "property double x\nproperty double y\nproperty double z";
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {n}\n{axes}\nend_header\n");
    for _ in 0..n {
        let [x, y, z] = [0; 3].map(|_| edge * dice.roll());
        text += &format!("{x:.3} {y:.3} {z:.3}\n");
    }
    fs::write(path, text).unwrap();
}

#[test]
fn leaves_are_hardly_denser_by_a_rule_than_with_one_spacing_and_an_octree_has_levels_of_the_finest()
{
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("leaves.ply");
    leaves(&scan, 16_000, 20.0);
    let count = |name: &str, options: &[&str]| {
        let output = dir.path().join(name);
        succeed(&scan, &output, options);
        report(&output)["points"].as_u64().unwrap()
    };
    let one = count("one.laz", &["--spacing", "1"]);
    // The rule holds for all points: the coarser spacing is nowhere.
    let ruled = count(
        "ruled.laz",
        &["--spacing", "1.02", "--spacing-of", "class=0:1"],
    );
    assert!((one..one * 125 / 100).contains(&ruled), "{one}, {ruled}");

    // By the coarsest spacing the root would have all points.
    let wide = ["--spacing", "4", "--spacing-of", "class=0:0.1"];
    let all = count("ruled.copc.laz", &wide);
    let levels = report(&dir.path().join("ruled.copc.laz"))["levels"].clone();
    let root = levels["figures"][0]["points"].as_u64();
    assert!(root.is_some_and(|root| root < all), "{levels}");
}

/// The mean distance from `street`, and the number, of the points of a file that have one of `classes`.
fn off_the_truth(path: &Path, street: &Street, classes: &[u8]) -> (f64, usize) {
    let all = Reader::from_path(path).unwrap().read_all().unwrap();
    let positions = all.x().zip(all.y()).zip(all.z());
    let of_classes = all
        .classification()
        .zip(positions)
        .filter(|(class, _)| classes.contains(class));
    let distances: Vec<f64> = of_classes
        .map(|(_, ((x, y), z))| street.distance_to_surface([x, y, z]))
        .collect();
    let count = distances.len();
    (distances.iter().sum::<f64>() / count as f64, count)
}

#[test]
fn points_are_as_true_as_those_of_one_spacing_and_a_count_is_met() {
    let dir = tempfile::tempdir().unwrap();
    let scans = simulated(dir.path(), &["--length", "20", "--points", "600K"]);
    let street = Street::new(StreetOptions {
        length: 20.0,
        points: 600_000,
        ..StreetOptions::default()
    });
    let cloud = |name: &str, options: &[&str]| {
        let output = dir.path().join(name);
        succeed(&scans, &output, options);
        output
    };
    let ruled = ["--spacing", "0.3", "--spacing-of", "class=6:0.15"];
    let graded = cloud("graded.laz", &ruled);
    let coarse = cloud("coarse.laz", &["--spacing", "0.3"]);
    let fine = cloud("fine.laz", &["--spacing", "0.15"]);
    for (classes, other) in [(&[6][..], &fine), (&[2, 11], &coarse)] {
        let (off, count) = off_the_truth(&graded, &street, classes);
        let (off_alone, count_alone) = off_the_truth(other, &street, classes);
        assert!(off < 1.05 * off_alone, "{classes:?}: {off} {off_alone}");
        // The ground is finer at the foot of the facades.
        let share = count as f64 / count_alone as f64;
        assert!((0.97..1.3).contains(&share), "{classes:?}: {share}");
    }
    let figures = report(&graded)["uniformity"].clone();
    assert!(
        figures["energy_ratio"].as_f64().unwrap() < 1.08,
        "{figures}"
    );

    // Fewer points, in the same proportions.
    let wanted = points(&graded).len() * 2 / 3;
    let count = wanted.to_string();
    let options = ["--count", &count, "--density"];
    let rules = dir.path().join("rules.toml");
    fs::write(
        &rules,
        "spacing = 0.3\n[[rule]]\nclass = 6\nspacing = 0.15\n",
    )
    .unwrap();
    let counted = cloud(
        "counted.laz",
        &[&options[..], &[rules.to_str().unwrap()]].concat(),
    );
    let missed = points(&counted).len() as f64 / wanted as f64 - 1.0;
    assert!(missed.abs() < 0.003, "{missed}");
}

#[test]
fn what_rules_cannot_do_is_said_before_anything_is_read() {
    let dir = tempfile::tempdir().unwrap();
    let scans = simulated(dir.path(), &["--length", "20", "--points", "20K"]);
    let said = |more: &[&str]| {
        let done = run(&scans, &dir.path().join("none.laz"), more);
        assert!(!done.status.success());
        String::from_utf8(done.stderr).unwrap()
    };
    let rules = ["--spacing", "0.5", "--spacing-of", "class=6:0.2"];
    let with = |more: &[&str]| said(&[&rules[..], more].concat());
    assert!(with(&["--mesh", "none.ply"]).contains("--mesh makes triangles of one size"));
    assert!(with(&["--accelerate", "anderson"]).contains("give --accelerate none or relaxation"));
    // Also where the rule is the only one, so that the spacing is the same everywhere.
    for spacing in [&["--spacing", "0.5"][..], &[]] {
        let unknown = said(&[spacing, &["--spacing-of", "roll=0..5:0.2"]].concat());
        assert!(
            unknown.contains("roll") && unknown.contains("intensity"),
            "{unknown}"
        );
    }
}
