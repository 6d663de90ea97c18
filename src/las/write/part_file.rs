//! An output under its preliminary name: it gets its final name when it is complete, or is
//! removed.

use std::{
    ffi::OsString,
    fs::File,
    io,
    path::{Path, PathBuf},
};

use crate::las::error::LasError;

/// A file or directory under a preliminary name; removed when dropped, unless it was
/// delivered.
#[derive(Debug)]
pub(super) struct PartFile {
    /// The final path.
    path: PathBuf,
    /// The preliminary path, in the same directory.
    part: PathBuf,
    is_delivered: bool,
}

impl PartFile {
    /// Makes an empty file that is to become `path`.
    ///
    /// # Errors
    ///
    /// If no file can be made there.
    pub(super) fn create_file(path: &Path) -> Result<(Self, File), LasError> {
        let part = Self::named(path)?;
        let file = File::create(&part.part).map_err(|e| LasError::unwritable(path, e))?;
        Ok((part, file))
    }

    /// Makes an empty directory that is to become `path`; one of an earlier run is replaced.
    ///
    /// # Errors
    ///
    /// If no directory can be made there.
    pub(super) fn create_directory(path: &Path) -> Result<Self, LasError> {
        let part = Self::named(path)?;
        drop(std::fs::remove_dir_all(&part.part));
        std::fs::create_dir(&part.part).map_err(|e| LasError::unwritable(path, e))?;
        Ok(part)
    }

    fn named(path: &Path) -> Result<Self, LasError> {
        let name = path
            .file_name()
            .ok_or_else(|| LasError::unwritable(path, "it has no name"))?;
        let mut part = OsString::from(".");
        part.push(name);
        part.push(".part");
        Ok(Self {
            path: path.to_owned(),
            part: path.with_file_name(part),
            is_delivered: false,
        })
    }

    /// The final path.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The preliminary path.
    pub(super) fn part(&self) -> &Path {
        &self.part
    }

    /// Gives the output its final name.
    ///
    /// # Errors
    ///
    /// If it cannot be renamed; it is removed then.
    pub(super) fn deliver(mut self) -> Result<(), LasError> {
        self.rename()
            .map_err(|e| LasError::unwritable(&self.path, e))?;
        self.is_delivered = true;
        // The name is flushed, too; where a directory cannot be, the system does it later.
        if let Some(dir) = self.path.parent()
            && let Ok(dir) = File::open(dir)
        {
            drop(dir.sync_all());
        }
        Ok(())
    }

    fn rename(&self) -> io::Result<()> {
        if !(self.part.is_dir() && self.path.is_dir()) {
            return std::fs::rename(&self.part, &self.path);
        }
        // A directory does not replace another one that is not empty.
        let old = self.part.with_extension("old");
        remove(&old);
        std::fs::rename(&self.path, &old)?;
        std::fs::rename(&self.part, &self.path)?;
        remove(&old);
        Ok(())
    }
}

impl Drop for PartFile {
    fn drop(&mut self) {
        if !self.is_delivered {
            remove(&self.part);
        }
    }
}

/// Removes a file, or a directory with all that is in it.
fn remove(path: &Path) {
    if std::fs::remove_file(path).is_err() {
        drop(std::fs::remove_dir_all(path));
    }
}
