//! Inputs on a server: the bytes of local ones, whatever fails on the way, and no more requests than they need.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Output,
    sync::OnceLock,
};

use las::CopcReader;
use tempfile::TempDir;

use crate::{
    range_server::{RangeServer, State},
    running::{lloydar, points, report, run, simulated, succeed, text},
};

/// What the beginning of a file costs: headers are read in pieces of 16 KiB, as are tables at its end.
const PIECE: u64 = 16 << 10;
/// Jobs that take no longer than necessary.
const OPTIONS: [&str; 4] = ["--spacing", "0.5", "--iterations", "1"];

fn stderr(done: &Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned()
}

/// A scan, as it is simulated, and as an octree. They are made once for all tests.
fn scans() -> &'static [PathBuf; 2] {
    static SCANS: OnceLock<(TempDir, [PathBuf; 2])> = OnceLock::new();
    let (_, scans) = SCANS.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let scans = simulated(dir.path(), &["--length", "30", "--points", "100K"]);
        let files = fs::read_dir(&scans)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        let scan = files
            .filter(|path| path.extension().is_some_and(|e| e == "laz"))
            .min()
            .unwrap();
        let octree = dir.path().join("street.copc.laz");
        succeed(&scans, &octree, &["--spacing", "0.12", "--iterations", "0"]);
        (dir, [scan, octree])
    });
    scans
}

fn name(path: &Path) -> &str {
    path.file_name().unwrap().to_str().unwrap()
}

/// Runs the job with `more` options on the file at `scan` and at `url`, and returns whether both give the same bytes.
fn gives_the_same(dir: &Path, scan: &Path, url: &str, more: &[&str]) -> bool {
    let options = [&OPTIONS[..], more].concat();
    let [local, remote] = ["local.laz", "remote.laz"].map(|name| dir.join(name));
    for output in [&local, &remote] {
        drop(fs::remove_file(output));
    }
    succeed(scan, &local, &options);
    succeed(Path::new(url), &remote, &options);
    fs::read(local).unwrap() == fs::read(remote).unwrap()
}

/// The bytes of the nodes of an octree that reach into `bounds`, and of everything that is no node.
fn needed(octree: &Path, [west, south, east, north]: [f64; 4]) -> [u64; 2] {
    let reader = CopcReader::from_path(octree).unwrap();
    let info = reader.header().copc_info_vlr().unwrap();
    let entries: Vec<_> = reader
        .hierarchy_entries()
        .filter(|entry| entry.point_count > 0)
        .collect();
    let (mut within, mut all) = (0, 0);
    for entry in &entries {
        let cube = entry.key.bounds(&info);
        let is_needed =
            cube.min.x <= east && cube.max.x >= west && cube.min.y <= north && cube.max.y >= south;
        within += if is_needed { entry.byte_size as u64 } else { 0 };
        all += entry.byte_size as u64;
    }
    [within, fs::metadata(octree).unwrap().len() - all]
}

/// A rectangle in the north-east quarter of a scan.
fn corner(scan: &Path) -> [f64; 4] {
    let reader = las::Reader::from_path(scan).unwrap();
    let bounds = reader.header().bounds();
    let [west, south] = [
        0.8 * bounds.max.x + 0.2 * bounds.min.x,
        0.8 * bounds.max.y + 0.2 * bounds.min.y,
    ];
    [west, south, bounds.max.x, bounds.max.y]
}

fn sides(bounds: [f64; 4]) -> String {
    bounds.map(|side| format!("{side:.3}")).join(",")
}

