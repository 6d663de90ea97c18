//! Who stitches a job: one process, or all that share it.

use std::{path::Path, sync::Arc};

use crate::{
    geometry::Quantization,
    job::error::JobError,
    las::{SortedRecords, SortingSpace, Workforce},
    tile::{OneProcess, SpillSpace},
    tiling::CellGrid,
};

/// The edge of the cells by which points of the output are sorted, in spacings.
const SORTING_CELL_IN_SPACINGS: f64 = 512.0;

/// The name of the files of points that are sorted by position.
pub(crate) const SORTED: &str = "sorted";

/// How the points of the output are sorted by position.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sorting {
    pub(crate) grid: CellGrid,
    /// The length of a record, in bytes.
    pub(crate) record_length: usize,
    /// The memory for buffers, in bytes.
    pub(crate) buffer_bytes: usize,
}

impl Sorting {
    /// The sorting of records of `record_length` bytes that are `spacing` (CRS units) apart, with so much memory for buffers.
    pub(crate) fn new(
        spacing: f64,
        quantization: &Quantization,
        record_length: usize,
        buffer_bytes: usize,
    ) -> Self {
        Self {
            grid: CellGrid::new(quantization.units(SORTING_CELL_IN_SPACINGS * spacing)),
            record_length,
            buffer_bytes,
        }
    }
}

/// Reads the records of the tile with a number.
pub(crate) type ReadTile<'a> = dyn FnMut(usize) -> Result<Vec<u8>, JobError> + 'a;

/// The process or the processes that stitch a job.
pub(crate) trait Stitchers: Workforce {
    /// Itself, for work on the output.
    fn workforce(&self) -> &dyn Workforce;

    /// The directory of their temporary files.
    fn directory(&self) -> &Path;

    /// The space for the temporary files of this process, whose buffers take so many bytes.
    fn space(&self, buffer_bytes: usize) -> Arc<dyn SortingSpace> {
        Arc::new(SpillSpace {
            directory: self.directory().to_owned(),
            buffer_bytes,
        })
    }

    /// Sorts the records of the tiles 0 to `tiles` by position; `read` returns those of a tile.
    ///
    /// # Errors
    ///
    /// The errors of `read`, or if temporary files cannot be written.
    fn sort(
        &self,
        sorting: &Sorting,
        tiles: usize,
        read: &mut ReadTile<'_>,
    ) -> Result<Box<dyn SortedRecords>, JobError>;
}

impl Stitchers for OneProcess<'_> {
    fn workforce(&self) -> &dyn Workforce {
        self
    }

    fn directory(&self) -> &Path {
        &self.directory
    }

    fn sort(
        &self,
        sorting: &Sorting,
        tiles: usize,
        read: &mut ReadTile<'_>,
    ) -> Result<Box<dyn SortedRecords>, JobError> {
        let space = self.space(sorting.buffer_bytes);
        sort_in(&*space, SORTED, sorting, 0..tiles, read)
    }
}

/// Sorts the records of `tiles` in files with this `name` in `space`.
///
/// # Errors
///
/// The errors of `read`, or if temporary files cannot be written.
pub(crate) fn sort_in(
    space: &dyn SortingSpace,
    name: &str,
    sorting: &Sorting,
    mut tiles: std::ops::Range<usize>,
    read: &mut ReadTile<'_>,
) -> Result<Box<dyn SortedRecords>, JobError> {
    let sorter = space.begin(name, sorting.grid, sorting.record_length);
    let mut sorter = sorter.map_err(JobError::of_store)?;
    tiles.try_for_each(|tile| sorter.push(&read(tile)?).map_err(JobError::of_store))?;
    sorter.finish().map_err(JobError::of_store)
}
