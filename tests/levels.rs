//! Levels of an octree, and files of which every beginning is an even cloud.

use std::{fs, path::Path};

use las::{CopcReader, Reader};

use crate::running::{points, points_in_order, report, run, street, succeed, text};

/// The least distance between two of `points` over their mean nearest distance, their mean nearest distance, and the
/// coefficient of variation of the nearest distances; each point is compared with those up to `reach` east of it.
fn figures(points: &[[f64; 3]], reach: f64) -> [f64; 3] {
    let mut sorted = points.to_vec();
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut nearest = vec![f64::INFINITY; sorted.len()];
    for i in 0..sorted.len() {
        for j in i + 1..sorted.len() {
            let difference = [0, 1, 2].map(|axis| sorted[j][axis] - sorted[i][axis]);
            if difference[0] > reach {
                break;
            }
            let squared: f64 = difference.iter().map(|d| d * d).sum();
            nearest[i] = nearest[i].min(squared.sqrt());
            nearest[j] = nearest[j].min(squared.sqrt());
        }
    }
    nearest.retain(|distance| *distance <= reach);
    let count = nearest.len() as f64;
    assert!(count > 0.98 * points.len() as f64, "{count}");
    let mean = nearest.iter().sum::<f64>() / count;
    let variance = nearest.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / count;
    let least = nearest.iter().copied().fold(f64::INFINITY, f64::min);
    [least / mean, mean, variance.sqrt() / mean]
}

const OPTIONS: [&str; 4] = ["--spacing", "0.25", "--iterations", "3"];

#[test]
fn no_two_points_down_to_a_level_are_nearer_than_its_spacing() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let octree = dir.path().join("even.copc.laz");
    succeed(&scans, &octree, &OPTIONS);
    let mut reader = CopcReader::from_path(&octree).unwrap();
    let root_spacing = reader.header().copc_info_vlr().unwrap().spacing;
    let entries: Vec<_> = reader.hierarchy_entries().collect();
    let deepest = entries.iter().map(|entry| entry.key.l).max().unwrap();
    assert!(deepest >= 2, "{deepest}");
    let reported = report(&octree)["levels"]["figures"].clone();
    assert_eq!(reported.as_array().unwrap().len() as i32, deepest);
    let mut so_far = Vec::new();
    for level in 0..deepest {
        for entry in entries
            .iter()
            .filter(|e| e.key.l == level && e.point_count > 0)
        {
            let node = reader.read_entry(entry).unwrap();
            so_far.extend((node.x().zip(node.y()).zip(node.z())).map(|((x, y), z)| [x, y, z]));
        }
        let spacing = root_spacing / f64::from(1 << level);
        let [least, mean, cv] = figures(&so_far, 4.0 * spacing);
        assert!(least * mean >= 0.999 * spacing, "{level}: {}", least * mean);
        assert!(cv < 0.16, "{level}: {cv}");
        let figure = |name: &str| reported[level as usize][name].as_f64().unwrap();
        assert_eq!(figure("points") as usize, so_far.len());
        assert!((figure("cv") - cv).abs() < 1e-3 && (figure("spacing") - spacing).abs() < 1e-9);
    }
    let page = |ending: &str| fs::read_to_string(format!("{}.{ending}", octree.display())).unwrap();
    assert!(page("report.html").contains("<h2>Levels</h2>"));
    assert!(page("viewer.html").contains("id=\"level\""));
}

