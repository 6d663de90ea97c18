//! The coordinates of the points of a file, without their attributes.

use std::ops::Range;

use crate::{
    geometry::{Quantization, Rect, Stored},
    las::{InputFile, LasError, PointCounts, PointFilter, PointStream, RecordFormat},
    tile::{Source, SourceError, Spill, TileError},
};

/// Bytes of a bare point: x, y and z as i32, little endian, as at the beginning of every record.
pub(super) const BARE_BYTES: usize = 12;

/// The points of a part of a file.
pub(super) struct BarePoints {
    stream: PointStream,
    record_length: usize,
}

impl BarePoints {
    /// Opens a `part` of `input`, to be stored by `quantization`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read.
    pub(super) fn open(
        input: &InputFile,
        part: Range<u64>,
        quantization: Quantization,
    ) -> Result<Self, LasError> {
        let record = RecordFormat::for_inputs(std::slice::from_ref(input))?;
        let filter = PointFilter::default();
        Ok(Self {
            stream: PointStream::open(input, part, &record, quantization, &filter)?,
            record_length: record.record_length(),
        })
    }
}

impl Source for BarePoints {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        let counts = self.stream.next_batch(records)?;
        let mut end = 0;
        for offset in (0..records.len()).step_by(self.record_length) {
            records.copy_within(offset..offset + BARE_BYTES, end);
            end += BARE_BYTES;
        }
        records.truncate(end);
        Ok(counts)
    }
}

/// Gathers the points of `spill` in `rect`, sorted: points of a cell are in no order, and sums of floats depend on it.
///
/// # Errors
///
/// [`TileError`] if the spill cannot be read.
pub(super) fn gather_bare(spill: &Spill, rect: &Rect) -> Result<Vec<Stored>, TileError> {
    let mut points = Vec::new();
    spill.gather(rect, |record| points.push(Stored::of_record(record)))?;
    points.sort_unstable();
    Ok(points)
}
