//! Points of two clouds in one spill, each with a mark of its cloud.
//!
//! ```text
//!   x, y, z   3 × i32, little endian
//!   mark      u8: 0 for the measured cloud, 1 for the scans it is compared with
//! ```

use crate::{
    geometry::{Quantization, Rect, Stored},
    las::{InputFile, PointCounts, PointFilter, PointStream, RecordFormat},
    tile::{Source, SourceError, Spill, TileError},
};

/// Bytes of the coordinates at the beginning of every record.
const COORDINATE_BYTES: usize = 12;
/// Bytes of a marked point.
pub(super) const MARKED_BYTES: usize = COORDINATE_BYTES + 1;

/// The cloud to which a point belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// The cloud that is measured.
    Cloud,
    /// The scans with which it is compared.
    Scan,
}

impl Mark {
    /// The mark of a marked point.
    pub(super) fn of_record(record: &[u8]) -> Self {
        if record[COORDINATE_BYTES] == 0 {
            Self::Cloud
        } else {
            Self::Scan
        }
    }

    fn byte(self) -> u8 {
        u8::from(self == Self::Scan)
    }
}

/// The points of a file, each with the same mark.
pub(super) struct MarkedPoints {
    stream: PointStream,
    record_length: usize,
    mark: Mark,
}

impl MarkedPoints {
    /// Opens all points of `input`, to be stored by `quantization`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read.
    pub(super) fn open(
        input: &InputFile,
        mark: Mark,
        quantization: Quantization,
    ) -> Result<Box<dyn Source>, SourceError> {
        let record = RecordFormat::for_inputs(std::slice::from_ref(input))?;
        let (all, filter) = (0..input.points_claimed, PointFilter::default());
        Ok(Box::new(Self {
            stream: PointStream::open(input, all, &record, quantization, &filter)?,
            record_length: record.record_length(),
            mark,
        }))
    }
}

impl Source for MarkedPoints {
    fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, SourceError> {
        let counts = self.stream.next_batch(records)?;
        let mut end = 0;
        for offset in (0..records.len()).step_by(self.record_length) {
            records.copy_within(offset..offset + COORDINATE_BYTES, end);
            records[end + COORDINATE_BYTES] = self.mark.byte();
            end += MARKED_BYTES;
        }
        records.truncate(end);
        Ok(counts)
    }
}

/// Gathers the points of the measured cloud and those of the scans in `rect`, each sorted.
///
/// # Errors
///
/// [`TileError`] if the spill cannot be read.
pub(super) fn gather_marked(
    spill: &Spill,
    rect: &Rect,
) -> Result<(Vec<Stored>, Vec<Stored>), TileError> {
    let (mut cloud, mut scan) = (Vec::new(), Vec::new());
    spill.gather(rect, |record| {
        let point = Stored::of_record(record);
        match Mark::of_record(record) {
            Mark::Cloud => cloud.push(point),
            Mark::Scan => scan.push(point),
        }
    })?;
    // Points of a cell are in no order, and sums of floats depend on it.
    cloud.sort_unstable();
    scan.sort_unstable();
    Ok((cloud, scan))
}
