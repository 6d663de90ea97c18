//! Blocks of bytes in one file, each found by its key, so that thousands of tiles need one file.
//!
//! ```text
//!   magic, key, length, checksum of the content    4 × u64
//!   content
//!   … the next block
//! ```
//!
//! Blocks are only appended; of two blocks with one key the later is valid. An incomplete block
//! that a killed process has left at the end is cut off when the file is opened again.

use std::{
    collections::HashMap,
    fs::File,
    io::{self, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use super::{checksummed_file::checksum, error::TileError};

const MAGIC: u64 = u64::from_le_bytes(*b"llblock1");
const HEADER_BYTES: u64 = 32;

/// A file of blocks.
#[derive(Debug)]
pub(crate) struct BlockFile {
    path: PathBuf,
    /// The file, open to append blocks; `None` if it is read only. Readers open it anew.
    file: Option<File>,
    /// The blocks by their keys.
    blocks: HashMap<u64, Block>,
    /// The end of the last complete block, in bytes from the beginning of the file.
    end: u64,
}

/// The position of a block in its file.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// The offset of the content, in bytes.
    offset: u64,
    /// The length of the content, in bytes.
    length: u64,
    checksum: u64,
}

impl BlockFile {
    /// Opens the file at `path` to append blocks, or makes it; an incomplete block at the end is
    /// cut off.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it can be neither opened nor made.
    pub(crate) fn open(path: &Path) -> Result<Self, TileError> {
        let pack = || {
            let mut file = File::options()
                .create(true)
                .truncate(false)
                .read(true)
                .write(true)
                .open(path)?;
            let pack = Self::scan(path, &mut file)?;
            file.set_len(pack.end)?;
            Ok(Self {
                file: Some(file),
                ..pack
            })
        };
        pack().map_err(|source| TileError::io("open", path, source))
    }

    /// Opens the file at `path`, which another process may be writing, to read the blocks that are
    /// complete by now.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read.
    pub(crate) fn open_for_reading(path: &Path) -> Result<Self, TileError> {
        let pack = File::open(path).and_then(|mut file| Self::scan(path, &mut file));
        pack.map_err(|source| TileError::io("open", path, source))
    }

    /// Finds the complete blocks in `file`.
    fn scan(path: &Path, file: &mut File) -> io::Result<Self> {
        let length = file.metadata()?.len();
        let (mut blocks, mut end, mut last) = (HashMap::new(), 0, None);
        while let Some((key, block)) = block_at(file, end, length)? {
            end = block.offset + block.length;
            last = Some((key, block, blocks.insert(key, block)));
        }
        // The block that says that others are there was begun when those were on the disk. It may have its length and not its
        // content if it is the last.
        if let Some((key, block, before)) = last
            && content(file, block)?.is_none()
        {
            end = block.offset - HEADER_BYTES;
            match before {
                Some(before) => blocks.insert(key, before),
                None => blocks.remove(&key),
            };
        }
        Ok(Self {
            path: path.to_owned(),
            file: None,
            blocks,
            end,
        })
    }

    /// Makes an empty file at `path`, in the place of an existing one.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be made.
    pub(crate) fn create(path: &Path) -> Result<Self, TileError> {
        File::create(path).map_err(|source| TileError::io("create", path, source))?;
        Self::open(path)
    }

    /// The path of the file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file contains a block with this key.
    pub(crate) fn contains(&self, key: u64) -> bool {
        self.blocks.contains_key(&key)
    }

    /// The length of the complete blocks, in bytes.
    #[cfg(test)]
    pub(crate) fn bytes(&self) -> u64 {
        self.end
    }

    /// Appends blocks, given as keys and contents.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if they cannot be written; the blocks before them are unchanged.
    pub(crate) fn append(&mut self, blocks: &[(u64, &[u8])]) -> Result<(), TileError> {
        let mut end = self.end;
        let mut write = || -> io::Result<Vec<(u64, Block)>> {
            let file = self.file.as_mut().ok_or_else(read_only)?;
            file.seek(SeekFrom::Start(end))?;
            let mut written = Vec::new();
            for &(key, content) in blocks {
                let block = Block {
                    offset: end + HEADER_BYTES,
                    length: content.len() as u64,
                    checksum: checksum(content),
                };
                let numbers = [MAGIC, key, block.length, block.checksum];
                file.write_all(&numbers.map(u64::to_le_bytes).concat())?;
                file.write_all(content)?;
                end = block.offset + block.length;
                written.push((key, block));
            }
            Ok(written)
        };
        let written = write().map_err(|source| TileError::io("write to", &self.path, source))?;
        self.blocks.extend(written);
        self.end = end;
        Ok(())
    }

    /// Waits until the disk has all blocks.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if they cannot be written.
    pub(crate) fn flush(&self) -> Result<(), TileError> {
        let file = self.file.as_ref().ok_or_else(read_only);
        file.and_then(File::sync_data)
            .map_err(|source| TileError::io("flush", &self.path, source))
    }

    /// Reads the content of the block with this key.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read, [`TileError::Damaged`] if there is no such block
    /// or its content is not what was written.
    pub(crate) fn read(&self, key: u64) -> Result<Vec<u8>, TileError> {
        let damaged = || TileError::damaged(&self.path);
        let block = *self.blocks.get(&key).ok_or_else(damaged)?;
        match self.content(block) {
            Ok(content) if checksum(&content) == block.checksum => Ok(content),
            Ok(_) => Err(damaged()),
            Err(source) => Err(TileError::unreadable(&self.path, source)),
        }
    }

    /// Reads the content of `block` without checking it. The file is opened again, because the
    /// position of `self.file` belongs to the writer.
    fn content(&self, block: Block) -> io::Result<Vec<u8>> {
        let mut file = File::open(&self.path)?;
        let mut content = vec![0; block.length as usize];
        file.seek(SeekFrom::Start(block.offset))?;
        file.read_exact(&mut content)?;
        Ok(content)
    }
}

/// The error of a file that is not open to append blocks.
fn read_only() -> io::Error {
    io::Error::new(io::ErrorKind::PermissionDenied, "it is open to be read")
}

/// Reads the header at `offset` in a file of `length` bytes; `None` if no complete block begins
/// there.
fn block_at(file: &mut File, offset: u64, length: u64) -> io::Result<Option<(u64, Block)>> {
    let Some(left) = length.checked_sub(offset + HEADER_BYTES) else {
        return Ok(None);
    };
    let mut header = [0; HEADER_BYTES as usize];
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(&mut header)?;
    let mut words = header.chunks_exact(8).map(|word| {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(word);
        u64::from_le_bytes(bytes)
    });
    let [magic, key, content_length, checksum] = std::array::from_fn(|_| words.next().unwrap_or(0));
    let block = Block {
        offset: offset + HEADER_BYTES,
        length: content_length,
        checksum,
    };
    Ok((magic == MAGIC && content_length <= left).then_some((key, block)))
}

/// Reads the content of `block`; `None` if it is not what was written.
fn content(file: &mut File, block: Block) -> io::Result<Option<Vec<u8>>> {
    let mut content = Vec::new();
    file.seek(SeekFrom::Start(block.offset))?;
    file.take(block.length).read_to_end(&mut content)?;
    let is_complete = content.len() as u64 == block.length && checksum(&content) == block.checksum;
    Ok(is_complete.then_some(content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_found_again_and_the_later_of_two_is_valid() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("file");
        let mut file = BlockFile::open(&path).unwrap();
        file.append(&[(7, b"seven"), (1, b"")]).unwrap();
        file.append(&[(7, b"seven again")]).unwrap();
        file.flush().unwrap();
        let again = BlockFile::open(&path).unwrap();
        for file in [&file, &again] {
            assert_eq!(file.read(7).unwrap(), b"seven again");
            assert_eq!(file.read(1).unwrap(), b"");
            assert!(!file.contains(2));
            assert!(file.read(2).unwrap_err().to_string().contains("file"));
        }
        assert_eq!(again.bytes(), std::fs::metadata(&path).unwrap().len());
        assert_eq!(BlockFile::create(&path).unwrap().bytes(), 0);
    }

    #[test]
    fn other_processes_read_the_complete_blocks() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("file");
        let mut own = BlockFile::open(&path).unwrap();
        own.append(&[(1, b"one"), (2, b"two")]).unwrap();
        let complete = own.bytes();
        own.append(&[(3, b"three")]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 2]).unwrap();
        let other = BlockFile::open_for_reading(&path).unwrap();
        assert!(other.contains(2) && !other.contains(3));
        assert_eq!(other.bytes(), complete);
        // An incomplete block may be complete a moment later: it is not cut off.
        assert_eq!(std::fs::read(&path).unwrap().len(), bytes.len() - 2);
        assert_eq!(other.read(2).unwrap(), b"two");
    }

    /// The file is cut at every byte of the last block, and every byte of it is changed.
    #[test]
    fn an_incomplete_last_block_is_cut_off_and_written_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("file");
        let mut file = BlockFile::open(&path).unwrap();
        file.append(&[(1, b"one"), (2, b"two")]).unwrap();
        let before = file.bytes() as usize;
        file.append(&[(2, b"two, once more")]).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let mut torn: Vec<Vec<u8>> = (before..bytes.len())
            .map(|at| bytes[..at].to_vec())
            .collect();
        for at in before..bytes.len() {
            // The key is in no checksum: a block under another key does no harm.
            if !(before + 8..before + 16).contains(&at) {
                let mut zeroed = bytes.clone();
                zeroed[at] ^= 0x41;
                torn.push(zeroed);
            }
        }
        for content in torn {
            std::fs::write(&path, content).unwrap();
            let mut file = BlockFile::open(&path).unwrap();
            assert_eq!(file.read(2).unwrap(), b"two");
            assert_eq!(file.bytes() as usize, before);
            file.append(&[(3, b"three")]).unwrap();
            assert_eq!(BlockFile::open(&path).unwrap().read(3).unwrap(), b"three");
        }
        // A changed byte in the middle is reported when its block is read.
        let mut rotten = bytes;
        rotten[33] ^= 1;
        std::fs::write(&path, rotten).unwrap();
        let file = BlockFile::open(&path).unwrap();
        assert!(file.read(1).unwrap_err().to_string().contains("damaged"));
        assert_eq!(file.read(2).unwrap(), b"two, once more");
    }
}
