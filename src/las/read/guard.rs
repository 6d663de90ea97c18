//! A guard between damaged files and decoders.
//!
//! A decoder should answer damage with an error. Some damage makes it panic instead,
//! call itself without end, or read a record of any length into memory. The guard turns
//! that into errors, too.

use std::{
    cell::Cell,
    io::{self, BufReader, Read, Seek, SeekFrom},
    panic::{AssertUnwindSafe, catch_unwind},
};

use crate::{
    las::format::header::{EXTENDED_COUNT, VERSION},
    store::SourceReader,
};

/// The most bytes of stack that decoding may take. Sound files take a few thousand and
/// threads have two million; between two reads a decoder that calls itself takes some
/// hundred thousand.
const MOST_STACK_BYTES: usize = 512 << 10;
/// What is said of a file on which the decoder panics.
pub(super) const DECODER_FAILED: &str = "the decoder stopped at damaged data";

thread_local! {
    /// The address of the stack when decoding began; 0 if this thread does not decode.
    static STACK: Cell<usize> = const { Cell::new(0) };
}

/// Whether this thread decodes: a panic then means damaged data, which is reported as an
/// error. A panic hook asks this, to be silent.
pub(crate) fn is_decoding() -> bool {
    STACK.get() != 0
}

/// Calls a decoder; returns `None` if it panics. Its reader must not be used again then.
pub(super) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    STACK.set(stack_address());
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    STACK.set(0);
    decoded.ok()
}

/// An address near the end of the stack.
#[inline]
fn stack_address() -> usize {
    let here = 0_u8;
    &raw const here as usize
}

/// A file that is read by a decoder.
///
/// The number of extended records in its header reads as 0: the reader of points would read
/// the first of them into memory, however long it is.
pub(super) struct GuardedFile {
    file: BufReader<SourceReader>,
    /// The offset of the next byte.
    at: u64,
    /// Whether the header has a number of extended records (LAS 1.4).
    has_count: bool,
}

impl GuardedFile {
    /// Reads `file` from its beginning.
    ///
    /// # Errors
    ///
    /// If the file cannot be read up to the version of its header.
    pub(super) fn new(mut file: SourceReader) -> io::Result<Self> {
        let mut beginning = [0; VERSION.end];
        file.read_exact(&mut beginning)?;
        file.rewind()?;
        Ok(Self {
            file: BufReader::with_capacity(1 << 20, file),
            at: 0,
            has_count: beginning[VERSION] == [1, 4],
        })
    }

    #[inline]
    fn check_depth() -> io::Result<()> {
        let began = STACK.get();
        if began != 0 && began.abs_diff(stack_address()) > MOST_STACK_BYTES {
            return Err(io::Error::new(
                io::ErrorKind::InvalidData,
                "points that refer to themselves",
            ));
        }
        Ok(())
    }
}

impl Read for GuardedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        Self::check_depth()?;
        let read = self.file.read(buffer)?;
        if self.has_count && self.at < EXTENDED_COUNT.end {
            for (at, byte) in (self.at..).zip(&mut buffer[..read]) {
                if EXTENDED_COUNT.contains(&at) {
                    *byte = 0;
                }
            }
        }
        self.at += read as u64;
        Ok(read)
    }

    /// Reads straight from the buffer, because decoders read byte by byte.
    #[inline]
    fn read_exact(&mut self, mut buffer: &mut [u8]) -> io::Result<()> {
        if self.at >= EXTENDED_COUNT.end {
            Self::check_depth()?;
            self.file.read_exact(buffer)?;
            self.at += buffer.len() as u64;
            return Ok(());
        }
        while !buffer.is_empty() {
            match self.read(buffer)? {
                0 => return Err(io::ErrorKind::UnexpectedEof.into()),
                read => buffer = &mut buffer[read..],
            }
        }
        Ok(())
    }
}

impl Seek for GuardedFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = match to {
            // Within the buffer if possible.
            SeekFrom::Current(by) => {
                self.file.seek_relative(by)?;
                self.at.wrapping_add_signed(by)
            }
            _ => self.file.seek(to)?,
        };
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use std::{fs::File, path::Path};

    use super::*;

    fn open(path: &Path) -> GuardedFile {
        GuardedFile::new(SourceReader::File(File::open(path).unwrap())).unwrap()
    }

    fn sink(file: &mut GuardedFile) -> io::Result<usize> {
        let mut byte = [0; 1];
        file.read_exact(&mut byte)?;
        // Not the last thing that is done: every call has a frame of its own.
        sink(file).map(|found| found + usize::from(byte[0] > 7))
    }

    #[test]
    fn a_decoder_that_calls_itself_without_end_is_stopped() {
        let path = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(path.path(), vec![0; 4 << 20]).unwrap();
        let mut file = open(path.path());
        let error = guarded(|| sink(&mut file)).unwrap().unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
        assert!(file.at < 1 << 20);
        assert!(!is_decoding());
        let panicked = guarded(|| {
            assert!(is_decoding());
            std::panic::panic_any("damage")
        });
        assert!(panicked.is_none() && !is_decoding());
    }

    #[test]
    fn a_header_has_no_extended_records_and_all_else_as_it_is() {
        let path = tempfile::NamedTempFile::new().unwrap();
        let mut content: Vec<u8> = (0..2000_u32).map(|i| (i * 7 + 1) as u8 | 1).collect();
        content[24..26].copy_from_slice(&[1, 4]);
        std::fs::write(path.path(), &content).unwrap();
        content[243..247].fill(0);
        let mut file = open(path.path());
        for (from, length) in [
            (0, 2000),
            (240, 5),
            (243, 4),
            (246, 300),
            (1000, 10),
            (3, 400),
        ] {
            let mut read = vec![0; length];
            file.seek(SeekFrom::Start(from as u64)).unwrap();
            file.read_exact(&mut read).unwrap();
            assert_eq!(read, content[from..from + length]);
            file.seek(SeekFrom::Current(-2)).unwrap();
            file.read_exact(&mut read[..2]).unwrap();
            assert_eq!(read[..2], content[from + length - 2..from + length]);
        }
        file.read_exact(&mut [0; 3000]).unwrap_err();
    }
}
