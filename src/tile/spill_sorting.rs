//! Spills in which the writers of COPC and of tiles sort their points.

use std::path::PathBuf;

use super::{cell_points::Spilled, spill::Spill, spill_writer::SpillWriter};
use crate::{
    geometry::Rect,
    las::{RecordSorter, SortedRecords, SortingSpace, StoreError},
    tiling::{Bounds, CellGrid},
};

/// The place and the memory of a spill in which points are sorted.
#[derive(Clone, Debug)]
pub(crate) struct SpillSpace {
    /// The directory of the spill's files.
    pub(crate) directory: PathBuf,
    /// The memory for buffers while points are added, in bytes.
    pub(crate) buffer_bytes: usize,
}

impl SortingSpace for SpillSpace {
    fn begin(
        &self,
        name: &str,
        grid: CellGrid,
        record_length: usize,
    ) -> Result<Box<dyn RecordSorter>, StoreError> {
        let writer = SpillWriter::create(
            &self.directory.join(name),
            grid,
            record_length,
            self.buffer_bytes,
        )?;
        Ok(Box::new(writer))
    }
}

impl RecordSorter for SpillWriter {
    fn push(&mut self, records: &[u8]) -> Result<(), StoreError> {
        Ok(Self::push(self, records)?)
    }

    fn finish(self: Box<Self>) -> Result<Box<dyn SortedRecords>, StoreError> {
        Ok(Box::new(Self::finish(*self)?))
    }
}

impl SortedRecords for Spill {
    fn points(&self) -> u64 {
        Self::points(self)
    }

    fn bounds(&self) -> Bounds {
        Self::bounds(self)
    }

    fn squares(&self) -> Vec<(Rect, u64)> {
        let grid = self.grid();
        Self::squares(self)
            .map(|(square, points)| (grid.rect_of_square(square), points))
            .collect()
    }

    fn visit(&self, rect: &Rect, visit: &mut dyn FnMut(&[u8])) -> Result<(), StoreError> {
        Ok(self.gather(rect, visit)?)
    }

    fn read(&self, rect: &Rect) -> Result<Vec<u8>, StoreError> {
        let mut records = Vec::new();
        self.gather_each(
            rect,
            |found: &mut Vec<u8>, spilled| {
                if let Spilled::Record(record) = spilled {
                    found.extend(record);
                }
            },
            |found| records.extend(found),
        )?;
        Ok(records)
    }

    fn remove(self: Box<Self>) {
        Self::remove(*self);
    }
}
