//! Cars and people that one pass saw and others looked through.

use std::{
    fs,
    path::{Path, PathBuf},
};

use las::Reader;

use crate::running::{lloydar, points, report, run, simulated, start, succeed, text};

/// The class of what is there in one pass only of a simulated street.
const PASSING: u8 = 64;

/// A street of three passes, with cars and people of which each is there in one; and the way of the scanner.
fn busy_street(dir: &Path) -> (PathBuf, PathBuf) {
    let scans = simulated(
        dir,
        &[
            "--length",
            "60",
            "--points",
            "900K",
            "--passes",
            "3",
            "--passing",
            "8",
        ],
    );
    let way = scans.join("trajectory.csv");
    (scans, way)
}

const SPACING: [&str; 4] = ["--spacing", "0.3", "--iterations", "4"];

fn with_way<'a>(way: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
    let options = ["--transients", "drop", "--trajectory", text(way)];
    [&SPACING[..], &options, more].concat()
}

/// The positions of the points of a file that are of something passing, and those of all others.
fn by_kind(path: &Path) -> [Vec<[f64; 3]>; 2] {
    let all = Reader::from_path(path).unwrap().read_all().unwrap();
    let mut kinds = [Vec::new(), Vec::new()];
    let places = all.x().zip(all.y()).zip(all.z());
    for (((x, y), z), class) in places.zip(all.classification()) {
        kinds[usize::from(class != PASSING)].push([x, y, z]);
    }
    kinds
}

#[test]
fn what_has_gone_is_left_out_and_all_else_stays() {
    let dir = tempfile::tempdir().unwrap();
    let (scans, way) = busy_street(dir.path());
    let [kept, dropped] = ["kept.laz", "dropped.laz"].map(|name| dir.path().join(name));
    succeed(&scans, &kept, &SPACING);
    succeed(&scans, &dropped, &with_way(&way, &[]));
    let [[passing, others], [left, still]] = [by_kind(&kept), by_kind(&dropped)];
    assert!(passing.len() > 300, "{}", passing.len());
    assert!(
        10 * left.len() < passing.len(),
        "{} of {}",
        left.len(),
        passing.len()
    );
    // What others saw is covered as before.
    let is_near = |a: &[f64; 3], b: &[f64; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 0.45);
    let lost = others
        .iter()
        .filter(|&other| !still.iter().any(|point| is_near(point, other)));
    assert_eq!(lost.count(), 0);
    let counts = &report(&dropped)["transients"];
    assert!(
        (7..=8).contains(&counts["things"].as_u64().unwrap()),
        "two that touch are one: {counts}"
    );
    let filtered: u64 = report(&dropped)["inputs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|input| input["filtered"].as_u64().unwrap())
        .sum();
    assert_eq!(counts["points"], filtered);

    // No number of tiles or threads shows, nor the order of the files.
    let expected = points(&dropped);
    for more in [["--tile-size", "20"], ["--threads", "1"]] {
        succeed(
            &scans,
            &dropped,
            &with_way(&way, &[&more[..], &["--overwrite"]].concat()),
        );
        assert!(points(&dropped) == expected, "{more:?}");
    }
}

#[test]
fn one_visit_knows_of_nothing_that_has_gone_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let (scans, way) = busy_street(dir.path());
    let output = dir.path().join("even.laz");
    let drop_and_log = with_way(&way, &["--overwrite", "--log", "json"]);
    let follows_sight_lines = |scans: &Path| {
        let done = lloydar(
            &[
                &["run", text(scans), "-o", text(&output)],
                &drop_and_log[..],
            ]
            .concat(),
        );
        let said = String::from_utf8(done.stderr).unwrap();
        assert!(
            done.status.success() && said.contains(r#""visits""#),
            "{said}"
        );
        said.contains(r#""sight lines""#)
    };
    let pass = scans.join("pass-1.laz");
    succeed(&pass, &output, &SPACING);
    let kept = points(&output);
    assert!(!follows_sight_lines(&pass));
    assert!(points(&output) == kept);
    let nothing = serde_json::json!({"points": 0, "things": 0, "one_visit": true});
    assert_eq!(report(&output)["transients"], nothing);
    let page = fs::read_to_string(dir.path().join("even.laz.report.html")).unwrap();
    assert!(page.contains("all points were seen in one visit"));

    assert!(follows_sight_lines(&scans));
    assert_eq!(report(&output)["transients"]["one_visit"], false);
}

#[test]
fn processes_that_scatter_together_look_once() {
    let dir = tempfile::tempdir().unwrap();
    let (scans, way) = busy_street(dir.path());
    let [one, many] = ["one.laz", "many.laz"].map(|name| dir.path().join(name));
    succeed(&scans, &one, &with_way(&way, &[]));
    let scatter = |shard: &str| {
        let command = [
            "scatter",
            text(&scans),
            "-o",
            text(&many),
            "--shard",
            shard,
            "--quiet",
        ];
        start(&[&command[..], &with_way(&way, &[])].concat())
    };
    let mut workers = ["0/2", "1/2"].map(scatter);
    for worker in &mut workers {
        assert!(worker.wait().unwrap().success());
    }
    let job = dir.path().join("many.laz.job");
    let claims = fs::read_dir(&job).unwrap();
    let names = claims.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let of_search: Vec<String> = names
        .filter(|name| name.starts_with("transients"))
        .collect();
    assert_eq!(
        of_search.len(),
        3,
        "one claim, complete, and what was found: {of_search:?}"
    );
    let scatter = ["scatter", text(&scans), "-o", text(&many), "--quiet"];
    for arguments in [
        [&scatter[..], &with_way(&way, &[])].concat(),
        vec!["solve", text(&job), "--quiet"],
        vec!["stitch", text(&job), "--quiet"],
    ] {
        let done = lloydar(&arguments);
        assert!(
            done.status.success(),
            "{}",
            String::from_utf8_lossy(&done.stderr)
        );
    }
    assert!(fs::read(&one).unwrap() == fs::read(&many).unwrap());
}

#[test]
fn what_cannot_be_known_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let (scans, way) = busy_street(dir.path());
    let output = dir.path().join("even.laz");
    let fails = |options: &[&str], words: &[&str]| {
        let done = run(&scans, &output, options);
        let said = String::from_utf8(done.stderr).unwrap();
        assert!(!done.status.success() && !output.exists(), "{said}");
        for word in words {
            assert!(said.contains(word), "{word}: {said}");
        }
    };
    fails(
        &[&SPACING[..], &["--transients", "drop"]].concat(),
        &["--trajectory"],
    );
    let missing = dir.path().join("missing.csv");
    fails(&with_way(&missing, &[]), &["missing.csv"]);
    // Times of another kind.
    let standard = dir.path().join("standard.csv");
    fs::write(
        &standard,
        "time,x,y,z\n250000000,431000,5400000,102\n250000015,431050,5400020,102\n",
    )
    .unwrap();
    fails(
        &with_way(&standard, &[]),
        &["300000", "250000000", "standard time"],
    );
    // Places in another CRS.
    let elsewhere = dir.path().join("elsewhere.csv");
    let way_there = fs::read_to_string(&way).unwrap().replace(",431", ",531");
    fs::write(&elsewhere, way_there).unwrap();
    fails(
        &with_way(&elsewhere, &[]),
        &["from where the scanner was", "CRS"],
    );
    // A trajectory is part of the job: what an earlier run has found by another one does not count.
    fs::write(&standard, fs::read(&way).unwrap()).unwrap();
    succeed(&scans, &output, &with_way(&standard, &[]));
    assert!(report(&output)["transients"]["things"].as_u64() >= Some(7));
}
