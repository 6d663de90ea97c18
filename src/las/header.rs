//! What headers claim, held against the length of the file.
//!
//! The readers beneath allocate by what a header says, and memory that is not there
//! ends a program: no error comes of it. So nothing is handed to them before it was
//! seen to fit.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use ::las::{Vlr, point::Format, raw};

use super::{LasError, chunks::Chunk};

/// Length of a public header block of LAS 1.0 to 1.2; later ones are longer.
const SHORTEST_HEADER: u64 = 227;
/// Length of the header of a variable length record, and of an extended one.
const VLR_HEADER: u64 = 54;
const EVLR_HEADER: u64 = 60;
/// Longest extended record that is read: a CRS is a few thousand bytes.
const LONGEST_EVLR: u64 = 16 << 20;
/// Most bytes between the records of the header and the points.
const WIDEST_PADDING: u64 = 16 << 20;
/// The bit of a point format that says that points are compressed.
const COMPRESSED: u8 = 0x80;
/// Where the record of the compression says how many points a chunk has, and that their
/// number varies.
const CHUNK_SIZE: usize = 12;
const VARIABLE: u64 = 0xffff_ffff;
/// Where the record of the compression says how many items a point has: their type,
/// length and version follow.
const ITEM_COUNT: usize = 32;
/// The compression without chunks, of old.
const ONE_STREAM: u16 = 1;

/// The public header block, after a look at whether the file can hold what it
/// announces: the reader of records would allocate and loop by it. With it come the
/// chunks of its points, if they differ in length.
pub(super) fn read_header(
    path: &Path,
    bytes: u64,
) -> Result<(raw::Header, Option<Vec<Chunk>>), LasError> {
    let wrong = |problem: String| LasError::new(path, problem);
    if bytes == 0 {
        return Err(wrong("is empty (0 bytes)".into()));
    }
    let file = File::open(path).map_err(|e| wrong(format!("cannot be read: {e}")))?;
    let mut file = BufReader::new(file);
    let mut signature = Vec::new();
    file.by_ref()
        .take(4)
        .read_to_end(&mut signature)
        .map_err(|e| wrong(format!("cannot be read: {e}")))?;
    if signature != b"LASF" {
        let guess = match signature.starts_with(b"ply") {
            true => "; it looks like PLY: name it .ply",
            false => "",
        };
        return Err(wrong(format!("is no LAS or LAZ file{guess}")));
    }
    if bytes < SHORTEST_HEADER {
        return Err(wrong(format!(
            "is truncated: {bytes} bytes, and the header alone takes {SHORTEST_HEADER}"
        )));
    }
    let header = file
        .rewind()
        .map_err(::las::Error::from)
        .and_then(|()| raw::Header::read_from(&mut file))
        .map_err(|e| wrong(format!("has no readable header: {e}")))?;
    let version = header.version;
    if version.major != 1 || version.minor > 4 {
        return Err(wrong(format!(
            "is LAS {}.{}; versions 1.0 to 1.4 are read",
            version.major, version.minor
        )));
    }
    let (offset, size) = (
        u64::from(header.offset_to_point_data),
        u64::from(header.header_size),
    );
    if offset > bytes || size > offset {
        return Err(wrong(format!(
            "is truncated or damaged: points should start at byte {offset}, after a header of \
             {size}, in a file of {bytes}"
        )));
    }
    let records = u64::from(header.number_of_variable_length_records);
    if records * VLR_HEADER > offset - size {
        return Err(wrong(format!(
            "is damaged: {records} variable length records cannot stand in {} bytes",
            offset - size
        )));
    }
    let compression = check_records(&mut file, &header).map_err(wrong)?;
    let mut chunks = None;
    if header.point_data_record_format & COMPRESSED != 0 {
        let compression = compression
            .ok_or_else(|| wrong("is damaged: it does not say how it is compressed".into()))?;
        chunks = check_chunks(&mut file, bytes, &header, &compression).map_err(wrong)?;
    }
    Ok((header, chunks))
}

