//! The first minutes: what the program does for a user who says little, and many files at once.

use std::{
    fs,
    io::Write,
    path::Path,
    process::{Command, Output, Stdio},
};

use crate::running::{PROGRAM, lloydar, points, report, simulated, street, succeed, text};

/// Runs the program in the directory `dir`.
fn in_directory(dir: &Path, arguments: &[&str]) -> Output {
    let done = Command::new(PROGRAM)
        .current_dir(dir)
        .args(arguments)
        .env("SOURCE_DATE_EPOCH", "1700000000")
        .stdin(Stdio::null())
        .output();
    done.unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The spacing that standard error says is proposed.
fn proposed(output: &Output) -> f64 {
    let said = said(output);
    let after = said.split("spacing ").nth(1).unwrap();
    after.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn three_words_make_an_even_cloud_whatever_the_threads() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    fs::copy(scans.join("pass-1.laz"), dir.path().join("scan.laz")).unwrap();
    let done = in_directory(dir.path(), &["run", "scan.laz"]);
    assert!(done.status.success(), "{}", said(&done));
    for expected in [
        "proposed",
        "--spacing",
        "lloydar plan",
        "scan.even.copc.laz",
    ] {
        assert!(said(&done).contains(expected), "{}", said(&done));
    }
    let even = dir.path().join("scan.even.copc.laz");
    let figures = report(&even);
    let to_one = 150_000.0 / figures["points"].as_f64().unwrap();
    assert!((10.0..100.0).contains(&to_one), "{to_one}");

    // The job is that of the spacing that was said.
    let asked = dir.path().join("asked.copc.laz");
    let spacing = proposed(&done).to_string();
    let scan = dir.path().join("scan.laz");
    succeed(&scan, &asked, &["--spacing", &spacing, "--threads", "1"]);
    assert_eq!(fs::read(&even).unwrap(), fs::read(&asked).unwrap());

    // An existing output is kept, and the refusal comes before the scan is read.
    let again = in_directory(dir.path(), &["run", "scan.laz"]);
    assert_eq!(again.status.code(), Some(1));
    assert!(said(&again).contains("--overwrite"), "{}", said(&again));
    assert!(!said(&again).contains("proposed"), "{}", said(&again));
    let planned = in_directory(dir.path(), &["plan", "scan.laz"]);
    assert!(planned.status.success(), "{}", said(&planned));
    let with_one = in_directory(
        dir.path(),
        &["run", "scan.laz", "--overwrite", "--threads", "1"],
    );
    assert_eq!(proposed(&with_one), proposed(&done));
}

#[test]
fn nothing_is_proposed_for_what_cannot_be_read() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let whole = fs::read(scans.join("pass-1.laz")).unwrap();
    let damaged = dir.path().join("damaged.laz");
    let mut bytes = whole.clone();
    bytes[20_000..whole.len() - 20_000].fill(0);
    fs::write(&damaged, bytes).unwrap();
    let newer = dir.path().join("newer.laz");
    let mut bytes = whole;
    bytes[25] = 5;
    fs::write(&newer, bytes).unwrap();
    for (scan, expected) in [
        ("missing.laz", "there is no such file"),
        ("damaged.laz", "damaged.laz: is damaged"),
        ("newer.laz", "is LAS 1.5; versions 1.0 to 1.4 are read"),
    ] {
        let done = in_directory(dir.path(), &["run", scan]);
        assert_eq!(done.status.code(), Some(1), "{scan}");
        assert!(said(&done).contains(expected), "{}", said(&done));
        assert!(!said(&done).contains("panicked"), "{}", said(&done));
    }
    assert!(!dir.path().join("damaged.even.copc.laz").exists());
}

#[test]
fn a_plan_lists_other_spacings_with_what_they_give() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let planned = |options: &[&str]| -> serde_json::Value {
        let done = lloydar(&[&["plan", text(&scans), "--json"], options].concat());
        assert!(done.status.success(), "{}", said(&done));
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let plan = planned(&["--spacing", "0.5"]);
    let listed = plan["spacings"].as_array().unwrap();
    assert!(listed.len() >= 3, "{listed:?}");
    for other in listed {
        let spacing = other["spacing"].as_f64().unwrap();
        assert!(spacing != 0.5);
        // What is listed for a spacing is near to what its own plan says.
        let of_its_own = planned(&["--spacing", &spacing.to_string()]);
        let [listed, planned] = [other, &of_its_own].map(|of| of["points_out"].as_f64().unwrap());
        assert!(
            (listed / planned - 1.0).abs() < 0.35,
            "{spacing}: {listed} {planned}"
        );
    }
    let plan = lloydar(&["plan", text(&scans)]);
    let text = String::from_utf8_lossy(&plan.stdout).into_owned();
    assert!(
        text.contains("other spacings") && text.contains("to one"),
        "{text}"
    );
}

