//! The only module that knows LAS, LAZ, COPC, PLY, E57 and PCD.
//!
//! Inputs of any version (1.0 to 1.4) and format (0 to 10), and files of vertices, become
//! records of the run's one format (6, 7 or 8, with the union of the extra bytes) on the
//! run's one quantization, the moment they are decoded; from there on a record is
//! copied whole, so that no attribute can be lost on the way.
//!
//! ```text
//!   read    inputs   ─► records of the run
//!   write   records  ─► LAS, LAZ, COPC, PLY, PCD, tiles
//!   format  what stands where in the bytes of files and records
//! ```

mod error;
mod format;
mod read;
mod reproject;
mod write;

pub(crate) use ::las::Vlr;
pub use error::LasError;
pub(crate) use format::{
    attribute::Attribute,
    crs::Crs,
    display::DisplayAttributes,
    fields::{AveragedField, RealAttribute, standard_length},
    record::RecordView,
    record_format::RecordFormat,
};
pub(crate) use read::{
    arguments::expand_inputs,
    guard::is_decoding,
    input::InputFile,
    line_filter::LineFilter,
    list::read_list,
    octree_nodes::OctreeLevels,
    point_filter::PointFilter,
    polygon_filter::PolygonFilter,
    stream::PointStream,
    trajectory::{Waypoint, read_trajectory},
};
pub use read::{
    counts::PointCounts,
    ply::{PlyFile, PlyStream},
};
pub(crate) use reproject::{Reprojection, ReprojectionTarget, UtmZone, zone_around};
pub(crate) use write::mesh::{
    format::MeshFormat,
    header::{MeshHeader, MeshVertex},
    tile_directory::MeshTileDirectory,
    tileset::{MeshTile, Tileset, mesh_tile_name},
    writer::{CompleteMesh, MeshWriter},
};
pub(crate) use write::{
    cloud::{CloudHeader, Workspace},
    cloud_levels::CloudLevels,
    create::{help_write_sorted, write_sorted},
    nearest_figures::NearestFigures,
    output_format::Format,
    pcd_fields::brightness,
    pcd_options::{PcdEncoding, PcdOptions, PcdOrigin},
    pieces::{KeptPieces, MakePiece, Piece, TakePiece, Workforce},
    point_order::PointOrder,
    squares::Squares,
    store::{RecordSorter, SortedRecords, SortingSpace, StoreError},
    tile_format::TileFormat,
    writer::{CloudWriter, CompleteCloud},
};
