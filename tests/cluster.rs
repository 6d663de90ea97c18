//! One job by many processes: its stages as commands, and the way they are given to Slurm.

use std::{
    collections::BTreeMap,
    ffi::OsString,
    fs,
    io::Read,
    os::unix::fs::PermissionsExt,
    path::{Path, PathBuf},
    process::{Child, Command, Output},
    time::{Duration, Instant},
};

use crate::running::{PROGRAM, lloydar, start, street, succeed, text};

const OPTIONS: [&str; 6] = ["--spacing", "0.4", "--tile-size", "15", "--iterations", "8"];

fn said(done: &Output) -> String {
    String::from_utf8_lossy(&done.stderr).into_owned() + &String::from_utf8_lossy(&done.stdout)
}

fn well(arguments: &[&str]) -> String {
    let done = lloydar(arguments);
    assert!(done.status.success(), "{arguments:?}: {}", said(&done));
    said(&done)
}

/// A scattered job that would write `many.copc.laz`, its directory, and what must come out.
fn scattered(dir: &Path) -> (PathBuf, PathBuf, Vec<u8>) {
    let scans = street(dir);
    let (one, many) = (dir.join("one.copc.laz"), dir.join("many.copc.laz"));
    succeed(&scans, &one, &OPTIONS);
    let mut scatter = vec!["scatter", text(&scans), "-o", text(&many), "--quiet"];
    scatter.extend(OPTIONS);
    well(&scatter);
    // Once more: it is known again.
    assert!(well(&scatter).contains("ready to be solved"));
    let job = dir.join("many.copc.laz.job");
    (many, job, fs::read(one).unwrap())
}

fn solved(job: &Path) -> [u64; 2] {
    let status = well(&["status", text(job), "--json"]);
    let status: serde_json::Value = serde_json::from_str(&status).unwrap();
    ["solved", "tiles"].map(|name| status[name].as_u64().unwrap())
}

#[test]
fn whoever_dies_the_cloud_is_that_of_one_process() {
    let dir = tempfile::tempdir().unwrap();
    let (many, job, expected) = scattered(dir.path());
    let shards = ["0/3", "1/3", "2/3"];
    let begun = Instant::now();
    let mut workers: Vec<Child> = shards
        .iter()
        .map(|shard| {
            start(&[
                "solve",
                text(&job),
                "--shard",
                shard,
                "--threads",
                "1",
                "--patience",
                "15",
            ])
        })
        .collect();
    while solved(&job)[0] == 0 {
        std::thread::sleep(Duration::from_millis(20));
    }
    workers[1].kill().unwrap();
    workers[1].wait().unwrap();
    // Heartbeats are five seconds apart: before that nobody can have seen it live.
    let can_seem_alive = begun.elapsed() >= Duration::from_secs(5);
    for worker in [0, 2] {
        let ended = workers[worker].wait().unwrap();
        assert!(ended.success(), "{ended}");
    }
    // Others take the tile of the dead, but on a slow machine it seemed alive, and they do not wait for the living.
    let [by_workers, tiles] = solved(&job);
    let is_solved = by_workers == tiles || can_seem_alive && by_workers + 1 == tiles;
    assert!(is_solved && tiles >= 8, "{by_workers} of {tiles}");
    // Whoever comes next does what is left, and nothing if nothing is.
    well(&["solve", text(&job), "--patience", "15", "--quiet"]);
    assert_eq!(solved(&job), [tiles; 2]);
    well(&["stitch", text(&job), "--quiet"]);
    assert!(fs::read(&many).unwrap() == expected, "not the same bytes");
    assert!(!job.exists());
    let done = lloydar(&["stitch", text(&job)]);
    assert!(said(&done).contains("lloydar scatter"), "{}", said(&done));
}

