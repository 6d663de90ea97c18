//! The number of points that was asked for.

use std::fs;

use crate::running::{lloydar, points, run, start, street, succeed, text};

const OPTIONS: [&str; 3] = ["--iterations", "8", "--exact"];

#[test]
fn an_exact_count_is_met_in_all_tilings_with_the_same_points() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    for count in ["4321", "9000"] {
        let cloud = |name: &str, more: &[&str]| {
            let output = dir.path().join(format!("{count}-{name}.laz"));
            let count = ["--count", count];
            succeed(&scans, &output, &[&OPTIONS[..], &count, more].concat());
            points(&output)
        };
        let whole = cloud("whole", &["--threads", "1"]);
        assert_eq!(whole.len().to_string(), count);
        assert!(whole == cloud("two-threads", &["--threads", "2"]));
        for edge in ["15", "31"] {
            assert!(
                whole == cloud(edge, &["--tile-size", edge]),
                "{count} points in tiles of {edge} m are others"
            );
        }
    }
}

#[test]
fn a_count_is_met_within_three_thousandths() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    for count in [700, 2_000, 12_000] {
        let output = dir.path().join(format!("{count}.laz"));
        let wanted = count.to_string();
        succeed(&scans, &output, &["--count", &wanted, "--iterations", "2"]);
        let written = points(&output).len() as f64;
        assert!(
            (written / f64::from(count) - 1.0).abs() <= 0.003,
            "{written}"
        );
    }
}

#[test]
fn many_processes_meet_a_count_as_one_does() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (one, many) = (dir.path().join("one.laz"), dir.path().join("many.laz"));
    let options = [&OPTIONS[..], &["--count", "6000", "--tile-size", "15"]].concat();
    succeed(&scans, &one, &options);
    let scatter = ["scatter", text(&scans), "-o", text(&many), "--quiet"];
    assert!(lloydar(&[&scatter[..], &options].concat()).status.success());
    let job = dir.path().join("many.laz.job");
    // One of three is killed in the first round; the others take its tiles over.
    let solve = ["solve", text(&job), "--threads", "1", "--patience", "15"];
    let mut workers = [start(&solve), start(&solve), start(&solve)];
    let has_begun = || {
        let names = fs::read_dir(&job).unwrap();
        names.filter_map(Result::ok).any(|entry| {
            let name = entry.file_name().into_string().unwrap();
            name.starts_with("starts-") && entry.metadata().unwrap().len() > 0
        })
    };
    while !has_begun() {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    workers[0].kill().unwrap();
    for worker in &mut workers {
        worker.wait().unwrap();
    }
    let stitch = ["stitch", text(&job), "--quiet", "--patience", "15"];
    assert!(lloydar(&stitch).status.success());
    assert!(fs::read(&one).unwrap() == fs::read(&many).unwrap());
    assert_eq!(points(&many).len(), 6000);
}

#[test]
fn exactness_of_what_is_no_count_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("even.laz");
    for (options, remedy) in [
        (
            ["--spacing", "1", "--exact"].as_slice(),
            "--count or --ratio",
        ),
        (
            &["--count", "900", "--exact", "--accelerate", "anderson"],
            "--accelerate none or relaxation",
        ),
    ] {
        let done = run(&scans, &output, options);
        assert_eq!(done.status.code(), Some(2));
        let said = String::from_utf8(done.stderr).unwrap();
        assert!(said.contains(remedy), "{said}");
    }
}