#[test]
fn the_program_alone_prints_three_examples() {
    let done = lloydar(&[]);
    assert_eq!(done.status.code(), Some(2));
    assert_eq!(
        said(&done).matches("\n  lloydar ").count(),
        3,
        "{}",
        said(&done)
    );
}

#[test]
fn inputs_are_read_from_a_list_and_from_standard_input() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (whole, listed) = (dir.path().join("whole.laz"), dir.path().join("listed.laz"));
    succeed(&scans, &whole, &["--spacing", "0.5"]);
    let list = dir.path().join("list.txt");
    fs::write(
        &list,
        "# two passes\nscans/pass-1.laz\n\nscans/pass-[2-9].laz\n",
    )
    .unwrap();
    let options = ["-o", "listed.laz", "--spacing", "0.5", "-q"];
    let run = |list: &str| -> Vec<String> {
        let words = ["run", "--from-list", list].into_iter().chain(options);
        words.map(str::to_owned).collect()
    };
    let job = |list: &str| {
        let words = run(list);
        in_directory(
            dir.path(),
            &words.iter().map(String::as_str).collect::<Vec<_>>(),
        )
    };
    let done = job("list.txt");
    assert!(done.status.success(), "{}", said(&done));
    assert_eq!(fs::read(&whole).unwrap(), fs::read(&listed).unwrap());

    // With little memory the program starts itself anew, and still reads its standard input once.
    fs::remove_file(&listed).unwrap();
    let mut child = Command::new(PROGRAM)
        .current_dir(dir.path())
        .args(run("-"))
        .args(["--memory", "256MiB"])
        .env("SOURCE_DATE_EPOCH", "1700000000")
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(b"scans/*.laz\n").unwrap();
    drop(input);
    assert!(child.wait().unwrap().success());
    assert_eq!(points(&listed), points(&whole));

    let none = job("none.txt");
    assert_eq!(none.status.code(), Some(1));
    assert!(said(&none).contains("none.txt"), "{}", said(&none));
    assert_eq!(in_directory(dir.path(), &["run"]).status.code(), Some(2));
}

#[test]
fn a_street_that_is_there_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    let simulate = |more: &[&str]| {
        let words = [
            "simulate", "-o", "street", "--length", "20", "--points", "1K",
        ];
        in_directory(dir.path(), &[&words, more].concat())
    };
    let scan = dir.path().join("street/pass-1.laz");
    let seeds = ["--seed", "7", "--passes", "1", "--strays", "1%"];
    assert!(simulate(&[]).status.success());
    let before = fs::read(&scan).unwrap();
    let refused = simulate(&seeds);
    assert_eq!(refused.status.code(), Some(1));
    let answer = said(&refused);
    assert!(
        answer.contains("street/pass-1.laz: exists already") && answer.contains("--overwrite"),
        "{answer}"
    );
    assert!(fs::read(&scan).unwrap() == before);
    let replaced = simulate(&[&seeds[..], &["--overwrite"]].concat());
    assert!(replaced.status.success(), "{}", said(&replaced));
    assert!(fs::read(&scan).unwrap() != before);
    assert_eq!(simulate(&["--passes", "0"]).status.code(), Some(2));
}

#[test]
fn one_point_is_a_point() {
    let dir = tempfile::tempdir().unwrap();
    let words = [
        "simulate", "-o", "street", "--length", "20", "--points", "1", "--passes", "1",
    ];
    let done = in_directory(dir.path(), &words);
    let printed = String::from_utf8_lossy(&done.stdout).into_owned();
    assert_eq!(printed, "1 point: street/pass-1.laz\n");
    let words = ["run", "street", "-o", "even.laz", "--spacing", "1"];
    let done = in_directory(dir.path(), &words);
    let all = format!("{}{}", String::from_utf8_lossy(&done.stdout), said(&done));
    assert!(all.contains("about 1 point out of 1"), "{all}");
    assert!(
        !all.contains("1 points") && !all.contains("1 tiles"),
        "{all}"
    );
}