#[test]
fn a_stitch_is_shared_and_one_of_those_who_stitch_dies() {
    let dir = tempfile::tempdir().unwrap();
    let (many, job, expected) = scattered(dir.path());
    well(&["solve", text(&job), "--quiet"]);
    let stitch = |more: &[&'static str]| {
        let begin = ["stitch", text(&job), "--threads", "1", "--patience", "15"];
        start(&[&begin[..], more].concat())
    };
    let pieces = || {
        let names = fs::read_dir(&job).unwrap().flatten();
        let mut names = names.map(|entry| entry.file_name().into_string().unwrap());
        names.any(|name| name.starts_with("settled-") && name.ends_with(".pieces"))
    };
    let mut dies = stitch(&["--shard", "0/2"]);
    while !pieces() {
        std::thread::sleep(Duration::from_millis(1));
    }
    dies.kill().unwrap();
    dies.wait().unwrap();
    // Another one has claimed a part of the sorting, and has died long ago.
    fs::write(job.join("sorted-0-0.bin"), "not all of it").unwrap();
    let status = well(&["status", text(&job)]);
    let [settled, sorted] = ["settled", "sorted"].map(|work| {
        let mut lines = status.lines().skip_while(|line| !line.ends_with(work));
        [lines.next(), lines.next()].map(|line| line.unwrap_or_default().to_owned())
    });
    assert!(settled[0].starts_with("stitch: "), "{status}");
    assert!(sorted[0].starts_with("stitch: 0 of "), "{status}");
    assert!(sorted[1].contains("group [0]: attempt 1"), "{status}");
    let mut helps = stitch(&["--shard", "1/2"]);
    let mut completes = stitch(&[]);
    for process in [&mut completes, &mut helps] {
        let ended = process.wait().unwrap();
        assert!(ended.success(), "{ended}");
    }
    assert!(fs::read(&many).unwrap() == expected, "not the same bytes");
    assert!(!job.exists());
}

/// The files of a directory by their names.
fn files(dir: &Path) -> BTreeMap<OsString, Vec<u8>> {
    let entries = fs::read_dir(dir).unwrap().map(Result::unwrap);
    entries
        .map(|entry| (entry.file_name(), fs::read(entry.path()).unwrap()))
        .collect()
}

#[test]
fn tiles_by_many_are_those_of_one_process() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let [one, many] = ["one", "many"].map(|name| {
        let place = dir.path().join(name);
        fs::create_dir(&place).unwrap();
        place.join("tiles")
    });
    let options = [&OPTIONS[..], &["--output-tiles", "20"]].concat();
    succeed(&scans, &one, &options);
    let scatter = ["scatter", text(&scans), "-o", text(&many), "--quiet"];
    well(&[&scatter[..], &options].concat());
    let job = dir.path().join("many/tiles.job");
    let stitch = ["stitch", text(&job), "--threads", "1"];
    let helps = ["0/2", "1/2"].map(|shard| start(&[&stitch[..], &["--shard", shard]].concat()));
    for mut process in helps {
        assert!(process.wait().unwrap().success());
    }
    let written = fs::read_dir(job.join("written")).unwrap().count();
    assert!(written >= 1, "{written}");
    well(&[&stitch[..], &["--quiet"]].concat());
    assert!(files(&one).len() > 6);
    assert!(files(&one) == files(&many), "not the same tiles");
    assert!(!job.exists());
}

#[test]
fn a_mesh_by_many_is_that_of_one_process() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let path = |name: &str| dir.path().join(name);
    let (one, many) = (path("one-mesh"), path("many-mesh"));
    let tiles = ["--output-tiles", "20", "--mesh"];
    succeed(
        &scans,
        &path("one"),
        &[&OPTIONS[..], &tiles, &[text(&one)]].concat(),
    );
    let output = path("many");
    let scatter = ["scatter", text(&scans), "-o", text(&output), "--quiet"];
    well(&[&scatter[..], &OPTIONS, &tiles, &[text(&many)]].concat());
    let job = path("many.job");
    let mut beside = start(&["solve", text(&job), "--threads", "1"]);
    well(&["solve", text(&job), "--threads", "1", "--quiet"]);
    assert!(beside.wait().unwrap().success());
    well(&["stitch", text(&job), "--quiet"]);
    assert!(files(&one).len() > 6);
    assert!(files(&one) == files(&many), "not the same mesh");
}

#[test]
fn one_process_goes_on_where_many_were_and_stitch_solves_what_is_left() {
    let dir = tempfile::tempdir().unwrap();
    let (many, job, expected) = scattered(dir.path());
    let mut worker = start(&["solve", text(&job), "--threads", "1"]);
    while solved(&job)[0] < 2 {
        std::thread::sleep(Duration::from_millis(20));
    }
    let told = Command::new("kill")
        .arg(worker.id().to_string())
        .status()
        .unwrap();
    assert!(told.success());
    assert_eq!(worker.wait().unwrap().code(), Some(130));
    let names = || {
        fs::read_dir(&job)
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
    };
    let of_kind = |ending: &str| {
        names()
            .filter(|n| text(Path::new(n)).ends_with(ending))
            .count()
    };
    // It leaves what it was at, and what it has solved is not solved again: nobody waits
    // for it, here not the last stage.
    assert!(of_kind(".complete") >= 1);
    assert_eq!(of_kind(".left"), 1);
    assert!(solved(&job)[0] >= 2);
    well(&["stitch", text(&job), "--quiet", "--patience", "300"]);
    assert!(fs::read(&many).unwrap() == expected, "not the same bytes");
}

