//! Everything that may be larger than memory, and then lies in temporary files: the spill of the
//! points, the solved tiles, and what joins them.
//!
//! ```text
//!   scatter      each point is added once to the spill, to those of its cell, and thinned there
//!   gather       the points of a tile, halo included, are read back from the spill
//!   solved tile  what solving a tile leaves behind: its checkpoint
//!   stitch       the tiles are joined to one cloud, by the identity of their sites
//! ```
//!
//! Records are opaque in this module except for their first twelve bytes: x, y and z as stored,
//! little endian. Files that are written at once are complete or absent ([`checksummed_file`]);
//! files that grow keep what was complete before a crash ([`block_file`], [`spill_index`]).

mod batch;
mod block_file;
mod cell_points;
mod checksummed_file;
mod chunk_table;
mod counted;
mod error;
mod gather;
mod kept_blocks;
mod number_reader;
mod one_process;
mod scatter;
mod settled_tiles;
mod solved_tile;
mod source;
mod spacing_rules;
mod spill;
mod spill_appender;
mod spill_index;
mod spill_sorting;
mod spill_writer;
mod stitch;
mod storage;
#[cfg(test)]
mod tests;
mod voxel_batch;

pub(crate) use block_file::BlockFile;
pub(crate) use cell_points::Spilled;
pub(crate) use checksummed_file::{read_checksummed, write_aside, write_checksummed};
pub(crate) use error::BEGIN_ANEW;
pub use error::TileError;
pub(crate) use kept_blocks::{KeptBlocks, add_piece};
pub(crate) use one_process::OneProcess;
pub(crate) use scatter::scatter_into;
pub use scatter::{ScatterOptions, scatter};
pub(crate) use settled_tiles::SettledTiles;
pub use solved_tile::SolvedSite;
pub(crate) use solved_tile::{SolvedCore, SolvedTile, band_from_bytes};
pub use source::{Opener, Source, SourceError};
pub(crate) use spacing_rules::SpacingRules;
pub use spill::Spill;
pub(crate) use spill_sorting::SpillSpace;
pub use stitch::{NeighborSites, SeamTally, blend};
pub(crate) use storage::Storage;
