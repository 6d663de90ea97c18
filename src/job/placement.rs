//! Where the files of a job lie, if its output is an object in a store.
//!
//! The output is written into the job directory first. When it is complete it is uploaded with the files beside it, and the
//! job directory is removed: a job that stops on the way uploads the output that it finds.
//!
//! ```text
//!   -o s3://bucket/city.laz     city.laz.job/upload/city.laz               ─► s3://bucket/city.laz
//!                               city.laz.job/upload/city.laz.report.json   ─► …
//! ```

use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::atomic::{AtomicBool, Ordering},
};

use super::{
    description::JobDescription,
    directory::{UPLOAD_DIRECTORY, default_directory},
    error::JobError,
};
use crate::{
    las::LasError,
    store::{Destination, is_remote, without_secrets},
};

/// Where the files of a job lie.
pub(crate) struct Placement {
    /// The job directory.
    pub(crate) dir: PathBuf,
    /// The output, as a file.
    pub(crate) output: PathBuf,
    /// The address of the output, if it is an object.
    pub(crate) destination: Option<PathBuf>,
}

impl Placement {
    /// The places of a job that writes `output`, with its files in `dir`, or where they usually are.
    pub(crate) fn of(output: &Path, dir: Option<&Path>) -> Self {
        let dir = dir.map(Path::to_owned);
        if !is_remote(output) {
            return Self {
                dir: dir.unwrap_or_else(|| default_directory(output)),
                output: output.to_owned(),
                destination: None,
            };
        }
        let name = without_secrets(output)
            .file_name()
            .map(PathBuf::from)
            .unwrap_or_default();
        let dir = dir.unwrap_or_else(|| default_directory(&name));
        Self {
            output: dir.join(UPLOAD_DIRECTORY).join(name),
            dir,
            destination: Some(output.to_owned()),
        }
    }
}

impl JobDescription {
    /// The name of the output as it is shown: the path of a file, or the address of an object.
    pub(crate) fn shown_output(&self) -> PathBuf {
        self.destination
            .as_deref()
            .map_or_else(|| self.output.clone(), without_secrets)
    }

    /// Checks that the store of the output can be reached, and that the object does not exist or may be replaced.
    ///
    /// # Errors
    ///
    /// [`JobError::Las`] if not.
    pub(super) fn check_destination(&self) -> Result<(), JobError> {
        let Some(address) = &self.destination else {
            return Ok(());
        };
        let exists = Destination::of(address).and_then(|destination| destination.exists());
        match exists {
            Ok(true) if !self.overwrite => Err(LasError::new(
                address,
                "exists already; give another name, or --overwrite",
            )
            .into()),
            Ok(_) => Ok(()),
            // Who may write may not be allowed to ask.
            Err(error) if self.overwrite && error.kind() == io::ErrorKind::PermissionDenied => {
                Ok(())
            }
            Err(error) => Err(LasError::new(address, error.to_string()).into()),
        }
    }

    /// Uploads the output and the files beside it, if it is an object: the output last.
    ///
    /// # Errors
    ///
    /// [`JobError::Io`] if the store does not take a file. There is no part of it then, and the same job goes on with the
    /// upload.
    pub(super) fn upload(&self, cancel: &AtomicBool) -> Result<(), JobError> {
        let Some(address) = &self.destination else {
            return Ok(());
        };
        let upload = self.dir.join(UPLOAD_DIRECTORY);
        let mut files = Vec::new();
        collect_files(&upload, &mut files).map_err(|e| JobError::io("read", &upload, e))?;
        files.sort_by_key(|file| (*file == self.output, file.clone()));
        for file in &files {
            let beside = file.strip_prefix(&upload).unwrap_or(file);
            let object = match *file == self.output {
                true => address.clone(),
                false => without_secrets(address).with_file_name(beside),
            };
            Destination::of(&object)
                .and_then(|object| object.upload(file, &|| cancel.load(Ordering::Relaxed)))
                .map_err(|e| JobError::io("upload", &object, e))?;
        }
        Ok(())
    }
}

/// Adds all files in `directory`, at any depth, to `files`.
fn collect_files(directory: &Path, files: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        match path.is_dir() {
            true => collect_files(&path, files)?,
            false => files.push(path),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_object_is_written_into_the_job_directory_first() {
        let placed = Placement::of(Path::new("s3://bucket/city/a.copc.laz"), None);
        assert_eq!(placed.dir, Path::new("a.copc.laz.job"));
        assert_eq!(placed.output, Path::new("a.copc.laz.job/upload/a.copc.laz"));
        assert_eq!(
            placed.destination.as_deref(),
            Some(Path::new("s3://bucket/city/a.copc.laz"))
        );
        let placed = Placement::of(Path::new("out/a.laz"), Some(Path::new("work")));
        assert_eq!(
            (placed.dir, placed.output),
            ("work".into(), "out/a.laz".into())
        );
        assert_eq!(placed.destination, None);
    }
}
