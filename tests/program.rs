//! The program as a user meets it: real files in, real files out, exit codes and
//! messages.

use std::{fs, path::Path};

use crate::running::{PROGRAM, lloydar, points, report, run, street, succeed, text};

#[test]
fn tiles_threads_and_memory_do_not_show() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let reference = dir.path().join("whole.laz");
    succeed(
        &scans,
        &reference,
        &[
            "--spacing",
            "0.3",
            "--accelerate",
            "none",
            "--tile-size",
            "1000",
        ],
    );
    let whole = points(&reference);
    assert!(whole.len() > 15_000, "{}", whole.len());
    for more in [
        &["--tile-size", "40", "--threads", "1"][..],
        &["--tile-size", "40", "--threads", "2"],
        &["--tile-size", "10", "--threads", "2"],
        &["--memory", "160MiB"],
    ] {
        let output = dir.path().join("tiled.laz");
        let mut arguments = vec!["--spacing", "0.3", "--accelerate", "none", "--overwrite"];
        arguments.extend(more);
        succeed(&scans, &output, &arguments);
        assert!(points(&output) == whole, "{more:?}");
        let report = report(&output);
        assert_eq!(
            report["seams"]["shared"], report["seams"]["identical"],
            "{more:?}"
        );
        assert_eq!(report["seams"]["duplicates"], 0);
        if more.contains(&"10") {
            let tiles = report["tiles"].as_array().unwrap().len();
            assert!(tiles > 8, "{tiles}");
            // So small tiles do their iterations in two rounds.
            let stages = report["stages"].as_array().unwrap();
            assert!(stages.iter().any(|stage| stage["stage"] == "start"));
            // All points are those of one tile: the ratio is that of what stands there, leaves or road. Without the
            // farthest hundredth, which stands alone somewhere, it is nearly one.
            for (figure, most) in [("delta", 1.2), ("delta_trimmed", 1.05)] {
                let of = |place: &str| report["seams"][place][figure].as_f64().unwrap();
                let (on_seams, elsewhere) = (of("on_seams"), of("elsewhere"));
                assert!(on_seams <= most * elsewhere, "{on_seams} {elsewhere}");
            }
        }
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (one, two) = (dir.path().join("one.laz"), dir.path().join("two.laz"));
    succeed(&scans, &one, &["--count", "5K", "--threads", "1"]);
    let [a, b] = ["pass-2.laz", "pass-1.laz"].map(|name| scans.join(name));
    let done = lloydar(&[
        "run",
        text(&a),
        text(&b),
        "-o",
        text(&two),
        "--count",
        "5K",
        "--threads",
        "2",
        "-q",
    ]);
    assert!(done.status.success());
    assert_eq!(fs::read(one).unwrap(), fs::read(&two).unwrap());
    let count = points(&two).len();
    assert!((4_900..5_100).contains(&count), "{count}");
}

#[test]
fn cells_are_more_even_than_the_seeds_and_points_lie_on_the_street() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("out.laz");
    let mut excess = [0.0; 2];
    // A few cells in the leaves decide much of a single run.
    for spacing in ["0.22", "0.28", "0.25"] {
        succeed(&scans, &output, &["--spacing", spacing, "--overwrite"]);
        let report = report(&output);
        let of = |what: &str, figure: &str| report[what][figure].as_f64().unwrap();
        for (excess, what) in excess.iter_mut().zip(["uniformity", "seeds"]) {
            *excess += of(what, "energy_ratio") - 1.0;
        }
        assert!(of("uniformity", "cell_area_cv") < 0.9 * of("seeds", "cell_area_cv"));
        assert!(of("coverage", "share_beyond") < 0.01);
    }
    assert!(excess[0] < 0.7 * excess[1], "{excess:?}");

    // Nearer to the true surfaces than the scanner's noise of a centimetre.
    let truth = ["measure", text(&output), "--json", "--truth", text(&scans)];
    let done = lloydar(&truth);
    assert!(done.status.success(), "{done:?}");
    let measured: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let mean = measured["truth"]["mean"].as_f64().unwrap();
    assert!(mean < 0.01, "{mean}");
    let html = fs::read_to_string(format!("{}.report.html", output.display())).unwrap();
    assert!(html.contains("seamless?") && !html.contains(">NaN"));
    // Nothing is fetched.
    assert!(
        html.split("src=\"")
            .skip(1)
            .all(|source| source.starts_with("data:"))
    );
}