#[test]
fn a_scan_too_small_for_its_coordinates_is_refused_at_once_and_a_small_one_is_noted() {
    let dir = tempfile::tempdir().unwrap();
    let sheet = |name: &str, edge: f64| {
        let axes = "property double x\nproperty double y\nproperty double z";
        let mut text = format!("ply\nformat ascii 1.0\nelement vertex 900\n{axes}\nend_header\n");
        for i in 0..900 {
            let [x, y] = [i % 30, i / 30].map(|c| edge * f64::from(c) / 29.0);
            text += &format!("{x:e} {y:e} 0\n");
        }
        fs::write(dir.path().join(name), text).unwrap();
    };
    for edge in [1e-7, 1e-9, 1e-10, 1e-200] {
        sheet("tiny.ply", edge);
        for command in ["run", "plan"] {
            let refused = in_directory(dir.path(), &[command, "tiny.ply"]);
            let said = said(&refused);
            assert!(!refused.status.success(), "{edge:e}: {said}");
            assert!(
                said.contains("multiply its coordinates, by 1e"),
                "{edge:e}: {said}"
            );
            assert!(!said.contains("proposed"), "{edge:e}: {said}");
        }
    }
    for (edge, is_rounded) in [(1.1e-6, true), (1e-3, false)] {
        sheet("small.ply", edge);
        let done = in_directory(dir.path(), &["run", "small.ply", "--overwrite"]);
        let said = said(&done);
        assert!(done.status.success(), "{edge:e}: {said}");
        assert_eq!(
            said.contains("coordinates are rounded to 1e-9"),
            is_rounded,
            "{said}"
        );
    }
}

#[test]
fn thousands_of_files_fit_one_pattern() {
    let dir = tempfile::tempdir().unwrap();
    let options = ["--length", "20", "--points", "400", "--passes", "1"];
    let scans = simulated(dir.path(), &options);
    let scan = fs::read_dir(&scans).unwrap().find_map(|entry| {
        let path = entry.unwrap().path();
        path.extension().is_some_and(|e| e == "laz").then_some(path)
    });
    let scan = scan.unwrap();
    let many = dir.path().join("many");
    fs::create_dir(&many).unwrap();
    for number in 0..3000 {
        fs::hard_link(&scan, many.join(format!("tile-{number:04}.laz"))).unwrap();
    }
    let info = lloydar(&["info", text(&many.join("tile-*.laz")), "--json"]);
    assert_eq!(String::from_utf8_lossy(&info.stdout).lines().count(), 3000);
    let output = dir.path().join("out.laz");
    let pattern = many.join("tile-*.laz");
    succeed(&pattern, &output, &["--spacing", "1"]);
    let figures = report(&output);
    assert_eq!(figures["inputs"].as_array().unwrap().len(), 3000);
}

#[test]
fn two_clouds_are_compared_with_figures_and_a_picture() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (even, seeds) = (dir.path().join("even.laz"), dir.path().join("seeds.laz"));
    succeed(&scans, &even, &["--count", "6K"]);
    let options = ["--count", "6K", "--seeds", "poisson", "--iterations", "0"];
    succeed(&scans, &seeds, &options);
    let picture = dir.path().join("both.png");
    let compare = |more: &[&str]| {
        let words = ["compare", text(&even), text(&seeds), "-o", text(&picture)];
        let done = lloydar(&[&words, more].concat());
        assert!(done.status.success(), "{}", said(&done));
        String::from_utf8_lossy(&done.stdout).into_owned()
    };
    let compared: serde_json::Value =
        serde_json::from_str(&compare(&["--json", "--size", "200x100"])).unwrap();
    let of = |cloud: &str, figure: &str| compared[cloud]["uniformity"][figure].as_f64().unwrap();
    assert!(of("a", "cell_area_cv") < of("b", "cell_area_cv"));
    // The figures are those of `measure`.
    let measured = lloydar(&["measure", text(&even), "--json", "--against", text(&seeds)]);
    let measured: serde_json::Value = serde_json::from_slice(&measured.stdout).unwrap();
    assert_eq!(measured["uniformity"], compared["a"]["uniformity"]);
    assert_eq!(measured["accuracy"], compared["between"]["a_to_b"]);
    assert_eq!(measured["coverage"], compared["between"]["b_to_a"]);
    // As many points on the same surfaces have the same spacing on a lattice.
    let [a, b] = ["a", "b"].map(|of| compared[of]["lattice_spacing"].as_f64().unwrap());
    assert!((a / b - 1.0).abs() < 0.05, "{a} {b}");
    let file = fs::File::open(&picture).unwrap();
    let reader = png::Decoder::new(std::io::BufReader::new(file))
        .read_info()
        .unwrap();
    assert_eq!((reader.info().width, reader.info().height), (404, 204));

    let table = compare(&["--against", text(&scans)]);
    assert!(table.contains("scans to cloud, mean / spacing"), "{table}");
    assert!(!table.contains("to the nearest of the other"), "{table}");
}
