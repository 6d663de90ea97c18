//! What headers claim, checked against the length of the file.
//!
//! The readers beneath allocate and loop by what a header says, and memory that cannot be
//! had ends the program without an error. So nothing is handed to them before it was seen
//! to fit.

use std::{
    io::{BufReader, Read, Seek},
    ops::Range,
    path::Path,
};

use ::las::raw;

use super::{
    chunk_table::{COMPRESSED_BIT, CheckedChunks, check_compressed_points},
    vlr::{VLR_HEAD_BYTES, check_records},
};
use crate::{
    geometry::{Quantization, Stored},
    las::error::LasError,
    store::{Source, SourceReader},
};

/// The length of the public header block of LAS 1.0 to 1.2 in bytes; later ones are longer.
const SHORTEST_HEADER_BYTES: u64 = 227;
/// The length of the public header block of LAS 1.4 in bytes.
pub(super) const HEADER_BYTES_1_4: u64 = 375;
/// The bytes of the version: major and minor.
pub(in crate::las) const VERSION: Range<usize> = 24..26;
/// The bytes of the counts for older readers, of points and of points by return: formats
/// 6 and up leave them zero.
pub(in crate::las) const LEGACY_COUNTS: Range<u64> = 107..131;
/// The first byte of the bounds: greatest and least x, then y, then z.
pub(in crate::las) const BOUNDS_START: u64 = 179;
/// The first byte of: the offset of the extended records (8 bytes), their number (4), the
/// number of points (8), and the numbers of points by return (15 × 8).
pub(in crate::las) const EXTENDED_START: u64 = 235;
/// The bytes of the number of extended records (LAS 1.4).
pub(in crate::las) const EXTENDED_COUNT: Range<u64> = 243..247;

/// A header that fits its file.
pub(in crate::las) struct CheckedHeader {
    /// The public header block.
    pub(in crate::las) header: raw::Header,
    /// The chunks of the points, as far as they have to be known.
    pub(in crate::las) chunks: CheckedChunks,
}

impl CheckedHeader {
    /// Reads the header of the LAS or LAZ file `source`.
    ///
    /// # Errors
    ///
    /// If the file is neither, is of an unknown version, or cannot have what it announces.
    pub(in crate::las) fn read(source: &Source) -> Result<Self, LasError> {
        let (path, bytes) = (source.path(), source.bytes());
        let wrong = |problem: String| LasError::new(path, problem);
        if bytes == 0 {
            return Err(wrong("is empty (0 bytes)".into()));
        }
        let file = source.open(&[]);
        let mut file = BufReader::new(file.map_err(|e| LasError::unreadable(path, e))?);
        check_signature(&mut file, path)?;
        if bytes < SHORTEST_HEADER_BYTES {
            return Err(wrong(format!(
                "is truncated: {bytes} bytes, and the header alone takes {SHORTEST_HEADER_BYTES}"
            )));
        }
        let header = file
            .rewind()
            .map_err(::las::Error::from)
            .and_then(|()| raw::Header::read_from(&mut file))
            .map_err(|e| wrong(format!("has no readable header: {e}")))?;
        check_announcements(&header, bytes).map_err(wrong)?;
        let compression = check_records(&mut file, &header).map_err(wrong)?;
        let mut chunks = CheckedChunks::UNKNOWN;
        if header.point_data_record_format & COMPRESSED_BIT != 0 {
            let compression = compression.ok_or_else(|| {
                wrong("is damaged: points are compressed, but no record says how".into())
            })?;
            let checked = check_compressed_points(&mut file, source, &header, &compression);
            chunks = checked.map_err(wrong)?;
        }
        Ok(Self { header, chunks })
    }
}

/// Checks that the file begins as LAS and LAZ do.
fn check_signature(file: &mut BufReader<SourceReader>, path: &Path) -> Result<(), LasError> {
    let mut signature = Vec::new();
    file.by_ref()
        .take(4)
        .read_to_end(&mut signature)
        .map_err(|e| LasError::unreadable(path, e))?;
    if signature == b"LASF" {
        return Ok(());
    }
    let guess = match signature.starts_with(b"ply") {
        true => "; it looks like PLY: name it .ply",
        false => "",
    };
    Err(LasError::new(path, format!("is no LAS or LAZ file{guess}")))
}

/// Checks the version, and that records and points can be where the header says.
fn check_announcements(header: &raw::Header, bytes: u64) -> Result<(), String> {
    let version = header.version;
    if version.major != 1 || version.minor > 4 {
        let remedy = match (version.major, version.minor) {
            (1, 5) => ", 1.5 is not yet; convert it to LAS 1.4",
            _ => "",
        };
        return Err(format!(
            "is LAS {}.{}; versions 1.0 to 1.4 are read{remedy}",
            version.major, version.minor
        ));
    }
    let offset = u64::from(header.offset_to_point_data);
    let size = u64::from(header.header_size);
    if offset > bytes || size > offset {
        return Err(format!(
            "is truncated or damaged: points should start at byte {offset}, after a header of \
             {size} bytes, in a file of {bytes}"
        ));
    }
    let records = u64::from(header.number_of_variable_length_records);
    if records * VLR_HEAD_BYTES > offset - size {
        return Err(format!(
            "is damaged: {records} variable length records do not fit into {} bytes",
            offset - size
        ));
    }
    Ok(())
}

/// The bytes of the header's bounds, of `points` points with the stored `bounds`: the
/// coordinates as every reader computes them, where those that the writer computes by itself
/// are a unit wider now and then.
pub(in crate::las) fn header_bounds(
    quantization: &Quantization,
    bounds: &[[i32; 3]; 2],
    points: u64,
) -> Vec<u8> {
    let [min, max] = bounds.map(|[x, y, z]| quantization.world(Stored { x, y, z }));
    (0..3)
        .flat_map(|axis| [max[axis], min[axis]])
        .flat_map(|c| if points == 0 { 0.0_f64 } else { c }.to_le_bytes())
        .collect()
}

/// The bytes from [`EXTENDED_START`] on, of a file with one extended record at `offset` and
/// `points` points, all of them first returns.
pub(in crate::las) fn extended_counts(offset: u64, points: u64) -> Vec<u8> {
    let mut counts = offset.to_le_bytes().to_vec();
    counts.extend(1_u32.to_le_bytes());
    counts.extend(points.to_le_bytes());
    counts.extend(points.to_le_bytes());
    counts
}
