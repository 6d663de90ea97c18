//! Names of the files that jobs make; nothing else is ever removed from a job directory.

use std::{fs, path::Path};

/// The name of the file with the tiles of a job.
pub(crate) const PLAN_FILE: &str = "plan.json";

/// The name of the directory in which the coarser levels of a mesh are made.
pub(super) const LEVELS_DIRECTORY: &str = "levels";

/// The name of the directory in which an output is written that will be uploaded.
pub(crate) const UPLOAD_DIRECTORY: &str = "upload";

/// The name of the directory in which processes that stitch write tiles of the output.
pub(crate) const WRITTEN_DIRECTORY: &str = "written";

/// The names of directories in a job directory.
pub(super) const DIRECTORIES: [&str; 3] = [LEVELS_DIRECTORY, UPLOAD_DIRECTORY, WRITTEN_DIRECTORY];

/// Stems of the names of a job's files, without the numbers of groups and attempts.
const STEMS: [&str; 16] = [
    "groups",
    LEVELS_DIRECTORY,
    "handover",
    "inputs",
    "job",
    "left-out",
    "lock",
    "mesh",
    "plan",
    "ranked",
    "spacing",
    "spill",
    "starts",
    "tiles",
    "transients",
    UPLOAD_DIRECTORY,
];

/// Stems of the names of files in which the stitch keeps what it has made.
const STITCH_STEMS: [&str; 7] = [
    "columns",
    "elected",
    "figures",
    "measured",
    "settled",
    "sorted",
    WRITTEN_DIRECTORY,
];

/// Endings of the names of a job's files.
const ENDINGS: [&str; 13] = [
    "",
    "json",
    "part",
    "bin",
    "index",
    "checkpoint",
    "complete",
    "left",
    "started",
    "solved",
    "pieces",
    "ordered",
    "triangles",
];

/// Whether `name` is the name of a file with tiles that are begun or solved.
pub(crate) fn is_of_tiles(name: &str) -> bool {
    ["tiles", "starts"].contains(&stem_of(name))
}

/// Whether `name` is the name of a file in which the stitch keeps what it has made.
pub(super) fn is_of_stitch(name: &str) -> bool {
    STITCH_STEMS.contains(&stem_of(name))
}

/// Whether `name` is the name of a file that jobs make.
pub(super) fn is_own(name: &str) -> bool {
    let ending = name.split_once('.').map_or("", |(_, ending)| ending);
    let is_known = STEMS.contains(&stem_of(name)) || is_of_stitch(name);
    is_known && ENDINGS.contains(&ending)
}

/// The stem of a name without numbers: files of work that processes share have those of the group and of the attempt.
fn stem_of(name: &str) -> &str {
    let stem = name.split_once('.').map_or(name, |(stem, _)| stem);
    stem.trim_end_matches(|c: char| c == '-' || c.is_ascii_digit())
}

/// Sums the bytes of the files in `dir` whose names are `wanted`; 0 if there is no such directory.
pub(crate) fn bytes_in(dir: &Path, wanted: impl Fn(&str) -> bool) -> u64 {
    let entries = fs::read_dir(dir).into_iter().flatten().flatten();
    entries
        .filter(|entry| entry.file_name().to_str().is_some_and(&wanted))
        .filter_map(|entry| entry.metadata().ok())
        .map(|metadata| metadata.len())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_jobs_are_known_with_and_without_numbers() {
        for own in [
            "lock",
            "job.json",
            "job-12-34.json",
            "spill-3-0.index",
            "starts-3-0.started",
            "elected-3-64-7-0.pieces",
            "sorted-3-0.bin",
            "settled.pieces",
            "tiles.solved",
        ] {
            assert!(is_own(own), "{own}");
        }
        for other in ["tile-photo.jpg", "plan.xls", "spills.bin", "job.json.bak"] {
            assert!(!is_own(other), "{other}");
        }
    }
}