#[test]
fn remote_inputs_give_the_bytes_of_local_ones_and_only_what_is_needed_is_transferred() {
    let dir = tempfile::tempdir().unwrap();
    let [scan, octree] = scans();

    // Nodes in a rectangle only.
    let bounds = corner(octree);
    let server = RangeServer::of(name(octree), fs::read(octree).unwrap());
    let url = server.url(name(octree));
    assert!(gives_the_same(
        dir.path(),
        octree,
        &url,
        &["--bounds", &sides(bounds)]
    ));
    let [within, beside] = needed(octree, bounds);
    let whole = fs::metadata(octree).unwrap().len();
    let most = within * 11 / 10 + beside + 3 * PIECE;
    let sent = server.state().bytes;
    assert!(
        sent <= most && most < whole,
        "{sent} of {within} + {beside}, {whole} in all"
    );

    // Everything, once.
    for file in [octree, scan] {
        let server = RangeServer::of(name(file), fs::read(file).unwrap());
        assert!(gives_the_same(
            dir.path(),
            file,
            &server.url(name(file)),
            &[]
        ));
        let (sent, length) = (server.state().bytes, fs::metadata(file).unwrap().len());
        assert!(sent <= length * 11 / 10 + 3 * PIECE, "{sent} of {length}");
        assert!(server.state().requests.len() as u64 <= 12 + length / PIECE);
    }
}

#[test]
fn errors_of_a_server_do_not_show() {
    let dir = tempfile::tempdir().unwrap();
    let [_, octree] = scans();
    let server = RangeServer::of(name(octree), fs::read(octree).unwrap());
    server.state().is_faulty = true;
    let url = server.url(name(octree));
    let bounds = sides(corner(octree));
    assert!(gives_the_same(
        dir.path(),
        octree,
        &url,
        &["--bounds", &bounds]
    ));
    assert!(gives_the_same(
        dir.path(),
        octree,
        &url,
        &["--threads", "1"]
    ));
    assert!(server.state().requests.len() > 12);
}

#[test]
fn an_object_that_changes_is_refused_with_its_name() {
    let dir = tempfile::tempdir().unwrap();
    let [scan, _] = scans();
    let server = RangeServer::of(name(scan), fs::read(scan).unwrap());
    let url = server.url(name(scan));
    let output = dir.path().join("even.laz");
    let job = |more: &[&str]| run(Path::new(&url), &output, &[&OPTIONS[..], more].concat());

    // While it is read.
    server.state().changes_at_points = true;
    let done = job(&[]);
    let said = stderr(&done);
    assert!(
        !done.status.success() && said.contains(&url) && said.contains("has changed"),
        "{said}"
    );

    // Between a job that stops and the next run of it.
    server.state().changes_at_points = false;
    server.state().hides_points = true;
    let done = job(&["--restart"]);
    assert!(
        !done.status.success() && stderr(&done).contains("no such object"),
        "{}",
        stderr(&done)
    );
    server.state().hides_points = false;
    server.state().version += 1;
    let done = job(&[]);
    let said = stderr(&done);
    assert!(!done.status.success() && said.contains(&url), "{said}");
    assert!(said.contains("has changed since the job began"), "{said}");

    // The job goes on if it has not.
    server.state().version -= 1;
    assert!(job(&[]).status.success());
    let local = dir.path().join("local.laz");
    succeed(scan, &local, &OPTIONS);
    assert_eq!(fs::read(local).unwrap(), fs::read(output).unwrap());
}

