//! The points of a part of an input, as records of the run.

use std::{ops::Range, path::PathBuf};

use super::{
    bounds::BOUNDS_TOLERANCE, counts::PointCounts, decoder::Decoder, input::InputFile,
    point_filter::PointFilter,
};
use crate::{
    geometry::Quantization,
    las::{
        error::LasError,
        format::{conversion::RecordConverter, fields::coordinates, record_format::RecordFormat},
    },
};

/// The points of a part of a file, as records of the run.
pub(crate) struct PointStream {
    path: PathBuf,
    decoder: Decoder,
    /// The length of the input's records, in bytes.
    record_length: usize,
    converter: RecordConverter,
    filter: PointFilter,
    /// The points of the part, by index.
    part: Range<u64>,
    /// The number of points that the file claims.
    claimed: u64,
    /// The number of points read so far.
    read: u64,
    /// The number of points that are read at a time.
    batch_points: u64,
    /// The bounds of the input, in its own stored units: min, max.
    bounds: [[f64; 3]; 2],
}

impl PointStream {
    /// Opens a `part` of `input`, to be read as records like `record` on `quantization` where
    /// `filter` accepts the point.
    ///
    /// # Errors
    ///
    /// If the file cannot be opened (any more), or has no such part.
    pub(crate) fn open(
        input: &InputFile,
        part: Range<u64>,
        record: &RecordFormat,
        quantization: Quantization,
        filter: &PointFilter,
    ) -> Result<Self, LasError> {
        Ok(Self {
            path: input.path.clone(),
            decoder: Decoder::open(input, &part)?,
            record_length: input.format.len().into(),
            converter: RecordConverter::new(&input.layout(), record, quantization)
                .with_reprojection(input.reprojection()),
            filter: filter.clone(),
            part,
            claimed: input.points_claimed,
            read: 0,
            batch_points: input.batch_points(),
            bounds: input.surveyed_bounds().map(|corner| {
                [0, 1, 2].map(|axis| (corner[axis] - input.offset[axis]) / input.scale[axis])
            }),
        })
    }

    /// Replaces `records` by the next ones, and returns the counts of the points that were
    /// read for them, rejected ones included; all counts are zero at the end.
    ///
    /// # Errors
    ///
    /// If the file ends early or cannot be decoded.
    pub(crate) fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, LasError> {
        records.clear();
        let mut counts = PointCounts::default();
        let wanted = self
            .batch_points
            .min(self.part.end - self.part.start - self.read);
        if wanted == 0 {
            return Ok(counts);
        }
        let read = match self.decoder.fill(wanted) {
            Ok(read) if read > 0 => read,
            Ok(_) => return Err(self.broken("no more points")),
            Err(why) => return Err(self.broken(&why)),
        };
        let is_filtered = !self.filter.is_empty();
        for raw in self.decoder.raw().chunks_exact(self.record_length) {
            let start = records.len();
            match self.converter.convert(raw, records) {
                None => counts.rejected += 1,
                Some(world) if is_filtered && !self.filter.accepts(&records[start..], &world) => {
                    records.truncate(start);
                    counts.filtered += 1;
                }
                Some(_) => {}
            }
            counts.outside += u64::from(!is_within(raw, &self.bounds));
        }
        counts.read = read;
        self.read += read;
        Ok(counts)
    }

    fn broken(&self, why: &str) -> LasError {
        LasError::new(
            &self.path,
            format!(
                "is truncated or damaged after point {} of {}: {why}",
                self.part.start + self.read,
                self.claimed
            ),
        )
    }
}

/// Whether the point of the input's record `raw` lies within `bounds`, up to rounding.
fn is_within(raw: &[u8], bounds: &[[f64; 3]; 2]) -> bool {
    let [min, max] = bounds;
    coordinates(raw).into_iter().enumerate().all(|(axis, c)| {
        (min[axis] - BOUNDS_TOLERANCE..=max[axis] + BOUNDS_TOLERANCE).contains(&f64::from(c))
    })
}