/// Walks over the variable length records: none may reach beyond the points. Returns
/// the one that says how points are compressed.
fn check_records(
    file: &mut BufReader<File>,
    header: &raw::Header,
) -> Result<Option<Vec<u8>>, String> {
    let end = u64::from(header.offset_to_point_data);
    let mut at = u64::from(header.header_size);
    let mut compression = None;
    for number in 0..header.number_of_variable_length_records {
        let unreadable =
            |e: io::Error| format!("variable length record {number} cannot be read: {e}");
        let mut head = [0; VLR_HEADER as usize];
        file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        file.read_exact(&mut head).map_err(unreadable)?;
        let length = u16::from_le_bytes([head[20], head[21]]);
        at += VLR_HEADER + u64::from(length);
        if at > end {
            return Err(format!(
                "is damaged: variable length record {number} reaches to byte {at}, points start \
                 at {end}"
            ));
        }
        if compression.is_none() && text_of(&head[2..18]) == "laszip encoded" {
            let mut data = vec![0; length.into()];
            file.read_exact(&mut data).map_err(unreadable)?;
            compression = Some(data);
        }
    }
    if end - at > WIDEST_PADDING {
        return Err(format!(
            "is damaged: its records end at byte {at}, and its points start at {end}"
        ));
    }
    Ok(compression)
}

/// The extended records; `None` if they cannot be read.
pub(super) fn extended_records(path: &Path, header: &raw::Header) -> Option<Vec<Vlr>> {
    let Some(evlr) = header.evlr else {
        return Some(Vec::new());
    };
    let mut file = File::open(path).ok()?;
    let bytes = file.metadata().ok()?.len();
    let mut at = evlr.start_of_first_evlr;
    let mut vlrs = Vec::new();
    for _ in 0..evlr.number_of_evlrs {
        let mut head = [0; EVLR_HEADER as usize];
        file.seek(SeekFrom::Start(at)).ok()?;
        file.read_exact(&mut head).ok()?;
        let length = u64::from_le_bytes(head[20..28].try_into().ok()?);
        at = at.checked_add(EVLR_HEADER)?.checked_add(length)?;
        if at > bytes {
            return None;
        }
        // Hierarchies and wave packets may be huge, and are of no use here.
        if length <= LONGEST_EVLR {
            let mut data = Vec::new();
            file.by_ref().take(length).read_to_end(&mut data).ok()?;
            vlrs.push(Vlr {
                user_id: text_of(&head[2..18]),
                record_id: u16::from_le_bytes([head[18], head[19]]),
                description: text_of(&head[28..60]),
                data,
            });
        }
    }
    Some(vlrs)
}