#[test]
fn secrets_of_an_address_are_neither_shown_nor_written() {
    let dir = tempfile::tempdir().unwrap();
    let [scan, _] = scans();
    let server = RangeServer::of(name(scan), fs::read(scan).unwrap());
    server.state().signature = Some("X-Signature=h1dden&X-Key=h1dden".into());
    let plain = format!("http://user:h1dden@{}/{}", server.address(), name(scan));
    let signed = format!("{plain}?X-Signature=h1dden&X-Key=h1dden");
    let job = dir.path().join("job");
    let output = dir.path().join("even.laz");
    let more = [&OPTIONS[..], &["--keep-job", "--job", text(&job)]].concat();
    let arguments = [&["run", &signed, "-o", text(&output)], &more[..]].concat();
    let done = lloydar(&arguments);
    assert!(done.status.success(), "{}", stderr(&done));
    assert_eq!(report(&output)["inputs"][0]["path"], server.url(name(scan)));
    let refused = [
        lloydar(&["run", &plain, "-o", "x.laz", "--spacing", "1"]),
        lloydar(&["info", &format!("{signed}&no")]),
        lloydar(
            &[
                &["scatter", &signed, "-o", text(&output), "--overwrite"],
                &OPTIONS[..],
            ]
            .concat(),
        ),
    ];
    assert!(
        refused
            .iter()
            .all(|done| !done.status.success() && stderr(done).contains(name(scan)))
    );
    assert!(
        stderr(&refused[0]).contains("access is denied"),
        "{}",
        stderr(&refused[0])
    );
    assert!(
        stderr(&refused[2]).contains("signature"),
        "{}",
        stderr(&refused[2])
    );

    // Whatever was printed or written.
    let mut seen = vec![done.stdout, done.stderr];
    seen.extend(
        refused
            .into_iter()
            .flat_map(|done| [done.stdout, done.stderr]),
    );
    for directory in [dir.path(), &job] {
        let files = fs::read_dir(directory)
            .unwrap()
            .map(|entry| entry.unwrap().path());
        seen.extend(
            files
                .filter(|path| path.is_file())
                .map(|path| fs::read(path).unwrap()),
        );
    }
    assert!(seen.len() > 12);
    for bytes in seen {
        let text = String::from_utf8_lossy(&bytes);
        assert!(!text.contains("h1dden"), "{text}");
    }
}

#[test]
fn servers_that_cannot_serve_are_named_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let [scan, _] = scans();
    let said = |change: fn(&mut State), name: &str| {
        let server = RangeServer::of("scan.laz", fs::read(scan).unwrap());
        change(&mut server.state());
        let url = server.url(name);
        let done = lloydar(&["info", &url]);
        assert!(!done.status.success());
        let said = stderr(&done);
        assert!(said.contains(&url), "{said}");
        said
    };
    assert!(said(|state| state.ignores_ranges = true, "scan.laz").contains("parts of a file"));
    assert!(said(|state| state.misstates_ranges = true, "scan.laz").contains("another range"));
    assert!(said(|_| {}, "other.laz").contains("no such object"));
    assert!(
        said(
            |state| drop(state.files.insert("scan.laz".into(), b"LASF".into())),
            "scan.laz"
        )
        .contains("truncated")
    );
    assert!(
        said(
            |state| drop(state.files.insert("scan.laz".into(), vec![])),
            "scan.laz"
        )
        .contains("empty")
    );
    assert!(
        said(
            |state| drop(state.files.insert("a.ply".into(), vec![0; 9])),
            "a.ply"
        )
        .contains("copy it here")
    );
    for mesh in ["https://host/a.glb", "s3://bucket/a.glb"] {
        let done = run(
            scan,
            &dir.path().join("x.laz"),
            &["--spacing", "1", "--mesh", mesh],
        );
        assert!(
            stderr(&done).contains("a mesh is a file"),
            "{}",
            stderr(&done)
        );
    }
    let done = run(scan, Path::new("https://host/x.laz"), &["--spacing", "1"]);
    assert!(
        stderr(&done).contains("cannot be written to"),
        "{}",
        stderr(&done)
    );
}

/// A catalogue of files: their addresses and the rectangles that they are said to lie in.
fn catalogue(items: &[(String, [f64; 4])]) -> String {
    let item = |(href, bounds): &(String, [f64; 4])| {
        serde_json::json!({
            "type": "Feature", "stac_version": "1.0.0", "properties": { "proj:bbox": bounds, "proj:epsg": 32633 },
            "assets": { "data": { "href": href, "roles": ["data"] } },
        })
    };
    let items: Vec<_> = items.iter().map(item).collect();
    serde_json::json!({ "type": "FeatureCollection", "features": items }).to_string()
}

