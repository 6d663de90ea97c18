//! Files that are complete or absent, for what a job knows of itself.
//!
//! ```text
//!   content
//!   checksum of the content   u64, little endian
//! ```
//!
//! A file is written under another name, flushed to the disk, and renamed.

use std::{
    fs::{self, File},
    io::{self, Write},
    path::Path,
};

use crate::geometry::spread;

/// Writes `content` to the file at `path`, which is complete or unchanged.
///
/// # Errors
///
/// The error of the operating system; an earlier file of this name is unchanged then.
pub(crate) fn write_checksummed(path: &Path, content: &[u8]) -> io::Result<()> {
    write_complete(path, &[content, &checksum(content).to_le_bytes()])
}

/// Writes `pieces`, one after the other, to the file at `path`, which is complete or unchanged.
///
/// # Errors
///
/// The error of the operating system; an earlier file of this name is unchanged then.
pub(super) fn write_complete(path: &Path, pieces: &[&[u8]]) -> io::Result<()> {
    write_aside(&path.with_extension("part"), path, pieces)
}

/// Writes `pieces`, one after the other, to the file `aside`, which gets the name `path` when it is on the disk.
///
/// # Errors
///
/// The error of the operating system; an earlier file of the name `path` is unchanged then.
pub(crate) fn write_aside(aside: &Path, path: &Path, pieces: &[&[u8]]) -> io::Result<()> {
    let mut file = File::create(aside)?;
    for piece in pieces {
        file.write_all(piece)?;
    }
    file.sync_all()?;
    fs::rename(aside, path)
}

/// Reads the content of the file at `path`; `None` if the checksum does not match.
///
/// # Errors
///
/// The error of the operating system.
pub(crate) fn read_checksummed(path: &Path) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = fs::read(path)?;
    let Some(content) = checked(&bytes).map(<[u8]>::len) else {
        return Ok(None);
    };
    bytes.truncate(content);
    Ok(Some(bytes))
}

/// Returns the content of a file that consists of `bytes`, if the checksum matches.
fn checked(bytes: &[u8]) -> Option<&[u8]> {
    let (content, sum) = bytes.split_last_chunk()?;
    (checksum(content).to_le_bytes() == *sum).then_some(content)
}

/// Computes a 64-bit checksum. It detects half-written files and flipped bits, not malice.
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
    fn every_flipped_byte_and_every_cut_is_detected() {
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
