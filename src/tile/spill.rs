//! The spill: every point of the input, by cell, and how to open it. A spill that several
//! processes have filled consists of several pairs of files, which are read as one.

use std::{
    collections::BTreeMap,
    fs::File,
    path::{Path, PathBuf},
    sync::Arc,
};

use rayon::prelude::*;

use super::{
    cell_points::CellPoints,
    chunk_table::ChunkTable,
    error::TileError,
    spacing_rules::SpacingRules,
    spill_index::{SpillIndex, index_path, spill_path},
};
use crate::{
    las::PointCounts,
    lloyd::Thinning,
    tiling::{Bounds, CellGrid, CellKey, SQUARES_PER_CELL_EDGE},
};

/// A complete spill. Its points lie in memory, in one file, or in several files of different sources.
#[derive(Debug)]
pub struct Spill {
    pub(super) place: Place,
    /// The joined index of all files.
    pub(super) index: SpillIndex,
    points: u64,
    /// The rules for the spacing at the points of the spill; `None` if it is the same everywhere.
    rules: Option<Arc<dyn SpacingRules>>,
    /// The thinning that leaves the points of each cell as they are, because it has thinned them; `None` if none is known.
    thinned_by: Option<Thinning>,
}

/// Where the points of a spill lie.
#[derive(Debug)]
pub(super) enum Place {
    /// In memory, by cell.
    Memory(BTreeMap<CellKey, CellPoints>),
    /// In these files.
    Files(Vec<SpillFile>),
}

/// A file of a spill.
#[derive(Debug)]
pub(super) struct SpillFile {
    pub(super) path: PathBuf,
    pub(super) chunks: ChunkTable,
}

impl Spill {
    /// Whether there is a complete spill at `stem`, the path of its files without their
    /// extensions.
    pub(crate) fn is_complete(stem: &Path) -> bool {
        index_path(stem).exists()
    }

    /// Opens the spill at `stem`.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if it cannot be read, [`TileError::Damaged`] if index or records are not
    /// what was written.
    pub fn open(stem: &Path) -> Result<Self, TileError> {
        Self::join(&[stem.to_owned()])
    }

    /// Opens the spills at `stems` as one, as if their sources had been scattered together in this
    /// order.
    ///
    /// # Errors
    ///
    /// [`TileError::Io`] if one of them cannot be read; [`TileError::Damaged`] if one is not what
    /// was written, if they were not begun with the same grid, or if `stems` is empty.
    pub(crate) fn join(stems: &[PathBuf]) -> Result<Self, TileError> {
        let mut joined: Option<SpillIndex> = None;
        let mut files = Vec::with_capacity(stems.len());
        for stem in stems {
            let (index, file) = Self::open_file(stem)?;
            files.push(file);
            joined = Some(match joined {
                None => index,
                Some(before) => before
                    .join(index)
                    .ok_or_else(|| TileError::damaged(&index_path(stem)))?,
            });
        }
        let index = joined.ok_or_else(|| TileError::damaged(Path::new("the spill")))?;
        Ok(Self::of(Place::Files(files), index))
    }

    /// A spill in memory: the points of each cell, which are `thinned_by` a thinning if there is one.
    pub(super) fn in_memory(
        cells: BTreeMap<CellKey, CellPoints>,
        index: SpillIndex,
        thinned_by: Option<Thinning>,
    ) -> Self {
        Self {
            thinned_by,
            ..Self::of(Place::Memory(cells), index)
        }
    }

    fn of(place: Place, index: SpillIndex) -> Self {
        let squares = index.counts.values().flat_map(|squares| squares.iter());
        Self {
            points: squares.sum(),
            place,
            index,
            rules: None,
            thinned_by: None,
        }
    }

    /// Makes `rules` those for the spacing at the points of the spill.
    pub(crate) fn set_rules(&mut self, rules: Option<Arc<dyn SpacingRules>>) {
        self.rules = rules;
    }

    /// The rules for the spacing at the points of the spill; `None` if it is the same everywhere.
    pub(super) fn rules(&self) -> Option<&dyn SpacingRules> {
        self.rules.as_deref()
    }