#[test]
fn of_a_catalogue_only_files_that_overlap_the_bounds_are_opened() {
    let dir = tempfile::tempdir().unwrap();
    let [scan, octree] = scans();
    let bounds = corner(scan);
    let beside = bounds.map(|side| side + 10_000.0);
    let items = |octree: String| {
        catalogue(&[
            ("./missing.laz".into(), beside),
            (octree, bounds),
            ("../../also-missing.laz".into(), beside),
        ])
    };
    let [local, remote] = ["local.laz", "remote.laz"].map(|name| dir.path().join(name));
    let within = sides(bounds);
    let options = [&OPTIONS[..], &["--bounds", &within]].concat();

    // Local, with a local file.
    let path = dir.path().join("city.vpc");
    fs::write(&path, items(text(octree).to_owned())).unwrap();
    succeed(&path, &local, &options);

    // Remote, with a remote file; lengths with a unit ask for the CRS, too.
    let server = RangeServer::new(State {
        files: BTreeMap::from([
            (
                "data/city.vpc".into(),
                items(format!("../{}", name(octree))).into_bytes(),
            ),
            (name(octree).into(), fs::read(octree).unwrap()),
        ]),
        ..State::default()
    });
    succeed(Path::new(&server.url("data/city.vpc")), &remote, &options);
    let opened: BTreeSet<String> = server.state().requests.iter().cloned().collect();
    let expected = BTreeSet::from(["data/city.vpc".to_owned(), name(octree).to_owned()]);
    assert_eq!(opened, expected);
    assert_eq!(fs::read(&local).unwrap(), fs::read(&remote).unwrap());

    // What is said to lie elsewhere is not found, but nobody asks.
    let done = run(&path, &dir.path().join("all.laz"), &OPTIONS);
    assert!(
        !done.status.success() && stderr(&done).contains("missing.laz"),
        "{}",
        stderr(&done)
    );

    // A remote catalogue cannot name files of this machine.
    let insolent = catalogue(&[(text(octree).into(), bounds)]);
    server
        .state()
        .files
        .insert("data/city.vpc".into(), insolent.into_bytes());
    let done = lloydar(&["info", &server.url("data/city.vpc")]);
    assert!(
        stderr(&done).contains("cannot know of"),
        "{}",
        stderr(&done)
    );
}

#[test]
fn tiles_are_catalogued_and_read_again() {
    let dir = tempfile::tempdir().unwrap();
    let scans = simulated(dir.path(), &["--length", "30", "--points", "100K"]);
    let tiles = dir.path().join("tiles");
    succeed(
        &scans,
        &tiles,
        &[&OPTIONS[..], &["--output-tiles", "10"]].concat(),
    );
    let text = fs::read_to_string(tiles.join("tiles.vpc")).unwrap();
    let catalogue: serde_json::Value = serde_json::from_str(&text).unwrap();
    let items = catalogue["features"].as_array().unwrap();
    assert!(items.len() > 2);
    let mut counted = 0;
    for item in items {
        let file = tiles.join(item["assets"]["data"]["href"].as_str().unwrap());
        let reader = las::Reader::from_path(&file).unwrap();
        let (header, properties) = (reader.header(), &item["properties"]);
        assert_eq!(properties["pc:count"], header.number_of_points());
        let bounds = header.bounds();
        let expected = [
            bounds.min.x,
            bounds.min.y,
            bounds.min.z,
            bounds.max.x,
            bounds.max.y,
            bounds.max.z,
        ];
        for (side, expected) in properties["proj:bbox"]
            .as_array()
            .unwrap()
            .iter()
            .zip(expected)
        {
            assert!((side.as_f64().unwrap() - expected).abs() < 1e-6);
        }
        counted += header.number_of_points();
    }
    let [by_catalogue, by_directory] = ["a.laz", "b.laz"].map(|name| dir.path().join(name));
    let coarse = ["--spacing", "1", "--iterations", "1"];
    succeed(&tiles.join("tiles.vpc"), &by_catalogue, &coarse);
    succeed(&tiles, &by_directory, &coarse);
    assert_eq!(points(&by_catalogue), points(&by_directory));
    assert_eq!(
        report(&by_catalogue)["inputs"].as_array().unwrap().len(),
        items.len()
    );
    assert!(counted > 1000);
    // Tiles with a catalogue may be replaced.
    succeed(
        &scans,
        &tiles,
        &[&OPTIONS[..], &["--output-tiles", "10", "--overwrite"]].concat(),
    );
}