#[test]
fn a_stopped_job_goes_on_and_ends_with_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (whole, resumed) = (dir.path().join("whole.laz"), dir.path().join("resumed.laz"));
    let options = ["--spacing", "0.25", "--tile-size", "20"];
    succeed(&scans, &whole, &options);
    let mut killed = 0;
    for milliseconds in [300, 700, 1200, 2000] {
        let mut child = std::process::Command::new(PROGRAM)
            .args(["run", text(&scans), "-o", text(&resumed), "--quiet"])
            .args(options)
            .env("SOURCE_DATE_EPOCH", "1700000000")
            .spawn()
            .unwrap();
        std::thread::sleep(std::time::Duration::from_millis(milliseconds));
        if child.try_wait().unwrap().is_none() {
            // SIGKILL: no chance to tidy up.
            child.kill().unwrap();
            killed += 1;
        }
        child.wait().unwrap();
        if resumed.exists() {
            break;
        }
    }
    assert!(killed > 0, "the job was over before it could be killed");
    if !resumed.exists() {
        succeed(&scans, &resumed, &options);
    }
    assert_eq!(fs::read(whole).unwrap(), fs::read(&resumed).unwrap());
    assert!(!dir.path().join("resumed.laz.job").exists());
}

#[test]
fn wrong_requests_are_answered_with_a_reason_and_a_code() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let empty_dir = dir.path().join("empty");
    fs::create_dir(&empty_dir).unwrap();
    let empty = dir.path().join("empty.laz");
    fs::write(&empty, "").unwrap();
    let whole = fs::read(scans.join("pass-1.laz")).unwrap();
    let cut = dir.path().join("cut.laz");
    fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let prose = dir.path().join("prose.laz");
    fs::write(&prose, "ply\nformat ascii 1.0\n").unwrap();
    let missing = dir.path().join("missing.laz");
    let output = dir.path().join("out.laz");
    let nowhere = dir.path().join("no/such/place/out.laz");

    let cases: &[(&Path, &Path, &[&str], i32, &str)] = &[
        (&missing, &output, &["--spacing", "1"], 1, "missing.laz"),
        (&empty, &output, &["--spacing", "1"], 1, "is empty"),
        (&cut, &output, &["--spacing", "1"], 1, "cut.laz"),
        (&prose, &output, &["--spacing", "1"], 1, "looks like PLY"),
        (
            &empty_dir,
            &output,
            &["--spacing", "1"],
            1,
            "no .las or .laz",
        ),
        (&scans, &output, &["--spacing", "0"], 2, "--spacing 0"),
        (&scans, &output, &["--spacing", "-1"], 2, "--spacing -1"),
        (&scans, &output, &["--spacing", "NaN"], 2, "--spacing NaN"),
        (&scans, &output, &["--spacing", "500"], 1, "too wide"),
        (&scans, &output, &["--count", "5M"], 1, "300000 points"),
        (
            &scans,
            &output,
            &["--count", "5", "--ratio", "2%"],
            2,
            "give one of",
        ),
        (
            &scans,
            &output,
            &["--spacing", "1", "--count", "5"],
            2,
            "give one of",
        ),
        (&scans, &nowhere, &["--spacing", "1"], 1, "no/such/place"),
        (
            &scans,
            &output,
            &["--spacing", "0.3", "--memory", "10MiB"],
            2,
            "give at least",
        ),
        (
            &scans,
            &dir.path().join("out.xyz"),
            &["--spacing", "1"],
            2,
            ".laz, .las, .ply or .pcd",
        ),
        (
            &scans,
            &output,
            &["--spacing", "1", "--mesh", "out.xyz"],
            2,
            "--mesh out.xyz: name the mesh .ply, .obj or .glb",
        ),
        (
            &scans,
            &dir.path().join("out.copc.laz"),
            &["--spacing", "1", "--order", "progressive"],
            2,
            "out.copc.laz: cannot have --order progressive",
        ),
    ];
    for (input, output, more, code, message) in cases {
        let done = run(input, output, more);
        let error = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(*code), "{more:?}: {error}");
        assert!(error.contains(message), "{message:?} is not in {error:?}");
        assert!(!error.contains("panicked"), "{error}");
        assert!(!output.exists());
    }
}