    /// Reads the index of the spill at `stem`, and checks the length of its records.
    fn open_file(stem: &Path) -> Result<(SpillIndex, SpillFile), TileError> {
        let index_path = index_path(stem);
        let (index, chunks) =
            SpillIndex::read(&index_path)?.ok_or_else(|| TileError::damaged(&index_path))?;
        let path = spill_path(stem);
        // The file is opened, because a network file system may know the length by the name only
        // as it was a minute ago.
        let length = File::open(&path).and_then(|file| file.metadata());
        let length = length.map_err(|source| TileError::io("read", &path, source))?;
        match length.len() == index.bytes {
            true => Ok((index, SpillFile { path, chunks })),
            false => Err(TileError::damaged(&path)),
        }
    }

    /// Thins the points that lie in memory.
    pub(crate) fn thin(&mut self, thinning: &Thinning) {
        let record_length = self.record_length();
        if let Place::Memory(cells) = &mut self.place {
            cells.par_iter_mut().for_each(|(_, points)| {
                points.thin(record_length, thinning);
                points.records.shrink_to_fit();
            });
            self.thinned_by = Some(*thinning);
        }
    }

    /// Whether the points of each cell have been thinned by `thinning`.
    pub(super) fn is_thinned_by(&self, thinning: &Thinning) -> bool {
        self.thinned_by.as_ref() == Some(thinning)
    }

    /// Removes the files of the spill, as far as the operating system permits.
    pub(crate) fn remove(self) {
        let Place::Files(files) = self.place else {
            return;
        };
        for SpillFile { path, .. } in files {
            drop(std::fs::remove_file(path.with_extension("index")));
            drop(std::fs::remove_file(path));
        }
    }

    /// The number of points.
    pub(crate) fn points(&self) -> u64 {
        self.points
    }

    /// The number of values that are kept: records, and sums of points without records.
    pub(crate) fn values(&self) -> u64 {
        match &self.place {
            Place::Memory(cells) => {
                let length = self.record_length() as u64;
                let values =
                    |cell: &CellPoints| cell.records.len() as u64 / length + cell.sums.len() as u64;
                cells.values().map(values).sum()
            }
            Place::Files(_) => self.index.values,
        }
    }

    /// The occupied cells.
    pub(crate) fn cells(&self) -> impl Iterator<Item = CellKey> + '_ {
        self.index.counts.keys().copied()
    }

    /// The true bounds of the points.
    pub(crate) fn bounds(&self) -> Bounds {
        self.index.bounds
    }

    /// The length of a record, in bytes.
    pub(crate) fn record_length(&self) -> usize {
        self.index.record_length
    }

    /// The grid by whose cells the points lie in chunks.
    pub(crate) fn grid(&self) -> CellGrid {
        self.index.grid
    }

    /// The points taken from each source, in the order of the sources.
    pub(crate) fn sources(&self) -> impl Iterator<Item = PointCounts> + '_ {
        self.index.sources.iter().map(|source| source.counts)
    }

    /// The bytes of points and index on disk.
    pub(crate) fn bytes(&self) -> u64 {
        match &self.place {
            Place::Memory(_) => 0,
            Place::Files(_) => self.index.bytes + self.index.encoded_bytes(),
        }
    }

    /// The bytes of points in memory.
    pub(crate) fn resident_bytes(&self) -> u64 {
        match &self.place {
            Place::Memory(cells) => cells.values().map(|cell| cell.capacity() as u64).sum(),
            Place::Files(_) => 0,
        }
    }

    /// The occupied counting squares: the south-west corner of each in units of squares, and the
    /// number of its points. Their order depends on nothing but the points.
    pub(crate) fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_ {
        self.index.counts.iter().flat_map(|(cell, squares)| {
            let corner = [cell.column, cell.row].map(|c| i64::from(c) * SQUARES_PER_CELL_EDGE);
            (0..)
                .zip(squares.iter())
                .filter(|&(_, &count)| count > 0)
                .map(move |(square, &count): (i64, &u64)| {
                    (
                        [
                            corner[0] + square % SQUARES_PER_CELL_EDGE,
                            corner[1] + square / SQUARES_PER_CELL_EDGE,
                        ],
                        count,
                    )
                })
        })
    }
}
