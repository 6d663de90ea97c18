//! Checksums of the inputs, by which the output names them.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::survey::Survey;
use crate::job::{directory::JobDirectory, error::JobError};

/// The largest number of inputs that the output names: a variable-length record has at most 65 535
/// bytes.
const NAMED_INPUTS_LIMIT: usize = 200;

/// Name of the file in the job directory that contains the checksums.
const CHECKSUMS_FILE: &str = "inputs.json";

/// Computes the SHA-256 of the first inputs, in hexadecimal digits, or reads the checksums that an
/// earlier run computed.
///
/// # Errors
///
/// [`JobError::Io`] if an input cannot be read.
pub(super) fn checksums(
    survey: &Survey,
    directory: &JobDirectory,
) -> Result<Vec<String>, JobError> {
    let named: Vec<&Path> = survey
        .inputs
        .iter()
        .take(NAMED_INPUTS_LIMIT)
        .map(|input| input.path.as_path())
        .collect();
    if let Some(found) = directory.read::<Vec<String>>(CHECKSUMS_FILE)
        && found.len() == named.len()
    {
        return Ok(found);
    }
    let computed = named
        .par_iter()
        .map(|path| checksum(path).map_err(|e| JobError::io("read", path, e)))
        .collect::<Result<Vec<String>, JobError>>()?;
    directory.write(CHECKSUMS_FILE, &computed)?;
    Ok(computed)
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