pub(super) fn text_of(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

/// Checks what compressed points say of themselves: how long they are, how many chunks
/// the table has, and the lengths of the layers of every chunk. Returns the chunks, if
/// they have layers and differ in length.
fn check_chunks(
    file: &mut BufReader<File>,
    bytes: u64,
    header: &raw::Header,
    compression: &[u8],
) -> Result<Option<Vec<Chunk>>, String> {
    let unreadable =
        |e: io::Error| format!("is truncated or damaged: its points cannot be read: {e}");
    let word = |at: usize| match compression.get(at..at + 2) {
        Some(word) => Ok(u16::from_le_bytes([word[0], word[1]])),
        None => Err("is damaged: what it says of its compression is cut short".to_owned()),
    };
    let record_length = u64::from(header.point_data_record_length);
    let mut compressed_length = 0;
    for item in 0..usize::from(word(ITEM_COUNT)?) {
        compressed_length += u64::from(word(ITEM_COUNT + 2 + 6 * item + 2)?);
    }
    if compressed_length != record_length || record_length == 0 {
        return Err(format!(
            "is damaged: its points are {record_length} bytes long, and compressed as \
             {compressed_length}"
        ));
    }
    let large = header.large_file.map(|large| large.number_of_point_records);
    let claimed = large.unwrap_or_else(|| header.number_of_point_records.into());
    if word(0)? == ONE_STREAM || claimed == 0 {
        return Ok(None);
    }
    let start = u64::from(header.offset_to_point_data);
    let table = chunk_table(file, start, bytes).map_err(unreadable)?;
    if let Some((at, chunks)) = table
        && (chunks == 0 || u64::from(chunks) > (at - start) / record_length + 1)
    {
        return Err(format!(
            "is damaged: its table is of {chunks} chunks, which {} bytes of points cannot be",
            at - start
        ));
    }
    let chunk_size = u64::from(word(CHUNK_SIZE)?) | u64::from(word(CHUNK_SIZE + 2)?) << 16;
    let too_few = |most: u64| {
        format!(
            "is truncated or damaged: the header says {claimed} points, and its chunks hold {most}"
        )
    };
    if let Some((_, chunks)) = table
        && chunk_size != VARIABLE
        && claimed > u64::from(chunks) * chunk_size
    {
        return Err(too_few(u64::from(chunks) * chunk_size));
    }
    let id = header.point_data_record_format & !COMPRESSED & !0x40;
    let format = Format::new(id).map_err(|e| format!("unknown point format: {e}"))?;
    if !format.is_extended {
        return Ok(None);
    }
    let extra_bytes = record_length.saturating_sub(format.len().into());
    // Nine of what all points have, and one for each of the rest.
    let layers = 9
        + usize::from(format.has_color)
        + usize::from(format.has_nir)
        + usize::from(format.has_waveform)
        + extra_bytes as usize;
    let end = table.map_or(bytes, |(at, _)| at);
    let (mut at, mut points) = (start + 8, 0);
    let mut chunks = Vec::new();
    let mut sizes = vec![0; 4 * layers];
    // A chunk is its first point as it is, the number of its points, the lengths of its
    // layers, and these.
    while points < claimed && at < end {
        let mut count = [0; 4];
        file.seek(SeekFrom::Start(at + record_length))
            .and_then(|_| file.read_exact(&mut count))
            .and_then(|()| file.read_exact(&mut sizes))
            .map_err(unreadable)?;
        let held: u64 = sizes
            .chunks_exact(4)
            .map(|size| u64::from(u32::from_le_bytes([size[0], size[1], size[2], size[3]])))
            .sum();
        let next = at + record_length + 4 + sizes.len() as u64 + held;
        if next > end {
            return Err(format!(
                "is damaged: the chunk after point {points} reaches to byte {next}, and its points \
                 end at {end}"
            ));
        }
        let count = u64::from(u32::from_le_bytes(count));
        if chunk_size == VARIABLE {
            chunks.push(Chunk {
                at,
                points: count,
                ground: None,
            });
        }
        points += count;
        at = next;
    }
    if points < claimed {
        return Err(too_few(points));
    }
    Ok((chunk_size == VARIABLE).then_some(chunks))
}

/// Where the table of chunks lies, and how many it says there are; `None` if there is
/// no table.
fn chunk_table(
    file: &mut (impl Read + Seek),
    start: u64,
    bytes: u64,
) -> io::Result<Option<(u64, u32)>> {
    let mut word = [0; 8];
    // Writers that cannot go back leave the place of the table at the end.
    for from in [SeekFrom::Start(start), SeekFrom::End(-8)] {
        file.seek(from)?;
        file.read_exact(&mut word)?;
        let at = i64::from_le_bytes(word);
        if let Ok(at) = u64::try_from(at)
            && at > start
        {
            if at > bytes.saturating_sub(8) {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            file.seek(SeekFrom::Start(at))?;
            file.read_exact(&mut word)?;
            return Ok(Some((
                at,
                u32::from_le_bytes([word[4], word[5], word[6], word[7]]),
            )));
        }
    }
    Ok(None)
}
