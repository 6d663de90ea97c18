//! How a cloud was made, for those who find it later.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use crate::job::{JobError, Survey, directory::JobDirectory};
use crate::{config::Settings, tile::Spill};

/// Inputs that are named at the most: a record has 65 535 bytes.
const MOST_NAMED: usize = 200;
/// What is kept in the job directory.
const CHECKSUMS: &str = "inputs.json";

/// The SHA-256 of every input that is named, in hexadecimal digits; those that an earlier
/// run found are not looked for again.
///
/// # Errors
///
/// If an input cannot be read.
pub(crate) fn checksums(
    survey: &Survey,
    directory: &JobDirectory,
) -> Result<Vec<String>, JobError> {
    let named: Vec<&Path> = survey
        .inputs
        .iter()
        .take(MOST_NAMED)
        .map(|input| input.path.as_path())
        .collect();
    if let Some(found) = directory.read::<Vec<String>>(CHECKSUMS)
        && found.len() == named.len()
    {
        return Ok(found);
    }
    let found = named
        .par_iter()
        .map(|path| checksum(path).map_err(|e| JobError::io("read", path, e)))
        .collect::<Result<Vec<String>, JobError>>()?;
    directory.write(CHECKSUMS, &found)?;
    Ok(found)
}

fn checksum(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let mut digest = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    loop {
        match file.read(&mut buffer)? {
            0 => break,
            read => digest.update(&buffer[..read]),
        }
    }
    Ok(digest
        .finalize()
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect())
}

/// How the cloud was made, as JSON: program, settings that decide the result, inputs.
pub(crate) fn provenance(
    settings: &Settings,
    spacing: f64,
    survey: &Survey,
    checksums: &[String],
    spill: &Spill,
) -> String {
    let inputs: Vec<serde_json::Value> = survey
        .inputs
        .iter()
        .zip(checksums)
        .map(|(input, checksum)| {
            let name = input.path.file_name().map(|name| name.to_string_lossy());
            serde_json::json!({ "name": name, "sha256": checksum })
        })
        .collect();
    let mut settings = Settings {
        memory: None,
        threads: 1,
        tile_size: None,
        halo: None,
        ..settings.clone()
    };
    // A coast line would fill the record.
    settings.filter.polygons = None;
    serde_json::json!({
        "lloydar": env!("CARGO_PKG_VERSION"),
        "spacing": spacing,
        "settings": settings,
        "inputs": inputs,
        "inputs_in_all": survey.inputs.len(),
        "points_read": spill.points(),
    })
    .to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_is_the_one_that_others_compute() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "abc").unwrap();
        // FIPS 180-2, appendix B.1.
        assert_eq!(
            checksum(file.path()).unwrap(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }
}
