//! Why a view of a result cannot be made.

use std::io;

use crate::{las::LasError, tile::TileError};

/// Why a view of a result cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// A cloud cannot be read.
    #[error(transparent)]
    Las(#[from] LasError),
    /// A temporary file cannot be read.
    #[error(transparent)]
    Tile(#[from] TileError),
    /// The pixels cannot be encoded as PNG.
    #[error("cannot encode the picture: {0}")]
    Encoding(#[source] io::Error),
    /// The clouds contain no point.
    #[error("there is no point to be drawn")]
    NoPoint,
}
