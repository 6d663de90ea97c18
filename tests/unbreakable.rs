//! What becomes of a job when things go wrong: bad files, odd clouds, signals, other
//! jobs' directories.

#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "what was skipped, and how much was tried"
)]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use crate::running::{
    PROGRAM, lloydar, points, report, run, simulated, start, street, succeed, text,
};
use las::{Builder, PointDataBuilder, Transform, Vector, Writer, point::Format};

fn stderr(done: &std::process::Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned()
}

/// A LAZ file of points on a scale of a millimetre.
fn cloud(path: &Path, places: impl Iterator<Item = [i32; 3]>) {
    let mut builder = Builder::from((1, 2));
    let format = Format::new(0).unwrap();
    builder.point_format = format;
    let transform = Transform {
        scale: 0.001,
        offset: 0.0,
    };
    let transforms = Vector {
        x: transform,
        y: transform,
        z: transform,
    };
    builder.transforms = transforms;
    let records: Vec<u8> = places
        .flat_map(|place| {
            let mut record = [0; 20];
            for (axis, c) in place.into_iter().enumerate() {
                record[4 * axis..4 * axis + 4].copy_from_slice(&c.to_le_bytes());
            }
            record
        })
        .collect();
    let batch = PointDataBuilder::new()
        .with_format(format)
        .with_transforms(transforms)
        .build_from_bytes(records)
        .unwrap();
    let mut writer = Writer::from_path(path, builder.into_header().unwrap()).unwrap();
    writer.write_points(&batch).unwrap();
    writer.close().unwrap();
}

/// Numbers that look like chance, the same every time.
struct Chance(u64);

impl Chance {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % limit
    }
}

#[test]
fn bad_files_stop_a_job_by_name_or_are_left_out_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (clean, skipped) = (dir.path().join("clean.laz"), dir.path().join("skipped.laz"));
    succeed(&scans, &clean, &["--spacing", "0.5"]);

    let whole = fs::read(scans.join("pass-1.laz")).unwrap();
    fs::write(scans.join("cut.laz"), &whole[..whole.len() / 3]).unwrap();
    fs::write(scans.join("ply.laz"), "ply\nformat ascii 1.0\n").unwrap();
    // Damage that only shows as points are decoded.
    let mut damaged = whole.clone();
    damaged[whole.len() / 2..whole.len() / 2 + 2000].fill(0xff);
    fs::write(scans.join("damaged.laz"), damaged).unwrap();

    let stopped = run(&scans, &skipped, &["--spacing", "0.5"]);
    assert_eq!(stopped.status.code(), Some(1));
    for name in ["cut.laz", "ply.laz", "--on-bad-file skip"] {
        assert!(stderr(&stopped).contains(name), "{}", stderr(&stopped));
    }
    assert!(!skipped.exists());

    let skip = ["--spacing", "0.5", "--on-bad-file", "skip"];
    let done = run(&scans, &skipped, &skip);
    assert_eq!(done.status.code(), Some(3), "{}", stderr(&done));
    assert!(points(&skipped) == points(&clean));
    let inputs = report(&skipped)["inputs"].clone();
    let verdict = |name: &str| {
        let inputs = inputs.as_array().unwrap();
        let of = inputs
            .iter()
            .find(|i| i["path"].as_str().unwrap().ends_with(name));
        of.unwrap()["left_out"].clone()
    };
    for name in ["cut.laz", "ply.laz", "damaged.laz"] {
        assert!(verdict(name).is_string(), "{name}: {}", verdict(name));
    }
    assert!(verdict("pass-1.laz").is_null());
    let page = fs::read_to_string(dir.path().join("skipped.laz.report.html")).unwrap();
    assert_eq!(page.matches("left out: is ").count(), 3);
    assert!(page.contains("points read, 3 of the files left out; "));

    // Nothing but bad files is no job.
    let output = dir.path().join("none.laz");
    let done = run(&scans.join("cut.laz"), &output, &skip);
    assert_eq!(done.status.code(), Some(1));
    assert!(stderr(&done).contains("cut.laz"), "{}", stderr(&done));
}

