//! The only place that knows LAS, LAZ, COPC and PLY.
//!
//! Inputs of any version (1.0 to 1.4) and format (0 to 10), and polygon files, become records of
//! the run's one format (6, 7 or 8, with the union of the extra bytes) on the
//! run's one lattice, the moment they are decoded; from there on a record is
//! copied whole, so that no attribute can be lost on the way.

mod chunks;
mod copc;
mod crs;
mod decoding;
#[cfg(feature = "e57")]
mod e57;
mod filter;
mod format;
mod guard;
mod header;
mod headerless;
mod inputs;
mod octree;
mod ply;
mod ply_writing;
mod reading;
mod record;
mod tiled;
mod writing;

pub(crate) use ::las::Vlr;
pub(crate) use crs::Crs;
pub(crate) use filter::{Ground, PointFilter};
pub(crate) use format::record::{AveragedField, RealAttribute, RecordView, standard_length};
pub(crate) use guard::is_decoding;
pub(crate) use inputs::expand_inputs;
pub use ply::PlyFile;
pub use ply::PlyStream;
pub(crate) use reading::{InputFile, PointStream};
pub(crate) use record::DisplayAttributes;
pub(crate) use record::{ExtraByte, RecordFormat};
pub(crate) use writing::{CloudHeader, CloudWriter, CompleteCloud, Format, Workspace};

use std::path::Path;

/// What goes wrong with scans. Every message begins with the file.
#[derive(Debug, thiserror::Error)]
#[error("{path}: {problem}")]
pub struct LasError {
    /// The file.
    pub(crate) path: String,
    /// What is wrong, with the numbers, and what to do.
    pub(crate) problem: String,
}

impl LasError {
    pub(crate) fn new(path: &Path, problem: impl Into<String>) -> Self {
        Self {
            path: path.display().to_string(),
            problem: problem.into(),
        }
    }
}
