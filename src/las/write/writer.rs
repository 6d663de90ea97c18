//! A cloud that is being written, whatever its format: complete under its name, or not there
//! at all.

use std::{
    fs::File,
    io::{self, Seek, SeekFrom, Write},
    path::Path,
};

use super::{cloud_levels::CloudLevels, part_file::PartFile, sink::SinkMonitor};
use crate::las::error::LasError;

/// The body of a cloud: what turns records into the bytes of a format.
pub(super) trait CloudBody {
    /// Appends `records`, in the run's format.
    ///
    /// # Errors
    ///
    /// If they cannot be written.
    fn write(&mut self, records: &[u8]) -> Result<(), LasError>;

    /// Writes everything that follows the `points` points of the cloud. Returns the bytes of the header that were not known
    /// before.
    ///
    /// # Errors
    ///
    /// If the body cannot be completed.
    fn complete(self: Box<Self>, points: u64) -> Result<Amendments, LasError>;
}

/// Bytes of a file that are overwritten when it is complete, with the offset of the first one.
pub(super) type Amendments = Vec<(u64, Vec<u8>)>;

/// A cloud that is being written under a preliminary name; nothing is left of it if it is
/// dropped.
pub(crate) struct CloudWriter {
    // Fields are dropped in this order: the sink stops, so that the body is not completed on
    // the way out, then the file is closed, then removed.
    monitor: SinkMonitor,
    body: Box<dyn CloudBody>,
    part: PartFile,
    record_length: usize,
    points: u64,
}

impl CloudWriter {
    /// A writer of records of `record_length` bytes to `part`.
    ///
    /// # Errors
    ///
    /// If the beginning of the cloud could not be written.
    pub(super) fn new(
        part: PartFile,
        monitor: SinkMonitor,
        body: Box<dyn CloudBody>,
        record_length: usize,
    ) -> Result<Self, LasError> {
        let writer = Self {
            monitor,
            body,
            part,
            record_length,
            points: 0,
        };
        check(&writer.monitor, writer.part.path())?;
        Ok(writer)
    }

    /// Appends `records`, in the run's format.
    ///
    /// # Errors
    ///
    /// If they cannot be written.
    pub(crate) fn write(&mut self, records: &[u8]) -> Result<(), LasError> {
        self.body.write(records)?;
        self.points += (records.len() / self.record_length) as u64;
        check(&self.monitor, self.part.path())
    }

    /// Completes the cloud under its preliminary name.
    ///
    /// # Errors
    ///
    /// If the cloud cannot be completed; nothing is left of it then.
    pub(crate) fn complete(self) -> Result<CompleteCloud, LasError> {
        let Self {
            part,
            body,
            monitor,
            points,
            ..
        } = self;
        let amendments = body.complete(points)?;
        check(&monitor, part.path())?;
        CompleteCloud::of_file(part, points, amendments)
    }
}

/// Reports the first failure of the sink.
fn check(monitor: &SinkMonitor, path: &Path) -> Result<(), LasError> {
    match monitor.take_failure() {
        Some(error) => Err(LasError::unwritable(
            path,
            format!("{error}; nothing is left under that name"),
        )),
        None => Ok(()),
    }
}

/// Overwrites bytes of the file at `path`, flushes it to the disk and returns its length.
fn amend(path: &Path, amendments: Amendments) -> io::Result<u64> {
    let mut file = File::options().write(true).open(path)?;
    for (offset, bytes) in amendments {
        file.seek(SeekFrom::Start(offset))?;
        file.write_all(&bytes)?;
    }
    file.sync_all()?;
    Ok(file.metadata()?.len())
}

/// A complete cloud under its preliminary name; removed unless it is delivered.
#[derive(Debug)]
pub(crate) struct CompleteCloud {
    part: PartFile,
    points: u64,
    bytes: u64,
    levels: Option<CloudLevels>,
}

impl CompleteCloud {
    /// A cloud of `points` points in the file `part`, of which these bytes are still to be overwritten.
    ///
    /// # Errors
    ///
    /// If the file cannot be completed; nothing is left of it then.
    pub(super) fn of_file(
        part: PartFile,
        points: u64,
        amendments: Amendments,
    ) -> Result<Self, LasError> {
        let bytes =
            amend(part.part(), amendments).map_err(|e| LasError::unwritable(part.path(), e))?;
        Ok(Self {
            part,
            points,
            bytes,
            levels: None,
        })
    }

    /// A cloud of `points` points in the directory `part`, whose files have so many `bytes` together.
    pub(super) fn of_directory(part: PartFile, points: u64, bytes: u64) -> Self {
        Self {
            part,
            points,
            bytes,
            levels: None,
        }
    }

    /// The cloud with these `levels`.
    pub(super) fn with_levels(self, levels: CloudLevels) -> Self {
        Self {
            levels: Some(levels),
            ..self
        }
    }

    /// The preliminary path of the cloud.
    pub(crate) fn part(&self) -> &Path {
        self.part.part()
    }

    /// The number of points.
    pub(crate) fn points(&self) -> u64 {
        self.points
    }

    /// The length of the file, or of all files of the directory, in bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The levels of the cloud, if it has any.
    pub(crate) fn levels(&self) -> Option<&CloudLevels> {
        self.levels.as_ref()
    }

    /// Gives the cloud its final name.
    ///
    /// # Errors
    ///
    /// If it cannot be renamed; nothing is left of it then.
    pub(crate) fn deliver(self) -> Result<(), LasError> {
        self.part.deliver()
    }
}