#[test]
fn a_header_that_states_too_few_points_is_noted() {
    let dir = tempfile::tempdir().unwrap();
    let (las, laz) = (dir.path().join("in.las"), dir.path().join("in.laz"));
    let sheet = |n: i32| [n % 400 * 50, n / 400 * 50, 0];
    for path in [&las, &laz] {
        cloud(path, (0..150_000).map(sheet));
    }
    let layered = street(dir.path()).join("pass-1.laz");
    let output = dir.path().join("out.laz");
    // The number of points in the header: four bytes, or, of LAS 1.4, eight elsewhere.
    for (path, at, points) in [
        (&las, 107, 150_000_u32),
        (&laz, 107, 150_000),
        (&layered, 247, 150_000),
    ] {
        let mut bytes = fs::read(path).unwrap();
        assert_eq!(bytes[at..at + 4], points.to_le_bytes());
        let run_with_notes = || {
            succeed(path, &output, &["--spacing", "0.8", "--overwrite"]);
            let report = report(&output);
            (
                report["inputs"][0]["read"].clone(),
                report["notes"].to_string(),
            )
        };
        let (read, notes) = run_with_notes();
        assert_eq!(read, points);
        assert!(!notes.contains("has room for"), "{notes}");
        bytes[at..at + 4].copy_from_slice(&60_000_u32.to_le_bytes());
        fs::write(path, bytes).unwrap();
        let (read, notes) = run_with_notes();
        assert_eq!(read, 60_000);
        let expected = "has room for 150000 points, and its header states 60000;";
        assert!(notes.contains(expected), "{notes}");
    }
}

#[test]
fn an_input_is_never_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let replace = ["--spacing", "0.5", "--overwrite"];
    let scan = scans.join("pass-1.laz");
    let whole = fs::read(&scan).unwrap();
    // By another path, and by the directory in which an earlier output lies.
    let detour = scans.join("..").join(scans.file_name().unwrap());
    let (within, between) = (detour.join("pass-1.laz"), scans.join("even.laz"));
    succeed(&scans, &between, &["--spacing", "0.5"]);
    for (input, output) in [(&scan, &within), (&scans, &between)] {
        let before = fs::read(output).unwrap();
        let done = run(input, output, &replace);
        assert_eq!(done.status.code(), Some(1));
        let answer = stderr(&done);
        assert!(
            answer.contains("is an input and would be replaced"),
            "{answer}"
        );
        assert!(fs::read(output).unwrap() == before);
    }
    assert!(fs::read(&scan).unwrap() == whole);
}

#[test]
fn what_is_no_scan_is_answered() {
    let dir = tempfile::tempdir().unwrap();
    let socket = dir.path().join("socket.laz");
    let _listening = std::os::unix::net::UnixListener::bind(&socket).unwrap();
    let folder = dir.path().join("folder.laz");
    fs::create_dir(&folder).unwrap();
    let output = dir.path().join("out.laz");
    for (input, answer) in [
        (&socket, "neither a file nor a directory"),
        (&folder, "no .las or .laz"),
    ] {
        let done = run(input, &output, &["--spacing", "1"]);
        assert_eq!(done.status.code(), Some(1));
        assert!(stderr(&done).contains(answer), "{}", stderr(&done));
    }
}

