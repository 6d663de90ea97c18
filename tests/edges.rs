//! Points at sharp edges.

use std::path::Path;

use las::Reader;
use lloydar::internals::{Street, StreetOptions};

use crate::running::{points, simulated, succeed};

const SPACING: f64 = 0.25;

/// The distances of the points of a file from the truth and from the nearest edge of `street`, in spacings, of those
/// within two spacings of an edge.
fn at_edges(path: &Path, street: &Street) -> Vec<[f64; 2]> {
    let all = Reader::from_path(path).unwrap().read_all().unwrap();
    let positions = all.x().zip(all.y()).zip(all.z());
    positions
        .map(|((x, y), z)| [x, y, z])
        .map(|p| [street.distance_to_surface(p), street.distance_to_edge(p)].map(|d| d / SPACING))
        .filter(|&[_, to_edge]| to_edge <= 2.0)
        .collect()
}

#[test]
fn points_at_edges_are_on_the_planes_or_on_the_edge_in_all_tilings() {
    let dir = tempfile::tempdir().unwrap();
    let scans = simulated(dir.path(), &["--length", "40", "--points", "800K"]);
    let street = Street::new(StreetOptions {
        length: 40.0,
        points: 800_000,
        ..StreetOptions::default()
    });
    let spacing = SPACING.to_string();
    let cloud = |rule: &str, tiles: &str| {
        let output = dir.path().join(format!("{rule}-{tiles}.laz"));
        let options = ["--spacing", &spacing, "--edges", rule, "--tile-size", tiles];
        succeed(&scans, &output, &options);
        output
    };
    let [smooth, sharp, on] = ["smooth", "sharp", "on"].map(|rule| {
        let whole = cloud(rule, "1000");
        // So small tiles do their iterations in two rounds.
        assert!(points(&whole) == points(&cloud(rule, "10")), "{rule}");
        at_edges(&whole, &street)
    });
    let off = |all: &[[f64; 2]]| all.iter().map(|[off, _]| off).sum::<f64>() / all.len() as f64;
    assert!(
        off(&sharp) < 0.7 * off(&smooth),
        "{} {}",
        off(&sharp),
        off(&smooth)
    );
    assert!(
        off(&on) < 0.7 * off(&smooth),
        "{} {}",
        off(&on),
        off(&smooth)
    );
    let on_edge = |all: &[[f64; 2]]| all.iter().filter(|&&[_, to_edge]| to_edge < 0.05).count();
    assert!(
        on_edge(&on) > 3 * on_edge(&smooth),
        "{} {}",
        on_edge(&on),
        on_edge(&smooth)
    );
}
