//! The reader of LAS, and of LAZ whose chunks are alike.

use std::ops::Range;

use ::las::{LazParallelism, Reader, ReaderOptions};

use super::guard::{GuardedFile, guarded};
use crate::{las::error::LasError, store::Source};

/// Opens the LAS or LAZ file `source`, of which `ranges` will be read.
///
/// # Errors
///
/// If the file cannot be opened, or is damaged.
pub(super) fn open_las(source: &Source, ranges: &[Range<u64>]) -> Result<Reader, LasError> {
    let path = source.path();
    let file = source
        .open(ranges)
        .map_err(|e| LasError::unreadable(path, e))?;
    // Parts of files are decoded in parallel, by a reader each: the parallel
    // decoder needs memory for whole chunks, and some files are a single one.
    let options = ReaderOptions::default().with_laz_parallelism(LazParallelism::No);
    let open = || Reader::with_options(GuardedFile::new(file)?, options);
    match guarded(open) {
        Some(Ok(reader)) => Ok(reader),
        Some(Err(error)) => Err(LasError::new(
            path,
            format!("cannot be opened: {error}; the file is damaged or truncated"),
        )),
        None => Err(LasError::new(path, "cannot be opened: the file is damaged")),
    }
}

/// Moves `reader` to the point of this index, and returns whether that is possible.
pub(super) fn seek_to_point(reader: &mut Reader, index: u64) -> bool {
    matches!(guarded(|| reader.seek(index)), Some(Ok(())))
}

/// Reads over the next `points` points, `batch_points` at a time, and returns whether there
/// are that many.
pub(super) fn skip_points(reader: &mut Reader, points: u64, batch_points: u64) -> bool {
    let mut left = points;
    while left > 0 {
        let read = guarded(|| reader.read_points(left.min(batch_points)));
        match read {
            Some(Ok(batch)) if !batch.is_empty() => left -= batch.len() as u64,
            _ => return false,
        }
    }
    true
}
