//! `demo`: a street is simulated, and resampled with the options that it prints.

use std::path::Path;

use super::{
    allocator,
    printing::result,
    running::{run_and_print, with_ending},
    simulating::write_street,
    terminal::Display,
};
use crate::{
    config::{Bytes, Choices, Length},
    job::{JobDescription, JobError, Placement},
    report::REPORT_PAGE,
    simulate::{Street, StreetOptions},
};

/// The budget in bytes: with it the street has two tiles.
const MEMORY: u64 = 192 << 20;

/// Simulates a street and resamples it, with all files in the directory `output`.
pub(super) fn demo(output: &Path) -> Result<u8, JobError> {
    // As `run` does with this budget.
    allocator::return_freed_memory(MEMORY);
    let scans = output.join("scans");
    result!("simulating a street: 2 400 000 points in 3 passes");
    let street = Street::new(StreetOptions {
        length: 100.0,
        passes: 3,
        points: 2_400_000,
        ..StreetOptions::default()
    });
    write_street(&street, &scans)?;
    let cloud = output.join("street.laz");
    result!(
        "lloydar run {} -o {} --spacing 0.2 --memory {}MiB",
        scans.display(),
        cloud.display(),
        MEMORY >> 20
    );
    let choices = Choices {
        spacing: Some(Length::plain(0.2)),
        memory: Some(Bytes(MEMORY)),
        ..Choices::default()
    };
    let page = with_ending(&cloud, REPORT_PAGE);
    let job = JobDescription {
        inputs: vec![scans],
        dir: Placement::of(&cloud, None).dir,
        mesh: None,
        scratch: None,
        output: cloud,
        destination: None,
        settings: choices.settings(None)?,
        overwrite: true,
        keep: false,
        skip_bad_files: false,
        restart: false,
    };
    let code = run_and_print(&job, None, Display::choose(false, false))?;
    if let Ok(page) = std::path::absolute(page) {
        result!("\nsee it:   file://{}", page.display());
    }
    Ok(code)
}
