//! Small files that are complete under their names or not there.

use std::{fs, path::Path, time::UNIX_EPOCH};

use serde::{Serialize, de::DeserializeOwned};

use crate::{
    job::error::JobError,
    tile::{read_checksummed, write_aside, write_checksummed},
};

/// Reads the JSON file at `path`; `None` if it is missing or damaged.
pub(super) fn read_json<T: DeserializeOwned>(path: &Path) -> Option<T> {
    let content = read_checksummed(path).ok()??;
    serde_json::from_slice(&content).ok()
}

/// Writes `value` as JSON to `path`, completely or not at all.
///
/// # Errors
///
/// [`JobError::Io`] if the file cannot be written.
pub(super) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), JobError> {
    write_checksummed(path, to_json(value).as_bytes()).map_err(|e| JobError::io("write", path, e))
}

/// Formats `value` as JSON on several lines.
pub(super) fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).expect("the job's files consist of plain numbers and text")
}

/// Writes `content` to `path`, completely or not at all, where other processes may write equal
/// content at the same time.
///
/// # Errors
///
/// [`JobError::Io`] if the file cannot be written.
pub(crate) fn write_among_others(path: &Path, content: &[u8]) -> Result<(), JobError> {
    // Processes on several machines may have equal numbers, but not at one moment.
    let now = UNIX_EPOCH.elapsed().unwrap_or_default().as_nanos();
    let own = format!("job-{}-{now}.json", std::process::id());
    let aside = path.with_file_name(own);
    let write = write_checksummed(&aside, content).and_then(|()| fs::rename(&aside, path));
    write.map_err(|e| JobError::io("write", path, e))
}

/// Writes `content` to `path` without a checksum: the file is complete under its name or not there.
///
/// # Errors
///
/// [`JobError::Io`] if the file cannot be written.
pub(crate) fn write_file(path: &Path, content: &[u8]) -> Result<(), JobError> {
    let mut aside = path.to_owned().into_os_string();
    aside.push(".part");
    write_aside(Path::new(&aside), path, &[content]).map_err(|e| JobError::io("write", path, e))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// A job that is continued must go on with the same numbers: a spacing that is off by the last bit
    /// makes another cloud.
    #[test]
    fn numbers_come_back_to_the_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("numbers.json");
        let numbers: Vec<f64> = (0..10_000)
            .map(|k| spread(k) as f64 / u64::MAX as f64 * 10_f64.powi((k % 13) as i32 - 6))
            .collect();
        write_json(&path, &numbers).unwrap();
        let found: Vec<f64> = read_json(&path).unwrap();
        let bits = |numbers: &[f64]| -> Vec<u64> { numbers.iter().map(|n| n.to_bits()).collect() };
        assert_eq!(bits(&found), bits(&numbers));
    }
}