#[test]
fn scans_of_a_few_places_are_answered() {
    let dir = tempfile::tempdir().unwrap();
    let (one, four) = (dir.path().join("one.laz"), dir.path().join("four.laz"));
    cloud(&one, [[1, 2, 3]].into_iter());
    let corners = [[0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 0]];
    cloud(&four, corners.into_iter());
    let output = dir.path().join("even.laz");
    // Nothing is as wide as that on a scale of a millimetre.
    let done = run(&one, &output, &["--spacing", "1e18"]);
    assert_eq!(done.status.code(), Some(1), "{}", stderr(&done));
    assert!(stderr(&done).contains("give less"), "{}", stderr(&done));
    // Four points two steps of the scale apart are too near for a spacing between them.
    for target in [["--ratio", "0.5"], ["--count", "2"]] {
        let done = run(&four, &output, &target);
        let message = stderr(&done);
        assert!(matches!(done.status.code(), Some(0 | 1)), "{message}");
        assert!(!message.contains("panic"), "{message}");
    }
}

#[test]
fn names_that_are_no_text_are_names() {
    use std::os::unix::ffi::OsStrExt;
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let odd = dir
        .path()
        .join(std::ffi::OsStr::from_bytes(b"Donn\xe9es \xe6\xb5\x8b"));
    fs::create_dir(&odd).unwrap();
    fs::rename(scans.join("pass-1.laz"), odd.join("pass.laz")).unwrap();
    let output = odd.join("out.laz");
    let done = Command::new(PROGRAM)
        .arg("run")
        .arg(odd.join("pass.laz"))
        .arg("-o")
        .arg(&output)
        .args(["--spacing", "0.5", "--quiet"])
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", stderr(&done));
    assert!(points(&output).len() > 1000);
}

#[test]
fn a_file_that_changes_under_the_job_is_noticed() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("out.laz");
    let growing = scans.join("pass-2.laz");
    // For as long as the job lasts.
    let mut job = start(&["run", text(&scans), "-o", text(&output), "--spacing", "0.3"]);
    while job.try_wait().unwrap().is_none() {
        let file = fs::File::options().append(true).open(&growing).unwrap();
        file.set_modified(std::time::SystemTime::now()).unwrap();
        std::thread::sleep(Duration::from_millis(5));
    }
    let done = job.wait_with_output().unwrap();
    assert_eq!(done.status.code(), Some(1));
    let error = stderr(&done);
    assert!(error.contains("pass-2.laz has changed"), "{error}");
    assert!(!output.exists());
}

#[test]
fn a_signal_stops_within_a_second_and_the_job_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let (whole, stopped) = (dir.path().join("whole.laz"), dir.path().join("stopped.laz"));
    // One large tile: nothing to wait for.
    let options = ["--spacing", "0.15", "--iterations", "40"];
    let command = ["run", text(&scans), "-o", text(&stopped), "-q"];
    let mut stops = 0;
    for milliseconds in [400, 1500, 2500] {
        let mut job = start(&[&command[..], &options[..]].concat());
        std::thread::sleep(Duration::from_millis(milliseconds));
        if job.try_wait().unwrap().is_some() {
            break;
        }
        let told = Instant::now();
        let id = job.id().to_string();
        assert!(
            Command::new("kill")
                .args(["-TERM", &id])
                .status()
                .unwrap()
                .success()
        );
        let status = job.wait().unwrap();
        // A second is promised; machines that run tests are busy.
        assert!(
            told.elapsed() < Duration::from_secs(2),
            "{:?}",
            told.elapsed()
        );
        assert_eq!(status.code(), Some(130));
        assert!(!stopped.exists());
        stops += 1;
    }
    assert!(stops > 0);
    succeed(&scans, &stopped, &options);
    succeed(&scans, &whole, &options);
    assert_eq!(fs::read(whole).unwrap(), fs::read(stopped).unwrap());
}

