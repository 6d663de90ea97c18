//! Checksums of the inputs, by which the output names them.

use rayon::prelude::*;

use super::survey::Survey;
use crate::{
    job::{directory::JobDirectory, error::JobError},
    las::InputFile,
};

/// The largest number of inputs that the output names: a variable-length record has at most 65 535
/// bytes.
const NAMED_INPUTS_LIMIT: usize = 200;

/// Name of the file in the job directory that contains the checksums.
const CHECKSUMS_FILE: &str = "inputs.json";

/// Computes the SHA-256 of the first inputs, in hexadecimal digits, or reads the checksums that an
/// earlier run computed. An input of which only some nodes are read has none: it would have to be read as a whole.
///
/// # Errors
///
/// [`JobError::Io`] if an input cannot be read, or soon after `is_stopped` becomes true.
pub(super) fn checksums(
    survey: &Survey,
    directory: &JobDirectory,
    is_stopped: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<Option<String>>, JobError> {
    let named: Vec<&InputFile> = survey.inputs.iter().take(NAMED_INPUTS_LIMIT).collect();
    if let Some(found) = directory.read::<Vec<Option<String>>>(CHECKSUMS_FILE)
        && found.len() == named.len()
    {
        return Ok(found);
    }
    let checksum = |input: &&InputFile| match input.is_read_whole(&survey.filter) {
        true => input
            .source
            .checksum(is_stopped)
            .map(Some)
            .map_err(|e| JobError::io("read", &input.path, e)),
        false => Ok(None),
    };
    let computed = named
        .par_iter()
        .map(checksum)
        .collect::<Result<Vec<_>, JobError>>()?;
    directory.write(CHECKSUMS_FILE, &computed)?;
    Ok(computed)
}

/// Expects those inputs of `survey` that will have a checksum to be read from their beginning to their end. Of each that is
/// remote at most `waiting` bytes stay in memory for it.
pub(super) fn begin_checksums(survey: &Survey, waiting: u64) {
    let named = survey.inputs.iter().take(NAMED_INPUTS_LIMIT);
    for input in named.filter(|input| input.is_read_whole(&survey.filter)) {
        input.source.begin_checksum(waiting);
    }
}
