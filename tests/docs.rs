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

#[test]
fn every_command_of_the_tour_works() {
    let dir = tempfile::tempdir().unwrap();
    let scans = street(dir.path());
    fs::copy(scans.join("pass-1.laz"), dir.path().join("scan.laz")).unwrap();
    let configs = dir.path().join("configs");
    fs::create_dir(&configs).unwrap();
    fs::copy("configs/low-memory.toml", configs.join("low-memory.toml")).unwrap();
    let tour = commands(&fs::read_to_string("docs/TOUR.md").unwrap());
    assert!(tour.len() > 10, "{tour:?}");
    for command in tour {
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
}
