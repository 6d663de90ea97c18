//! Larger than memory: the spill, the tiles, and what joins them.
//!
//! ```text
//!   scatter   every point once, to the spill of its cell
//!   plan      true counts known: tiles that fit the budget
//!   gather    a tile's points, halo included, from the spill
//!   solved    what a tile leaves behind: the checkpoint
//!   stitch    tiles into one cloud, by identity
//! ```
//!
//! The only place with temporary files. Records are opaque here but for their
//! first twelve bytes: x, y, z as stored, little endian.

mod counted;
mod gather;
mod growing;
mod pack;
mod scatter;
mod settled;
mod solved;
mod spill;
mod spilling;
mod stitch;
mod whole;

pub(crate) use crate::tiling::{CellGrid, CellKey, Plan, PlanOptions, Square, Tile};
pub(crate) use pack::BlockFile;
pub use scatter::{Opener, ScatterOptions, Source, SourceError, scatter};
pub(crate) use settled::SettledTiles;
pub use solved::SolvedSite;
pub(crate) use solved::SolvedTile;
pub use spill::Spill;
pub(crate) use spilling::SpillWriter;
pub use stitch::{NeighborSites, SeamTally, blend};
pub(crate) use whole::{read_checksummed, write_checksummed};

use std::{io, path::Path};

/// Points of a source, as far as it was read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PointCounts {
    /// Points read.
    pub read: u64,
    /// Of those, points out of the range of the run's quantization, left out.
    pub rejected: u64,
    /// Of those, points that were not asked for, left out.
    pub filtered: u64,
    /// Of those, points outside of the bounds that the header claims: some
    /// damage passes the decoder unseen, and shows here.
    pub outside: u64,
}

impl PointCounts {
    /// Adds those of another part.
    pub(crate) fn add(&mut self, other: &Self) {
        self.read += other.read;
        self.rejected += other.rejected;
        self.filtered += other.filtered;
        self.outside += other.outside;
    }
}

/// What goes wrong with temporary files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TileError {
    /// A file could not be read or written.
    #[error("cannot {action} {path}: {source}{}", remedy(source))]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: String,
        /// Why it failed.
        source: io::Error,
    },
    /// A temporary file is not what was written.
    #[error("{path} is damaged or of another version; give --restart to begin anew")]
    Damaged {
        /// The file.
        path: String,
    },
    /// Sources of points failed: which, and why.
    #[error("{}", .0.iter().map(|(_, why)| why.to_string()).collect::<Vec<_>>().join("\n"))]
    Sources(Vec<(usize, SourceError)>),
    /// The user asked to stop.
    #[error("stopped; the same command goes on from here")]
    Cancelled,
}

fn remedy(source: &io::Error) -> &'static str {
    match source.kind() {
        io::ErrorKind::StorageFull => {
            "; free some space, or put the job on another disk with --job"
        }
        io::ErrorKind::PermissionDenied => "; choose a place you may write to with --job",
        _ => "",
    }
}

impl TileError {
    pub(crate) fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io {
            action,
            path: path.display().to_string(),
            source,
        }
    }

    fn damaged(path: &Path) -> Self {
        Self::Damaged {
            path: path.display().to_string(),
        }
    }
}
