//! Inputs in degrees, and of several systems.

use std::{fs, path::Path};

use las::Reader;

use crate::running::{lloydar, points, points_in_order, run, succeed, text};

const DEGREES: &str = "GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563]],\
    PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"EPSG\",\"4326\"]]";
const HEIGHTS: &str = "VERT_CS[\"EGM2008 height\",VERT_DATUM[\"EGM2008 geoid\",2005],UNIT[\"metre\",1],\
    AUTHORITY[\"EPSG\",\"3855\"]]";

/// Metres to a degree of latitude and of longitude at 50° N, as they are near enough for a test.
const DEGREE_IN_METRES: [f64; 2] = [71_695.7, 111_229.0];

/// The place at 15° E, 50° N in UTM zone 32, by PROJ.
const WEST_IN_ZONE_32: f64 = 929865.502;
const NORTH_IN_ZONE_32: f64 = 5555901.554;

/// A hilly piece of ground of 40 m, a point every 20 cm, as degrees around 15° E, 50° N.
fn ground(path: &Path, crs: &str) {
    const COUNT: i32 = 200;
    let mut text = format!(
        "ply\nformat ascii 1.0\ncomment crs {crs}\nelement vertex {}\nproperty double x\nproperty double y\n\
         property double z\nend_header\n",
        COUNT * COUNT
    );
    for n in 0..COUNT * COUNT {
        let [east, north] = [n % COUNT, n / COUNT].map(|step| 0.2 * f64::from(step - COUNT / 2));
        let height = 300.0 + 2.0 * (0.2 * east).sin() * (0.15 * north).cos();
        let [x, y] = [
            15.0 + east / DEGREE_IN_METRES[0],
            50.0 + north / DEGREE_IN_METRES[1],
        ];
        text += &format!("{x:.10} {y:.10} {height:.3}\n");
    }
    fs::write(path, text).unwrap();
}

fn errors(arguments: &[&str]) -> String {
    let done = lloydar(arguments);
    assert!(!done.status.success());
    String::from_utf8_lossy(&done.stderr).into_owned()
}

#[test]
fn degrees_are_resampled_in_their_utm_zone_and_keep_their_vertical_system() {
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("scan.ply");
    ground(
        &scan,
        &format!("COMPD_CS[\"WGS 84 + EGM2008\",{DEGREES},{HEIGHTS}]"),
    );

    // Without the option the zone is named, by `info` as well.
    let refused = run(&scan, &dir.path().join("no.laz"), &["--spacing", "0.8"]);
    let problem = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        problem.contains("EPSG:32633") && problem.contains("--reproject auto"),
        "{problem}"
    );
    let info = lloydar(&["info", text(&scan)]);
    assert!(String::from_utf8_lossy(&info.stdout).contains("EPSG:32633"));

    let even = dir.path().join("even.laz");
    succeed(&scan, &even, &["--spacing", "80cm", "--reproject", "auto"]);
    let mut reader = Reader::from_path(&even).unwrap();
    let crs = reader
        .header()
        .all_vlrs()
        .find(|vlr| vlr.record_id == 2112)
        .unwrap();
    let wkt = String::from_utf8_lossy(&crs.data).into_owned();
    assert!(
        wkt.starts_with("COMPD_CS[\"WGS 84 / UTM zone 33N + EGM2008 height\",PROJCS["),
        "{wkt}"
    );
    assert!(wkt.contains("\"3855\""));
    let all = reader.read_all().unwrap();
    // 40 m × 40 m and a slope: some 1600 m² over √3/2 · 0.8².
    assert!((2500..3800).contains(&all.len()), "{}", all.len());
    assert!(all.x().all(|x| (499_979.0..500_021.0).contains(&x)));
    assert!(all.y().all(|y| (5_538_600.0..5_538_670.0).contains(&y)));
    assert!(all.z().all(|z| (297.9..302.1).contains(&z)));

    // Compared with the scan in degrees, which is brought to the CRS of the cloud.
    let measured = lloydar(&["measure", text(&even), "--against", text(&scan), "--json"]);
    let figures: serde_json::Value = serde_json::from_slice(&measured.stdout).unwrap();
    assert!(
        figures["accuracy"]["max"].as_f64().unwrap() < 0.2,
        "{figures}"
    );
    assert!(
        figures["coverage"]["max"].as_f64().unwrap() < 1.0,
        "{figures}"
    );
}