#[test]
fn a_stitch_of_changed_inputs_names_the_commands_that_begin_anew() {
    let dir = tempfile::tempdir().unwrap();
    let (_, job, _) = scattered(dir.path());
    let scan = fs::File::options()
        .append(true)
        .open(dir.path().join("scans/pass-1.laz"))
        .unwrap();
    scan.set_modified(std::time::UNIX_EPOCH).unwrap();
    let done = lloydar(&["stitch", text(&job), "--quiet"]);
    assert_eq!(done.status.code(), Some(1), "{}", said(&done));
    let said = said(&done);
    let expected = "pass-1.laz has changed since the job began; `lloydar run` or `lloydar scatter` begins anew";
    assert!(said.contains(expected), "{said}");
}

#[test]
fn tiles_that_kill_who_solves_them_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let (_, job, _) = scattered(dir.path());
    fs::write(job.join("tiles-0-0.solved"), "").unwrap();
    let done = lloydar(&[
        "solve",
        text(&job),
        "--quiet",
        "--patience",
        "15",
        "--attempts",
        "1",
    ]);
    assert_eq!(done.status.code(), Some(1), "{}", said(&done));
    let said = said(&done);
    assert!(
        said.contains("tiles [") && said.contains("--attempts 2"),
        "{said}"
    );
    // All others are solved.
    let [solved, tiles] = solved(&job);
    assert_eq!(solved, tiles - 1);
}

/// A scan that is scattered in two groups: nine files of the same points, one of them read
/// nine times.
fn nine_million(dir: &Path) -> PathBuf {
    let scans = dir.join("scans");
    let simulate = [
        "simulate", "--points", "1M", "--length", "60", "--passes", "1", "-o",
    ];
    well(&[&simulate[..], &[text(&scans)]].concat());
    for copy in 2..=9 {
        fs::hard_link(
            scans.join("pass-1.laz"),
            scans.join(format!("pass-{copy}.laz")),
        )
        .unwrap();
    }
    scans
}

#[test]
fn scans_are_scattered_by_several_and_one_of_them_dies() {
    let dir = tempfile::tempdir().unwrap();
    let scans = nine_million(dir.path());
    let (one, many) = (dir.path().join("one.laz"), dir.path().join("many.laz"));
    let options = ["--spacing", "1", "--tile-size", "30", "--iterations", "3"];
    succeed(&scans, &one, &options);
    let job = dir.path().join("many.laz.job");
    let scatter = |more: &[&str]| -> Vec<String> {
        let begin = ["scatter", text(&scans), "-o", text(&many), "--threads", "1"];
        let all = begin.iter().chain(&options).chain(more);
        all.map(|&word| word.to_owned()).collect()
    };
    let shard = |of: &str| {
        let arguments = scatter(&["--patience", "15", "--log", "json", "--shard", of]);
        start(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let mut shards = [shard("0/2"), shard("1/2")];
    let length = |name: &str| fs::metadata(job.join(name)).map_or(0, |file| file.len());
    let has_begun = |name: &str| job.join(name).exists();
    while !has_begun("spill-0-0.bin") || !has_begun("spill-1-0.bin") {
        std::thread::sleep(Duration::from_millis(5));
    }
    let status = well(&["status", text(&job)]);
    assert!(status.contains("0 of 2 groups of scans"), "{status}");
    assert!(status.contains("group [1]: attempt 1"), "{status}");
    shards[0].kill().unwrap();
    shards[0].wait().unwrap();
    // The other takes over; who sees to all waits for it.
    let refused = lloydar(&["solve", text(&job)]);
    assert!(
        said(&refused).contains("lloydar scatter"),
        "{}",
        said(&refused)
    );
    let finish = scatter(&["--patience", "15", "--quiet"]);
    let finish: Vec<&str> = finish.iter().map(String::as_str).collect();
    assert!(well(&finish).contains("ready to be solved"));
    let mut log = String::new();
    let said = shards[1].stderr.as_mut().unwrap();
    said.read_to_string(&mut log).unwrap();
    assert!(shards[1].wait().unwrap().success());
    assert!(log.contains("\"event\":\"progress\""), "{log}");
    assert!(length("spill-0-1.index") > 0 && length("spill-0-0.index") == 0);
    // What only the last stage needs may lie elsewhere, and does not stay there.
    let disk = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
    well(&[
        "stitch",
        text(&job),
        "--quiet",
        "--scratch",
        text(disk.path()),
    ]);
    assert_eq!(fs::read_dir(disk.path()).unwrap().count(), 0);
    assert!(
        fs::read(&many).unwrap() == fs::read(&one).unwrap(),
        "not the same bytes"
    );
}

#[test]
fn a_shard_of_another_job_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let many = dir.path().join("many.laz");
    let scatter = |spacing: &str, more: &[&str]| {
        let begin = [
            "scatter",
            text(&scans),
            "-o",
            text(&many),
            "--quiet",
            "--spacing",
            spacing,
        ];
        lloydar(&[&begin[..], more].concat())
    };
    let shard = ["--shard", "0/2"];
    assert!(scatter("0.4", &shard).status.success());
    let other = scatter("0.5", &shard);
    assert!(
        said(&other).contains("other inputs or settings"),
        "{}",
        said(&other)
    );
    // One process alone begins anew, and then others do not interfere.
    assert!(scatter("0.5", &["--restart"]).status.success());
    let late = scatter("0.5", &shard);
    assert!(said(&late).contains("without --shard"), "{}", said(&late));
}

/// A program that runs what it is asked to submit, at once; of an array all tasks at the same
/// time.
const SBATCH: &str = r#"#!/bin/sh
tasks=
for word in "$@"; do
    case $word in
        --array=0-*) tasks=$(seq 0 "${word#--array=0-}") ;;
        --wrap=*) command=${word#--wrap=} ;;
        --job-name=lloydar-again) exec echo 0 ;;
        --export=ALL,SOLVE=*) export "${word#--export=ALL,}" ;;
    esac
