//! The program as tests run it.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::mpsc,
    thread,
    time::Duration,
};

use las::Reader;

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_lloydar");

/// How long a job of a test may take; one that hangs is killed, and has failed.
const PATIENCE: Duration = Duration::from_secs(300);

pub(crate) fn lloydar(arguments: &[&str]) -> Output {
    let job = Command::new(PROGRAM)
        .args(arguments)
        .env("SOURCE_DATE_EPOCH", "1700000000")
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let id = job.id().to_string();
    let (ended, end) = mpsc::channel::<()>();
    let watch = thread::spawn(move || {
        if end.recv_timeout(PATIENCE) == Err(mpsc::RecvTimeoutError::Timeout) {
            drop(Command::new("kill").args(["-KILL", &id]).status());
        }
    });
    let output = job.wait_with_output().unwrap();
    drop(ended);
    watch.join().unwrap();
    output
}

/// Starts the program and goes on.
pub(crate) fn start(arguments: &[&str]) -> Child {
    Command::new(PROGRAM)
        .args(arguments)
        .env("SOURCE_DATE_EPOCH", "1700000000")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Simulates a short street of 300 000 points in two files.
pub(crate) fn street(dir: &Path) -> PathBuf {
    simulated(dir, &["--length", "60", "--points", "300K"])
}

/// Simulates a street by `options` in two files.
pub(crate) fn simulated(dir: &Path, options: &[&str]) -> PathBuf {
    let scans = dir.join("scans");
    let done = lloydar(&[&["simulate", "-o", text(&scans)], options].concat());
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    scans
}

pub(crate) fn run(scans: &Path, output: &Path, more: &[&str]) -> Output {
    let mut arguments = vec!["run", text(scans), "-o", text(output), "--quiet"];
    arguments.extend(more);
    lloydar(&arguments)
}

pub(crate) fn succeed(scans: &Path, output: &Path, more: &[&str]) {
    let done = run(scans, output, more);
    assert!(
        done.status.success(),
        "{more:?}: {}",
        String::from_utf8_lossy(&done.stderr)
    );
}

/// Sorted coordinates, as stored.
pub(crate) fn points(path: &Path) -> Vec<[i32; 3]> {
    let mut points = points_in_order(path);
    points.sort_unstable();
    points
}

/// Coordinates, as stored, in the order of the file.
pub(crate) fn points_in_order(path: &Path) -> Vec<[i32; 3]> {
    let all = Reader::from_path(path).unwrap().read_all().unwrap();
    all.x_raw()
        .zip(all.y_raw())
        .zip(all.z_raw())
        .map(|((x, y), z)| [x, y, z])
        .collect()
}

pub(crate) fn report(output: &Path) -> serde_json::Value {
    let path = format!("{}.report.json", output.display());
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}