#[test]
fn a_reprojected_cloud_has_the_same_bytes_for_any_tiles_and_bounds_are_in_its_system() {
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("scan.ply");
    ground(&scan, DEGREES);
    let path = |name: &str| dir.path().join(name);
    let options = ["--spacing", "0.5", "--reproject", "EPSG:3857"];
    let small = ["--tile-size", "12", "--threads", "1"];
    for name in ["a.pcd", "a.copc.laz"] {
        let (one, other) = (path(name), path(&format!("other-{name}")));
        succeed(&scan, &one, &options);
        succeed(&scan, &other, &[&options[..], &small].concat());
        match name.ends_with("pcd") {
            true => assert!(fs::read(&one).unwrap() == fs::read(&other).unwrap()),
            false => assert!(points_in_order(&one) == points_in_order(&other)),
        }
    }

    // Bounds are in the new system, and say which nodes of an octree are read.
    let (octree, flat) = (path("utm.copc.laz"), path("utm.laz"));
    let options = ["--spacing", "0.3", "--reproject", "auto"];
    succeed(&scan, &octree, &options);
    succeed(&scan, &flat, &options);
    let (west, north) = (WEST_IN_ZONE_32, NORTH_IN_ZONE_32);
    let sides = format!("{west},0,{},{north}", west + 100.0);
    let wanted = [
        "--spacing",
        "0.8",
        "--reproject",
        "EPSG:32632",
        "--bounds",
        &sides,
    ];
    let (of_octree, of_flat) = (path("part.laz"), path("flat.laz"));
    succeed(&octree, &of_octree, &wanted);
    succeed(&flat, &of_flat, &wanted);
    assert!(points(&of_octree) == points(&of_flat));
    let all = Reader::from_path(&of_octree).unwrap().read_all().unwrap();
    assert!(all.x().all(|x| x > west - 0.8) && all.y().all(|y| y < north + 0.8));
    assert!((400..1200).contains(&all.len()), "{}", all.len());
}

#[test]
fn scans_of_two_zones_become_one_cloud() {
    let dir = tempfile::tempdir().unwrap();
    let scans = dir.path().join("scans");
    fs::create_dir(&scans).unwrap();
    let scan = dir.path().join("scan.ply");
    ground(&scan, DEGREES);
    let as_zone = |code: &str, bounds: &str| {
        let output = scans.join(format!("{code}.laz"));
        let target = format!("EPSG:{code}");
        let options = [
            "--spacing",
            "0.4",
            "--reproject",
            &target,
            "--bounds",
            bounds,
        ];
        succeed(&scan, &output, &options);
    };
    // Two halves of the ground, each in a zone of its own.
    as_zone("32633", "0,0,500000,6000000");
    as_zone("32632", &format!("{WEST_IN_ZONE_32},0,999999,6000000"));
    let output = dir.path().join("one.laz");
    let refused = run(&scans, &output, &["--spacing", "0.8"]);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--reproject auto"));
    succeed(
        &scans,
        &output,
        &["--spacing", "0.8", "--reproject", "EPSG:32633"],
    );
    let all = Reader::from_path(&output).unwrap().read_all().unwrap();
    assert!(all.x().all(|x| (499_978.0..500_022.0).contains(&x)));
    assert!(all.x().any(|x| x > 500_010.0) && all.x().any(|x| x < 499_990.0));
}

#[test]
fn a_way_that_does_not_exist_is_refused_with_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    let scan = dir.path().join("scan.ply");
    ground(&scan, DEGREES);
    let output = dir.path().join("out.laz");
    let run = [
        "run",
        text(&scan),
        "-o",
        text(&output),
        "--spacing",
        "0.8",
        "--quiet",
    ];
    let with = |more: &[&str]| errors(&[&run[..], more].concat());
    assert!(with(&["--crs", "EPSG:4314", "--reproject", "EPSG:25833"]).contains("grids"));
    assert!(with(&["--reproject", "EPSG:4258"]).contains("degrees"));
    assert!(with(&["--reproject", "32633"]).contains("EPSG:32633"));
}
