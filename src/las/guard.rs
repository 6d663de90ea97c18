//! What stands between a damaged file and the decoder.
//!
//! A decoder should answer damage with an error. Some damage makes it panic instead,
//! call itself without end, or take a record of any length into memory. Here that
//! becomes an error, too.

use std::{
    cell::Cell,
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    ops::Range,
    panic::{AssertUnwindSafe, catch_unwind},
};

/// Where a header of LAS 1.4 says how many extended records there are.
const EXTENDED_COUNT: Range<u64> = 243..247;
/// Bytes of stack that decoding takes at the most: it takes a few thousand, threads
/// have two million, and between two reads a decoder that calls itself comes some
/// hundred thousand deep.
const DEEPEST: usize = 512 << 10;

thread_local! {
    /// Where the stack was when decoding began; 0 if this thread does not decode.
    static STACK: Cell<usize> = const { Cell::new(0) };
}

/// Whether this thread decodes: a panic then is no more than damaged data, and is told
/// as such. For a panic hook to be quiet about.
pub(crate) fn is_decoding() -> bool {
    STACK.get() != 0
}

/// Calls a decoder; `None` if it panics. Its reader is not to be used again then.
pub(super) fn guarded<T>(decode: impl FnOnce() -> T) -> Option<T> {
    STACK.set(stack());
    let decoded = catch_unwind(AssertUnwindSafe(decode));
    STACK.set(0);
    decoded.ok()
}

/// About where the stack is.
#[inline]
fn stack() -> usize {
    let here = 0_u8;
    &raw const here as usize
}

/// A file that is read by a decoder.
///
/// Its header says that no extended records follow: the reader of points would take
/// the first into memory, however long it is.
pub(super) struct GuardedFile {
    file: BufReader<File>,
    at: u64,
    has_count: bool,
}

impl GuardedFile {
    pub(super) fn new(mut file: File) -> io::Result<Self> {
        let mut beginning = [0; 26];
        file.read_exact(&mut beginning)?;
        file.rewind()?;
        Ok(Self {
            file: BufReader::with_capacity(1 << 20, file),
            at: 0,
            has_count: beginning[24..] == [1, 4],
        })
    }

    #[inline]
    fn check_depth() -> io::Result<()> {
        let began = STACK.get();
        if began != 0 && began.abs_diff(stack()) > DEEPEST {
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

    /// Decoders read byte by byte: straight from the buffer.
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
            // Within the buffer, if it can be.
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
    use super::*;

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
        let mut file = GuardedFile::new(File::open(path.path()).unwrap()).unwrap();
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
        let mut file = GuardedFile::new(File::open(path.path()).unwrap()).unwrap();
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
