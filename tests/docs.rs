//! What the documents say is what the program does.

use std::{fs, process::Command};

use crate::running::{PROGRAM, street};

/// The commands of the shell blocks of a document.
fn commands(document: &str) -> Vec<String> {
    let blocks = document.split("```sh\n").skip(1);
    blocks
        .filter_map(|block| block.split("```").next())
        .flat_map(|block| block.lines().map(str::to_owned))
        .collect()
}

/// Runs the commands of the document at `path` in a directory with a scan, and returns how many
/// there are.
fn run_commands(path: &str) -> usize {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    assert_eq!(scans, dir.path().join("scans"), "documents name it");
    fs::copy(scans.join("pass-1.laz"), dir.path().join("scan.laz")).unwrap();
    let configs = dir.path().join("configs");
    fs::create_dir(&configs).unwrap();
    fs::copy("configs/low-memory.toml", configs.join("low-memory.toml")).unwrap();
    let all = commands(&fs::read_to_string(path).unwrap());
    for command in &all {
        let mut words = command.split_whitespace();
        assert_eq!(words.next(), Some("lloydar"), "{command}");
        let done = Command::new(PROGRAM)
            .current_dir(dir.path())
            .args(words)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&done.stderr);
        assert!(done.status.success(), "{command}: {said}");
    }
    all.len()
}

#[test]
fn every_command_of_the_tour_works() {
    assert!(run_commands("docs/TOUR.md") > 10);
}

#[test]
fn every_command_of_the_recipes_works() {
    assert!(run_commands("docs/RECIPES.md") > 7);
}