#[test]
fn a_full_disk_is_an_error_while_the_next_tile_waits_for_room() {
    let dir = tempfile::tempdir().unwrap();
    let scans = simulated(dir.path(), &["--points", "250K", "--passes", "1"]);
    // A limit of the shell stands for a full disk: a solved tile takes more than 20 000 bytes. The memory has room for one
    // tile at a time.
    let limited = r#"trap "" XFSZ; ulimit -f 40; exec "$0" run "$1" -o "$2" -q --spacing 0.12 --iterations 1 --memory 96MiB"#;
    let output = dir.path().join("even.laz");
    let mut job = Command::new("sh")
        .args(["-c", limited, PROGRAM, text(&scans), text(&output)])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while job.try_wait().unwrap().is_none() && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(50));
    }
    job.kill().ok();
    let done = job.wait_with_output().unwrap();
    assert_eq!(done.status.code(), Some(1), "{}", stderr(&done));
    assert!(stderr(&done).contains("tiles.solved"), "{}", stderr(&done));
}

#[test]
fn a_job_directory_is_one_jobs() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let output = dir.path().join("out.laz");
    let job = dir.path().join("job");
    let arguments = |spacing: &'static str| {
        let job = text(&job);
        [
            "run",
            text(&scans),
            "-o",
            text(&output),
            "-q",
            "--job",
            job,
            "--spacing",
            spacing,
        ]
        .map(str::to_owned)
    };
    let start = |spacing| start(&arguments(spacing).each_ref().map(String::as_str));
    // The first works for longer than the second waits for it.
    let mut first = start("0.03");
    let begun = Instant::now();
    while !job.join("job.json").exists() {
        assert!(begun.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(5));
    }
    let second = start("0.03").wait_with_output().unwrap();
    assert_eq!(second.status.code(), Some(1));
    assert!(
        stderr(&second).contains("another process"),
        "{}",
        stderr(&second)
    );
    first.kill().unwrap();
    first.wait().unwrap();

    let other = start("0.4").wait_with_output().unwrap();
    assert_eq!(other.status.code(), Some(1));
    assert!(stderr(&other).contains("--restart"), "{}", stderr(&other));
    let mut anew = arguments("0.4").to_vec();
    anew.push("--restart".to_owned());
    let done = lloydar(&anew.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(done.status.success(), "{}", stderr(&done));

    // Done already, and stopped before it had tidied up: the same command says so.
    fs::remove_file(&output).unwrap();
    succeed(
        &scans,
        &output,
        &["--spacing", "0.4", "--job", text(&job), "--keep-job"],
    );
    let before = fs::read(&output).unwrap();
    succeed(&scans, &output, &["--spacing", "0.4", "--job", text(&job)]);
    assert_eq!(fs::read(&output).unwrap(), before);
    assert!(!job.exists());
    // And once there is no job any more, the output is simply there.
    let late = run(&scans, &output, &["--spacing", "0.4"]);
    assert!(
        stderr(&late).contains("exists already"),
        "{}",
        stderr(&late)
    );
    assert!(!dir.path().join("out.laz.job").exists());

    fs::create_dir(&job).unwrap();
    fs::write(job.join("tile-photo.jpg"), "precious").unwrap();
    let foreign = run(
        &scans,
        &output,
        &["--spacing", "0.4", "--job", text(&job), "--overwrite"],
    );
    assert_eq!(foreign.status.code(), Some(1));
    assert_eq!(fs::read(job.join("tile-photo.jpg")).unwrap(), b"precious");
}

