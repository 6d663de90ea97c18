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

mod gather;
mod grid;
mod map;
mod plan;
mod scatter;
mod solved;
mod spill;
mod stitch;

pub use grid::{CellGrid, CellKey};
pub use plan::{Plan, PlanOptions, Tile};
pub use scatter::{Opener, ScatterOptions, Scattered, Source, SourceError, scatter};
pub use solved::{SolvedSite, SolvedTile, solved_path};
pub use spill::{Bounds, Spill};
pub use stitch::{Guest, SeamTally, blend};

use std::{io, path::Path};

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
    #[error("{path} is damaged or of another version; remove the job directory to start afresh")]
    Damaged {
        /// The file.
        path: String,
    },
    /// A source of points failed.
    #[error("{0}")]
    Source(SourceError),
    /// The user asked to stop.
    #[error("stopped; the same command goes on from here")]
    Cancelled,
    /// The smallest tile is too large.
    #[error(
        "a square of {edge} stored units holds, with its halo, {points} points, \
         and the memory budget allows {allowed} to a tile"
    )]
    TooDense {
        /// Edge of the square.
        edge: i64,
        /// Points in it and its halo.
        points: u64,
        /// Points allowed.
        allowed: u64,
    },
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