#[test]
fn every_beginning_of_a_progressive_file_is_an_even_cloud_whatever_the_tiles() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let path = |name: &str| dir.path().join(name);
    let progressive = [&OPTIONS[..], &["--order", "progressive"]].concat();
    let (plain, ordered, again) = (path("plain.laz"), path("ordered.laz"), path("again.laz"));
    succeed(&scans, &plain, &OPTIONS);
    succeed(&scans, &ordered, &progressive);
    let small = ["--memory", "160MiB", "--threads", "1", "--tile-size", "15"];
    succeed(&scans, &again, &[&progressive[..], &small].concat());
    assert!(points(&plain) == points(&ordered));
    assert!(points_in_order(&again) == points_in_order(&ordered));
    assert!(report(&plain).get("levels").is_none());

    let all = Reader::from_path(&ordered).unwrap().read_all().unwrap();
    let positions: Vec<[f64; 3]> = (all.x().zip(all.y()).zip(all.z()))
        .map(|((x, y), z)| [x, y, z])
        .collect();
    for share in [0.03, 0.1, 0.3] {
        let first = &positions[..(share * positions.len() as f64) as usize];
        let [least, _, cv] = figures(first, 3.0);
        assert!(least >= 0.7 && cv < 0.16, "{share}: {least}, {cv}");
    }

    // The order of polygon files is that of the others.
    let polygon = path("ordered.ply");
    succeed(&scans, &polygon, &progressive);
    let bytes = fs::read(&polygon).unwrap();
    let header = b"end_header\n";
    let start = bytes
        .windows(header.len())
        .position(|w| w == header)
        .unwrap()
        + header.len();
    let length = (bytes.len() - start) / positions.len();
    for (vertex, position) in bytes[start..].chunks_exact(length).zip(&positions) {
        for (axis, c) in position.iter().enumerate() {
            let written = f64::from_le_bytes(vertex[8 * axis..][..8].try_into().unwrap());
            assert!((written - c).abs() < 1e-6);
        }
    }
}

#[test]
fn a_progressive_order_is_refused_where_there_is_another_and_the_remedy_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let said = |output: &Path, more: &[&str]| {
        let options = [&OPTIONS[..], &["--order", "progressive"], more].concat();
        let done = run(&scans, output, &options);
        assert!(!done.status.success());
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    let path = |name: &str| dir.path().join(name);
    let mesh = path("mesh.ply");
    assert!(said(&path("a.laz"), &["--mesh", text(&mesh)]).contains("twice"));
    assert!(said(&path("a.copc.laz"), &[]).contains("levels without it"));
    assert!(said(&path("a"), &["--output-tiles", "20"]).contains("--output-tiles"));
}

/// The points read of an octree, and the least evenness, of a coarse cloud of all levels and of the upper ones.
#[test]
fn a_coarse_cloud_needs_the_upper_levels_of_an_octree_only() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let octree = dir.path().join("octree.copc.laz");
    succeed(&scans, &octree, &["--spacing", "0.12", "--iterations", "0"]);
    let coarse = |name: &str, more: &[&str]| {
        let output = dir.path().join(name);
        succeed(&octree, &output, &[&["--spacing", "4"][..], more].concat());
        let report = report(&output);
        let read = report["inputs"][0]["read"].as_u64().unwrap();
        let notes = report["notes"].to_string();
        assert_eq!(
            notes.contains("upper levels"),
            more.contains(&"auto"),
            "{notes}"
        );
        (
            output,
            read,
            report["uniformity"]["delta"].as_f64().unwrap(),
        )
    };
    let auto = ["--levels", "auto"];
    let (_, all, even) = coarse("all.laz", &[]);
    let (upper, read, as_even) = coarse("upper.laz", &auto);
    let (tiled, ..) = coarse("tiled.laz", &[&auto[..], &["--tile-size", "30"]].concat());
    assert!(read < all / 3, "{read} of {all}");
    assert!(as_even < 1.3 * even, "{as_even}, {even}");
    assert!(points(&tiled) == points(&upper));
    // A spacing for which no level is fine enough takes all.
    let output = dir.path().join("fine.laz");
    succeed(
        &octree,
        &output,
        &["--spacing", "0.3", "--levels", "auto", "--iterations", "0"],
    );
    assert_eq!(report(&output)["inputs"][0]["read"].as_u64(), Some(all));
    let refused = run(
        &octree,
        &output,
        &["--count", "1000", "--levels", "auto", "--overwrite"],
    );
    let problem = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(problem.contains("give --spacing"), "{problem}");
}