/// A cloud by its name, the points that it gives at the least, and options for it.
type OddCloud = (&'static str, Vec<[i32; 3]>, u64, &'static [&'static str]);

#[test]
fn odd_clouds_are_done() {
    let dir = tempfile::tempdir().unwrap();
    let n = 150_000;
    let mut chance = Chance(7);
    let mut flat = |edge: usize| {
        let mut c = || chance.below(edge) as i32;
        [c(), c(), c() / 100]
    };
    let sheet: Vec<[i32; 3]> = (0..n).map(|_| flat(20_000)).collect();
    let far = |place: [i32; 3]| [2_000_000_000 + place[0], place[1] - 2_000_000_000, place[2]];
    let stray = [-1_900_000_000, 1_900_000_000].map(|far| [far, -far, 0]);
    let clouds: [OddCloud; 6] = [
        ("equal", vec![[5, 6, 7]; n], 1, &[]),
        (
            "line",
            // 367 long: 918 spacings.
            (0..n as i32).map(|i| [i, 2 * i, -i]).collect(),
            860,
            &[],
        ),
        (
            "grid",
            (0..n as i32)
                .map(|i| [i % 400 * 50, i / 400 * 50, 0])
                .collect(),
            1000,
            &[],
        ),
        ("far", sheet.iter().copied().map(far).collect(), 2000, &[]),
        (
            "stray",
            sheet.iter().copied().chain(stray).collect(),
            2000,
            &[],
        ),
        // A scanner that stood still: four hundred points to a millimetre.
        (
            "crowd",
            (0..8 * n)
                .map(|_| flat(60))
                .chain(sheet.iter().copied())
                .collect(),
            2000,
            &["--memory", "110MiB"],
        ),
    ];
    for (name, places, least, more) in clouds {
        let (input, output) = (
            dir.path().join("in.laz"),
            dir.path().join(format!("{name}.laz")),
        );
        let count = places.len();
        cloud(&input, places.into_iter());
        let options = [&["--spacing", "0.4"][..], more].concat();
        succeed(&input, &output, &options);
        let report = report(&output);
        assert_eq!(report["inputs"][0]["read"], count, "{name}");
        let notes = report["notes"].to_string();
        let is_rounded = notes.contains("coordinates are rounded to");
        assert_eq!(is_rounded, name == "stray", "{name}: {notes}");
        assert!(
            report["points"].as_u64().unwrap() >= least,
            "{name}: {}",
            report["points"]
        );
        let (peak, budget) = (&report["memory_peak"], &report["memory_budget"]);
        assert!(
            peak.as_u64() <= budget.as_u64(),
            "{name}: {peak} of {budget}"
        );
    }
}

/// Where a cloud has more points than can be used, the same ones are used whatever the
/// tiles and the memory.
#[test]
fn crowds_are_thinned_alike_in_every_tile() {
    let dir = tempfile::tempdir().unwrap();
    let input = dir.path().join("in.laz");
    let mut chance = Chance(11);
    let mut wavy = |edge: usize| {
        let (x, y) = (chance.below(edge) as i32, chance.below(edge) as i32);
        let height = 100.0 * (f64::from(x) / 700.0).sin();
        [x, y, height as i32 + chance.below(8) as i32]
    };
    let places: Vec<[i32; 3]> = (0..1_000_000).map(|i| wavy(3000 + i % 2 * 3000)).collect();
    cloud(&input, places.into_iter());
    let mut all = Vec::new();
    for options in [
        &["--tile-size", "1000"][..],
        &["--tile-size", "1.5"],
        &["--memory", "100MiB", "--threads", "1"],
    ] {
        let output = dir.path().join("out.laz");
        let options = [options, &["--spacing", "0.2", "--overwrite"]].concat();
        succeed(&input, &output, &options);
        all.push(points(&output));
    }
    assert!(all[0].len() > 900, "{}", all[0].len());
    assert!(all.iter().all(|points| *points == all[0]));
}

/// Mutates scans, and looks at how each is answered. `LLOYDAR_MUTATIONS` says how many,
/// `LLOYDAR_SCANS` names a directory of more scans to start from.
#[test]
fn mutated_scans_are_answered() {
    let tries: usize = std::env::var("LLOYDAR_MUTATIONS").map_or(60, |n| n.parse().unwrap());
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let mut files: Vec<PathBuf> = vec![scans.join("pass-1.laz")];
    for name in ["whole.las", "whole.copc.laz", "whole.ply"] {
        let whole = dir.path().join(name);
        succeed(&scans, &whole, &["--spacing", "0.6"]);
        files.push(whole);
    }
    match std::env::var_os("LLOYDAR_SCANS") {
        Some(folder) => files.extend(small_scans(Path::new(&folder))),
        None => eprintln!("SKIPPED: real scans to mutate, for want of a folder (LLOYDAR_SCANS)"),
    }
    let mut chance = Chance(2026);
    let (mut done, mut refused) = (0, 0);
    for number in 0..tries {
        let source = &files[chance.below(files.len())];
        let ending = source.extension().unwrap().to_str().unwrap();
        let mut bytes = fs::read(source).unwrap();
        let what = mutate(&mut bytes, &mut chance);
        let input = dir.path().join(format!("mutated.{ending}"));
        fs::write(&input, &bytes).unwrap();
        let told = || format!("{number}: {} with {what}", source.display());
        match answer(&input, &dir.path().join("out.laz")) {
            Ok(true) => done += 1,
            Ok(false) => refused += 1,
            Err(problem) => {
                let kept = std::env::temp_dir().join(format!("lloydar-mutated-{number}.{ending}"));
                fs::copy(&input, &kept).unwrap();
                panic!("{}: {problem}; kept as {}", told(), kept.display());
            }
        }
    }
    println!("{tries} mutations: {done} done, {refused} refused");
    assert!(done > 0 && refused > 0, "{done} done, {refused} refused");
}

fn small_scans(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        let is_scan = path.extension().is_some_and(|e| e == "las" || e == "laz");
        if path.is_dir() {
            found.extend(small_scans(&path));
        } else if is_scan && entry.metadata().unwrap().len() < 3_000_000 {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Damages `bytes` and says how.
fn mutate(bytes: &mut Vec<u8>, chance: &mut Chance) -> String {
    // Headers say most, and are read first; so are the records that follow them.
    let reach = [120, 400, 3000, usize::MAX][chance.below(4)].min(bytes.len());
    let at = chance.below(reach);
    let longest = [1, 4, 8, 64, 4096][chance.below(5)];
    let length = (1 + chance.below(longest)).min(bytes.len() - at);
    let place = format!("bytes {at} to {}", at + length);
    let range = at..at + length;
    match chance.below(7) {
        0 => bytes[range].fill(0),
        1 => bytes[range].fill(0xff),
        2 => bytes[range].fill(0x7f),
        3 => bytes[at] ^= 1 << chance.below(8),
        4 => bytes[range]
            .iter_mut()
            .for_each(|b| *b = chance.below(256) as u8),
        5 => {
            bytes.truncate(at);
            return format!("all from byte {at} cut off");
        }
        _ => {
            let copied: Vec<u8> = bytes[range].to_vec();
            let to = chance.below(bytes.len());
            bytes.splice(to..to, copied);
            return format!("{place} again at {to}");
        }
    }
    format!("{place} changed")
}

/// Runs a job on `input` with little memory to be had and ten seconds: whether it was
/// done, or refused by name; the error is what is wrong with the answer.
fn answer(input: &Path, output: &Path) -> Result<bool, String> {
    let options = "--count 500 --memory 256MiB --threads 2 --overwrite --quiet";
    let (input, output) = (text(input), text(output));
    // Kibibytes of address space: threads reserve much and touch little.
    let line = format!("ulimit -v 1500000; exec {PROGRAM} run {input} -o {output} {options}");
    let mut job = Command::new("sh")
        .args(["-c", &line])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while job.try_wait().unwrap().is_none() {
        if begun.elapsed() > Duration::from_secs(10) {
            job.kill().unwrap();
            return Err("no answer in ten seconds".into());
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    let done = job.wait_with_output().unwrap();
    let error = stderr(&done);
    match done.status.code() {
        _ if error.contains("panicked") => Err(error),
        Some(0 | 3) => Ok(true),
        Some(1) if error.contains("mutated") || error.contains("--count") => Ok(false),
        code => Err(format!("exit code {code:?}: {error}")),
    }
}
