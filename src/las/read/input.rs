//! An input file, by what its headers say.

use std::{path::PathBuf, sync::Arc};

use ::las::{Vlr, point::Format};

#[cfg(feature = "e57")]
use super::e57::E57File;
use super::ply::PlyFile;
use crate::las::{
    format::{chunk_table::Chunk, conversion::InputLayout, crs::Crs, extra_bytes::ExtraAttribute},
    reproject::Reprojection,
};
use crate::store::Source;

/// The most points that are decoded at a time.
const BATCH_POINTS: u64 = 32_768;
/// The most bytes that are decoded at a time: few points of long records.
const BATCH_BYTES: u64 = 4 << 20;
/// The farthest coordinate and offset that can be meant, in CRS units.
pub(super) const FARTHEST_COORDINATE: f64 = 1e12;

/// An input file, by what its headers say.
#[derive(Clone, Debug)]
pub(crate) struct InputFile {
    /// The path of the file, or its address without secrets.
    pub(crate) path: PathBuf,
    /// The file, or the object, whose bytes are read.
    pub(crate) source: Source,
    /// The length of the file in bytes.
    pub(crate) bytes: u64,
    /// The LAS version: major and minor.
    pub(crate) version: [u8; 2],
    /// The number of points that the header claims.
    pub(crate) points_claimed: u64,
    /// The bounds that the header claims, in world coordinates: min, max.
    pub(crate) bounds_claimed: [[f64; 3]; 2],
    /// The claimed bounds if they can be true, else the bounds of the points: min, max.
    pub(crate) bounds: [[f64; 3]; 2],
    /// CRS units to a stored unit, along each axis.
    pub(crate) scale: [f64; 3],
    /// The world coordinates of the stored origin.
    pub(crate) offset: [f64; 3],
    /// The coordinate reference system, if the file states one.
    pub(crate) crs: Option<Crs>,
    /// The extra bytes in the order of the record.
    pub(crate) extra_bytes: Vec<ExtraAttribute>,
    /// The variable length records that are as true of the output: the names of the classes,
    /// and the text that describes the area.
    pub(crate) carried_records: Vec<Vlr>,
    /// Whether GPS times are adjusted standard times, not seconds of the week.
    pub(crate) has_standard_time: bool,
    /// The program that wrote the file.
    pub(crate) generating_software: String,
    /// Sentences about what is unusual, for the report: the file is the subject.
    pub(crate) notes: Vec<String>,
    /// The offset of the points in the file, in bytes.
    pub(super) points_start: u64,
    pub(super) format: Format,
    pub(super) entry_points: EntryPoints,
    /// The way of the points to another CRS, if they take one: bounds and CRS are those after it.
    pub(super) placement: Option<Placement>,
    /// How near to each other points have to be (CRS units), if finer levels of an octree are left out.
    pub(crate) finest_spacing: Option<f64>,
}

/// The way of an input to the CRS of the run.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    pub(super) reprojection: Arc<Reprojection>,
    /// The input as its headers have it.
    pub(super) surveyed: Arc<InputFile>,
    /// The scale that loses nothing of the points (CRS units).
    pub(super) scale: f64,
}

/// The points at which decoding can begin.
#[derive(Clone, Debug)]
pub(super) enum EntryPoints {
    /// The first point of a LAS or LAZ file only.
    First,
    /// Every point of a LAS or LAZ file whose index is a multiple of this.
    MultiplesOf(u64),
    /// The first points of these chunks of a LAZ file, which are alike except for the last one.
    AlikeChunks(Arc<[Chunk]>),
    /// The first points of these chunks of a LAZ file.
    Chunks {
        chunks: Arc<[Chunk]>,
        /// Whether the chunks are the nodes of an octree.
        is_octree: bool,
    },
    /// The first vertex of a polygon file.
    Ply(PlyFile),
    /// The first point of an E57 file.
    #[cfg(feature = "e57")]
    E57(E57File),
}

impl InputFile {
    /// The places where scanners stood, as far as the file tells (world coordinates).
    pub(crate) fn stations(&self) -> Vec<[f64; 3]> {
        match &self.entry_points {
            #[cfg(feature = "e57")]
            EntryPoints::E57(file) => {
                let stations = file.stations(&self.surveyed_bounds()).iter();
                stations.filter_map(|place| self.placed(*place)).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The chunks of the file, if they differ in length.
    pub(super) fn chunks(&self) -> Option<&[Chunk]> {
        match &self.entry_points {
            EntryPoints::Chunks { chunks, .. } => Some(chunks),
            _ => None,
        }
    }

    /// Whether the file is read from a server or a store.
    pub(crate) fn is_remote(&self) -> bool {
        self.source.is_remote()
    }

    /// Whether the file has coordinates as floating-point numbers, on no scale of its own.
    pub(super) fn is_of_vertices(&self) -> bool {
        match &self.entry_points {
            EntryPoints::Ply(_) => true,
            #[cfg(feature = "e57")]
            EntryPoints::E57(_) => true,
            _ => false,
        }
    }

    /// The common name of the file's kind.
    pub(crate) fn kind(&self) -> &'static str {
        match &self.entry_points {
            EntryPoints::Ply(_) => "PLY",
            #[cfg(feature = "e57")]
            EntryPoints::E57(_) => "E57",
            EntryPoints::Chunks {
                is_octree: true, ..
            } => "COPC",
            _ if self.format.is_compressed => "LAZ",
            _ => "LAS",
        }
    }

    /// The number of points that are decoded at a time.
    pub(super) fn batch_points(&self) -> u64 {
        let record_length = u64::from(self.format.len());
        BATCH_POINTS.min(BATCH_BYTES / record_length).max(1)
    }

    /// The point format.
    pub(crate) fn format(&self) -> Format {
        self.format
    }

    /// The number of the point format in the specification.
    pub(crate) fn format_number(&self) -> u8 {
        let mut plain = self.format;
        plain.is_compressed = false;
        plain.to_u8().unwrap_or(u8::MAX)
    }

    /// The layout of the records, and the meaning of their coordinates.
    pub(super) fn layout(&self) -> InputLayout<'_> {
        InputLayout {
            point_format: self.format,
            scale: self.scale,
            offset: self.offset,
            extra_bytes: &self.extra_bytes,
        }
    }
}
