//! Windows on a file, mapped into memory one after the other.
//!
//! Mapped pages count as resident: a window is unmapped before the next is
//! opened, so that reading a large spill holds one window at most.

use std::{fs::File, io};

use memmap2::{Mmap, MmapOptions};

/// Maps `length` bytes of `file` from `offset`.
///
/// # Errors
///
/// As the operating system says; also if the file is shorter than that, which
/// would otherwise be a bus error at the first touch.
#[expect(unsafe_code, reason = "the one place where memory is mapped")]
pub(super) fn window(file: &File, offset: u64, length: usize) -> io::Result<Mmap> {
    if file.metadata()?.len() < offset + length as u64 {
        return Err(io::Error::new(
            io::ErrorKind::UnexpectedEof,
            "the file has become shorter",
        ));
    }
    // SAFETY: a map is undefined behaviour only if the file is changed or cut
    // while it is open. The spill belongs to this job: it lies in the job's own
    // directory, is complete before it is ever mapped, and is not written
    // again. Its length was checked just now.
    unsafe { MmapOptions::new().offset(offset).len(length).map(file) }
}
