//! Files that are complete or not there: what a job knows of itself.
//!
//! The content, then a checksum of it as 8 bytes. Written under another name, flushed
//! to the disk, renamed.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::Path,
};

use crate::geometry::spread;

/// Writes `content` to `path`, complete or not at all.
///
/// # Errors
///
/// As the operating system says; what stood under the name still does then.
pub(crate) fn write_checksummed(path: &Path, content: &[u8]) -> io::Result<()> {
    let aside = path.with_extension("part");
    let mut file = File::create(&aside)?;
    file.write_all(content)?;
    file.write_all(&checksum(content).to_le_bytes())?;
    file.sync_all()?;
    fs::rename(&aside, path)
}

/// The content of the file at `path`; `None` if it is not what was written.
///
/// # Errors
///
/// As the operating system says.
pub(crate) fn read_checksummed(path: &Path) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = fs::read(path)?;
    let Some(content) = checked(&bytes).map(<[u8]>::len) else {
        return Ok(None);
    };
    bytes.truncate(content);
    Ok(Some(bytes))
}

/// The content of a file of these `bytes`, if the checksum is its own.
fn checked(bytes: &[u8]) -> Option<&[u8]> {
    let (content, sum) = bytes.split_last_chunk()?;
    (checksum(content).to_le_bytes() == *sum).then_some(content)
}

/// A checksum against half-written and bit-rotten files, not against malice.
pub(super) fn checksum(bytes: &[u8]) -> u64 {
    bytes.chunks(8).fold(bytes.len() as u64, |sum, chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        spread(sum ^ u64::from_le_bytes(word))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_flipped_byte_and_any_cut_is_noticed() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("file");
        let content: Vec<u8> = (0..203_u32).map(|i| (i * i) as u8).collect();
        write_checksummed(&path, &content).unwrap();
        assert_eq!(read_checksummed(&path).unwrap(), Some(content));
        let bytes = fs::read(&path).unwrap();
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 0x10;
            assert_eq!(checked(&flipped), None, "byte {at}");
            assert_eq!(checked(&bytes[..at]), None, "cut at {at}");
        }
    }
}