done
if [ -n "$tasks" ]; then
    for task in $tasks; do
        SLURM_ARRAY_TASK_ID=$task sh -c "$command" >&2 &
    done
    wait
else
    sh -c "$command" >&2
fi
echo 17
"#;

#[test]
fn what_is_submitted_does_the_job_whatever_the_names() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    let one = dir.path().join("one.laz");
    succeed(&scans, &one, &OPTIONS);
    let place = dir.path().join("o'clock & more");
    fs::create_dir(&place).unwrap();
    let many = place.join("many points.laz");
    let tool = dir.path().join("sbatch");
    fs::write(&tool, SBATCH).unwrap();
    fs::set_permissions(&tool, fs::Permissions::from_mode(0o755)).unwrap();
    // Slurm would be told how long tasks may take.
    let told = dir.path().join("told");
    let control = dir.path().join("scontrol");
    fs::write(
        &control,
        format!("#!/bin/sh\necho \"$@\" >> '{}'\n", told.display()),
    )
    .unwrap();
    fs::set_permissions(&control, fs::Permissions::from_mode(0o755)).unwrap();
    let mut arguments = vec![
        "slurm",
        text(&scans),
        "-o",
        text(&many),
        "--tasks",
        "3",
        "--cpus",
        "1",
    ];
    arguments.extend(OPTIONS);
    let submit = |more: &[&str]| {
        let path = format!(
            "{}:{}",
            dir.path().display(),
            std::env::var("PATH").unwrap()
        );
        Command::new(PROGRAM)
            .args(&arguments)
            .args(more)
            .env("PATH", path)
            .env("SOURCE_DATE_EPOCH", "1700000000")
            .output()
            .unwrap()
    };
    let dry = submit(&["--dry-run", "--partition", "night", "--time", "08:00:00"]);
    let script = said(&dry);
    for asked in [
        "--array=0-2",
        "--partition=night",
        "--time=08:00:00",
        "--requeue",
        "--mem=",
    ] {
        assert!(script.contains(asked), "{asked}: {script}");
    }
    assert!(!many.exists());
    let done = submit(&[]);
    assert!(done.status.success(), "{}", said(&done));
    let told = fs::read_to_string(told).unwrap();
    // A few seconds of work, three times, and ten minutes.
    assert_eq!(told, "update JobId=17 TimeLimit=11\n");
    assert!(
        fs::read(&many).unwrap() == fs::read(&one).unwrap(),
        "not the same bytes"
    );
    // The recipe for machines without a scheduler.
    let again = dir.path().join("again.laz");
    let mut scatter = vec!["scatter", text(&scans), "-o", text(&again), "--quiet"];
    scatter.extend(OPTIONS);
    well(&scatter);
    let job = dir.path().join("again.laz.job");
    let recipe = "seq 0 2 | xargs -P 3 -I{} \"$0\" solve \"$1\" --shard {}/3 --quiet && \
                  seq 0 2 | xargs -P 3 -I{} \"$0\" stitch \"$1\" --shard {}/3 --quiet && \"$0\" stitch \"$1\" --quiet";
    let done = Command::new("sh")
        .args(["-c", recipe, PROGRAM, text(&job)])
        .env("SOURCE_DATE_EPOCH", "1700000000")
        .output()
        .unwrap();
    assert!(done.status.success(), "{}", said(&done));
    assert!(
        fs::read(&again).unwrap() == fs::read(&one).unwrap(),
        "not the same bytes"
    );
}
