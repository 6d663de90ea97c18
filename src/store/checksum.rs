//! The checksum of a file: SHA-256 in hexadecimal digits, as other programs print it.

use std::io::{self, Read};

use sha2::{Digest, Sha256};

/// The bytes that are read at a time.
const BATCH_BYTES: usize = 1 << 20;

/// The checksum of all that `file` still has.
///
/// # Errors
///
/// If it cannot be read, or soon after `is_stopped` becomes true.
pub(super) fn checksum(file: &mut impl Read, is_stopped: &dyn Fn() -> bool) -> io::Result<String> {
    let mut digest = Sha256::new();
    let mut buffer = vec![0; BATCH_BYTES];
    loop {
        if is_stopped() {
            return Err(io::ErrorKind::Interrupted.into());
        }
        match file.read(&mut buffer)? {
            0 => return Ok(digits(digest)),
            read => digest.update(&buffer[..read]),
        }
    }
}

/// The checksum of all bytes that `digest` has seen.
pub(super) fn digits(digest: Sha256) -> String {
    let digest = digest.finalize();
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checksum_is_the_one_that_others_compute() {
        // FIPS 180-2, appendix B.1.
        assert_eq!(
            checksum(&mut &b"abc"[..], &|| false).unwrap(),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
        );
    }

    #[test]
    fn a_file_is_not_read_to_its_end_when_nobody_waits_for_its_checksum() {
        let error = checksum(&mut io::repeat(0), &|| true).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::Interrupted);
    }
}