#[test]
fn a_filter_that_leaves_no_point_is_named_with_both_rectangles() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("out.laz");
    let error = |more: &[&str]| {
        let done = run(&scans, &output, more);
        assert_eq!(done.status.code(), Some(1), "{more:?}");
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    let beside = error(&["--spacing", "1", "--bounds", "0,1,10.5,10"]);
    assert!(
        beside.contains("--bounds leaves no point of the 300000"),
        "{beside}"
    );
    assert!(beside.contains("covers x 43"), "{beside}");
    assert!(
        beside.contains("x 0.000 to 10.500, y 1.000 to 10.000"),
        "{beside}"
    );
    let neither = error(&["--spacing", "1", "--keep-class", "99", "--drop-withheld"]);
    assert!(
        neither.contains("--keep-class and --drop-withheld leave no point"),
        "{neither}"
    );
}

#[test]
fn a_picture_shows_the_street() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let colors = |view: &str, by: &str| {
        let picture = dir.path().join(format!("{view}-{by}.png"));
        let size = ["--size", "320x200", "--view", view, "--by", by];
        let mut arguments = vec!["render", text(&scans), "-o", text(&picture)];
        arguments.extend(size);
        let done = lloydar(&arguments);
        assert!(done.status.success(), "{done:?}");
        let file = std::io::BufReader::new(fs::File::open(&picture).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (320, 200));
        let mut colors: Vec<[u8; 3]> = pixels.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        let paper = colors.iter().filter(|c| **c == [251, 251, 249]).count();
        colors.sort_unstable();
        colors.dedup();
        (1.0 - paper as f64 / 64_000.0, colors.len())
    };
    for view in ["top", "oblique", "street"] {
        let (covered, shades) = colors(view, "auto");
        assert!(covered > 0.05 && shades > 300, "{view}: {covered} {shades}");
    }
    assert!(colors("street", "auto").0 > 0.5);
    for by in ["height", "intensity", "class"] {
        assert!(colors("top", by).1 > 30, "{by}");
    }
    let refused = lloydar(&["render", text(&scans), "--size", "wide"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
}

#[test]
fn a_picture_is_refused_under_a_name_of_another_format() {
    let dir = tempfile::tempdir().unwrap();
    let picture = dir.path().join("street.jpg");
    // The cloud is not there: the name of the picture is refused before anything is read.
    let cloud = dir.path().join("missing.laz");
    let refused = lloydar(&["render", text(&cloud), "-o", text(&picture)]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(
        said.contains(".png") && said.contains("street.png") && !said.contains("missing"),
        "{said}"
    );
    assert!(!picture.exists());
}

#[test]
fn an_output_that_is_there_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("out.laz");
    fs::write(&output, "precious").unwrap();
    let done = run(&scans, &output, &["--spacing", "1"]);
    assert_eq!(done.status.code(), Some(1));
    assert_eq!(fs::read(&output).unwrap(), b"precious");
}

#[test]
fn a_damaged_file_among_good_ones_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let bad = scans.join("pass-2.laz");
    let mut bytes = fs::read(&bad).unwrap();
    // Damage in the middle of the points: only decoding can notice.
    let (from, to) = (bytes.len() / 4, bytes.len() * 3 / 4);
    for byte in &mut bytes[from..to] {
        *byte ^= 0xa5;
    }
    fs::write(&bad, bytes).unwrap();
    let output = dir.path().join("out.laz");
    let done = run(&scans, &output, &["--spacing", "0.5"]);
    let error = String::from_utf8_lossy(&done.stderr);
    if !done.status.success() {
        assert!(error.contains("pass-2.laz"), "{error}");
        assert!(!output.exists());
    }
    // Some damage passes the decoder: then it must show in the report.
    if done.status.success() {
        let damaged = report(&output)["notes"].to_string();
        assert!(
            damaged.contains("pass-2.laz") && damaged.contains("damaged"),
            "{damaged}"
        );
    }
}

