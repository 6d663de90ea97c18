//! An input, whose ranges are read as those of a file wherever it lies.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use super::{
    address::{is_remote, without_secrets},
    checksum::checksum,
    identity::Identity,
    remote::{Object, ObjectReader},
};

/// The bytes of an object that are not worth a request of their own.
const SHORT_RANGE: u64 = 32 << 10;

/// A file or an object.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    path: PathBuf,
    bytes: u64,
    object: Option<Arc<Object>>,
}

impl Source {
    /// Finds the file or the object at `path`. Of an object the beginning is read.
    ///
    /// # Errors
    ///
    /// If there is none, it cannot be read, or it is a directory.
    pub(crate) fn find(path: &Path) -> io::Result<Self> {
        if is_remote(path) {
            let object = Object::find(path)?;
            return Ok(Self {
                path: without_secrets(path),
                bytes: object.identity().bytes,
                object: Some(object),
            });
        }
        let metadata = std::fs::metadata(path)?;
        if !metadata.is_file() {
            return Err(io::Error::other("is not a regular file"));
        }
        Ok(Self {
            path: path.to_owned(),
            bytes: metadata.len(),
            object: None,
        })
    }

    /// The path of the file, or the address of the object without its secrets.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The length in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Whether every request takes time, so that what will be read should be known beforehand.
    pub(crate) fn is_remote(&self) -> bool {
        self.object.is_some()
    }

    /// Opens the source at its first byte. Of `ranges`, in the order in which they will be read, an object is read
    /// ahead; other bytes of it are read when they are asked for.
    ///
    /// # Errors
    ///
    /// If a file cannot be opened (any more).
    pub(crate) fn open(&self, ranges: &[Range<u64>]) -> io::Result<SourceReader> {
        Ok(match &self.object {
            Some(object) => SourceReader::Object(ObjectReader::open(object, ranges)?),
            None => SourceReader::File(File::open(&self.path)?),
        })
    }

    /// Begins to read `ranges`, which will soon be opened, as far as they are read ahead. Does nothing for a file.
    pub(crate) fn prefetch(&self, ranges: &[Range<u64>]) {
        if let Some(object) = &self.object {
            object.prefetch(ranges);
        }
    }

    /// Forgets what was read of an object at scattered places, which takes up to 180 kB. It is read again if it is asked for.
    pub(crate) fn forget_pieces(&self) {
        if let Some(object) = &self.object {
            object.forget_pieces();
        }
    }

    /// Expects all bytes to be read in about the order of the object, and computes the checksum on the way, for
    /// which at most `waiting` bytes stay in memory. Does nothing for a file.
    pub(crate) fn begin_checksum(&self, waiting: u64) {
        if let Some(object) = &self.object {
            object.begin_checksum(waiting);
        }
    }

    /// The SHA-256 of all bytes in hexadecimal digits. Bytes of an object that were read since
    /// [`begin_checksum`](Self::begin_checksum) are not read again.
    ///
    /// # Errors
    ///
    /// If the bytes cannot be read; of a file, soon after `is_stopped` becomes true.
    pub(crate) fn checksum(&self, is_stopped: &dyn Fn() -> bool) -> io::Result<String> {
        if let Some(object) = &self.object {
            return object.checksum();
        }
        checksum(&mut File::open(&self.path)?, is_stopped)
    }

    /// The identity of the object when it was found; `None` for a file.
    pub(crate) fn identity(&self) -> Option<&Identity> {
        self.object.as_ref().map(|object| object.identity())
    }

    /// Reads a `range` of an object by one request, if it is short: what is read of it later, piece by piece, is there. Returns
    /// whether it was; for a file there is nothing to do.
    ///
    /// # Errors
    ///
    /// If the bytes cannot be read.
    pub(crate) fn keep(&self, range: Range<u64>) -> io::Result<bool> {
        self.object
            .as_ref()
            .map_or(Ok(true), |object| object.keep(range))
    }

    /// Reads all of a text of at most `limit` bytes.
    ///
    /// # Errors
    ///
    /// If it is longer, no text, or cannot be read.
    pub(crate) fn text(&self, limit: u64) -> io::Result<String> {
        if self.bytes > limit {
            let problem = format!("has {} bytes; at most {limit} are read", self.bytes);
            return Err(io::Error::new(io::ErrorKind::InvalidData, problem));
        }
        let mut text = String::new();
        let everything = 0..self.bytes;
        self.open(std::slice::from_ref(&everything))?
            .take(limit)
            .read_to_string(&mut text)?;
        Ok(text)
    }
}

/// A file or an object that is being read.
#[derive(Debug)]
pub(crate) enum SourceReader {
    /// A file.
    File(File),
    /// An object.
    Object(ObjectReader),
}

impl SourceReader {
    /// Expects `range` to be read next, so that it is read ahead if it is long.
    pub(crate) fn expect(&mut self, range: Range<u64>) {
        if let Self::Object(reader) = self
            && range.end - range.start > SHORT_RANGE
        {
            reader.expect(&[range]);
        }
    }
}

impl Read for SourceReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read(buffer),
            Self::Object(reader) => reader.read(buffer),
        }
    }
}

impl Seek for SourceReader {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Self::File(file) => file.seek(to),
            Self::Object(reader) => reader.seek(to),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_directory_is_no_source_and_a_long_file_no_text() {
        let dir = tempfile::tempdir().unwrap();
        assert!(Source::find(dir.path()).is_err());
        let path = dir.path().join("text");
        std::fs::write(&path, "abc").unwrap();
        let source = Source::find(&path).unwrap();
        assert_eq!(source.text(3).unwrap(), "abc");
        assert!(source.text(2).unwrap_err().to_string().contains("3 bytes"));
    }
}