#[test]
fn plan_measure_and_info_print_their_figures() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let plan = lloydar(&[
        "plan",
        text(&scans),
        "--spacing",
        "0.3",
        "-o",
        text(&dir.path().join("o.laz")),
    ]);
    let printed = String::from_utf8_lossy(&plan.stdout);
    for name in [
        "points in",
        "tiles",
        "halo",
        "peak memory",
        "temporary disk",
        "time",
    ] {
        assert!(printed.contains(name), "{name} is not in {printed}");
    }
    let output = dir.path().join("out.las");
    succeed(&scans, &output, &["--spacing", "0.3"]);
    let measured = lloydar(&["measure", text(&output), "--json"]);
    let figures: serde_json::Value = serde_json::from_slice(&measured.stdout).unwrap();
    let told = report(&output);
    let close = |name: &str, by: f64| {
        let (a, b) = (
            figures["uniformity"][name].as_f64().unwrap(),
            told["uniformity"][name].as_f64().unwrap(),
        );
        assert!(
            (a - b).abs() <= by * b,
            "{name}: {a} measured, {b} reported"
        );
    };
    close("delta", 0.01);
    close("mean", 0.001);
    close("energy_ratio", 0.05);
    let info = lloydar(&["info", text(&output)]);
    assert!(String::from_utf8_lossy(&info.stdout).contains("LAS 1.4, format 7"));
    let info = lloydar(&["info", text(&output), "--json"]);
    let info: serde_json::Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!(info["points"], told["points"]);
    assert_eq!(
        (&info["kind"], &info["metres_per_unit"]),
        (&"LAS".into(), &1.0.into())
    );
}

#[test]
fn a_ply_holds_every_point() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (ply, las) = (dir.path().join("out.ply"), dir.path().join("out.las"));
    succeed(&scans, &ply, &["--spacing", "0.5"]);
    succeed(&scans, &las, &["--spacing", "0.5"]);
    let bytes = fs::read(ply).unwrap();
    let end = bytes
        .windows(11)
        .position(|w| w == b"end_header\n")
        .unwrap()
        + 11;
    let header = String::from_utf8_lossy(&bytes[..end]);
    let count = points(&las).len();
    assert!(
        header.contains(&format!("element vertex {count} ")),
        "{header}"
    );
    // Three doubles, three shorts, a short, three bytes, two shorts, a double.
    assert_eq!(bytes.len() - end, count * (24 + 6 + 2 + 3 + 4 + 8));

    // Measured, the two are one cloud; and as near to the scans as was reported.
    let measure = |cloud: &Path| -> serde_json::Value {
        let done = lloydar(&["measure", text(cloud), "--json", "--against", text(&scans)]);
        assert!(done.status.success(), "{done:?}");
        serde_json::from_slice(&done.stdout).unwrap()
    };
    let (of_ply, of_las) = (measure(&dir.path().join("out.ply")), measure(&las));
    let report = fs::read_to_string(dir.path().join("out.las.report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(of_ply["points"], of_las["points"]);
    for (part, name, tolerance) in [
        ("uniformity", "delta", 1e-3),
        ("uniformity", "energy_ratio", 1e-3),
        ("accuracy", "mean", 1e-3),
        ("accuracy", "max", 1e-3),
        ("coverage", "mean", 1e-3),
    ] {
        let [ply, las] = [&of_ply, &of_las].map(|of| of[part][name].as_f64().unwrap());
        assert!((ply - las).abs() <= tolerance * las, "{name}: {ply} {las}");
    }
    for name in ["mean", "max"] {
        let [measured, reported] =
            [&of_las, &report].map(|of| of["accuracy"][name].as_f64().unwrap());
        // A job knows the points that thinning keeps: the nearest may be a little nearer.
        let farther = reported - measured;
        assert!(
            (-0.01 * measured..0.1).contains(&farther),
            "accuracy {name}: {measured} measured, {reported} reported"
        );
    }
}
