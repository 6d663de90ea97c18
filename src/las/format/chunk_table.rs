//! Chunks: the groups of points that LAZ compresses together.
//!
//! ```text
//!   points    offset of the table (8 bytes), chunk, chunk, …
//!   chunk     first point as it is, number of points (4 bytes), length of each of
//!             its layers (4 bytes each), the layers         (point formats 6 to 10)
//!   table     version (4 bytes), number of chunks (4 bytes), …
//! ```
//!
//! (The record of the compression, as `LASzip` writes it: compressor at byte 0, points to a chunk at byte 12,
//! items of a point from byte 32, each of type, length and version.)

use std::io::{self, BufReader, Read, Seek, SeekFrom};

use ::las::{point::Format, raw};
use laz::{LazVlr, laszip::ChunkTable};

use crate::store::{Source, SourceReader};

/// The bit of a point format that says that points are compressed.
pub(super) const COMPRESSED_BIT: u8 = 0x80;
/// The bit of a point format that older compressors have set besides.
const LEGACY_COMPRESSED_BIT: u8 = 0x40;
/// The bytes in front of the chunks: the offset of the table of chunks.
const TABLE_OFFSET_BYTES: u64 = 8;
/// The size of chunks that says that each has its own.
const VARIABLE_CHUNK_SIZE: u64 = 0xffff_ffff;
/// The compressor that makes one stream of all points, without chunks.
const ONE_STREAM: u16 = 1;
/// The number of layers that points of formats 6 to 10 have in common; colour, near infrared,
/// wave packets and each extra byte add one.
const COMMON_LAYERS: usize = 9;

/// Points that are compressed together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::las) struct Chunk {
    /// The offset of the chunk in the file, in bytes.
    pub(in crate::las) offset: u64,
    /// The length of the chunk in bytes.
    pub(in crate::las) bytes: u64,
    /// The number of points.
    pub(in crate::las) points: u64,
    /// The rectangle in which the points lie, if it is known: least and greatest x and y, in
    /// world coordinates.
    pub(in crate::las) rectangle: Option<[[f64; 2]; 2]>,
    /// If the chunk is a node of an octree with nodes above it, the distance between the points of all levels above (CRS units).
    pub(in crate::las) spacing_above: Option<f64>,
}

/// What is known of the chunks of a file.
pub(in crate::las) enum CompressedChunks {
    /// Nothing: points are not compressed, or in chunks that are alike, which the decoder finds by their table.
    Unknown,
    /// All of them. They have layers, and each can be decoded by itself.
    Layered(Vec<Chunk>),
    /// All of them, by their table. They are alike except for the last one.
    Alike(Vec<Chunk>),
}

/// What is known of the chunks of a file, and of the points that are in them.
pub(in crate::las) struct CheckedChunks {
    pub(in crate::las) chunks: CompressedChunks,
    /// The number of points for which all chunks have room, if it is known to be larger than the header states.
    pub(in crate::las) room: Option<u64>,
}

impl CheckedChunks {
    /// Chunks of which nothing is known.
    pub(super) const UNKNOWN: Self = Self {
        chunks: CompressedChunks::Unknown,
        room: None,
    };
}

/// What the record of the compression says.
struct Compression {
    compressor: u16,
    /// Points to a chunk, or [`VARIABLE_CHUNK_SIZE`].
    chunk_size: u64,
    /// The sum of the lengths of a point's items, in bytes.
    point_length: u64,
}

impl Compression {
    const COMPRESSOR: usize = 0;
    const CHUNK_SIZE: usize = 12;
    const ITEM_COUNT: usize = 32;
    const ITEMS: usize = 34;
    const ITEM_BYTES: usize = 6;
    const ITEM_LENGTH: usize = 2;

    fn read(record: &[u8]) -> Result<Self, String> {
        let word = |at: usize| match record.get(at..at + 2) {
            Some(word) => Ok(u16::from_le_bytes([word[0], word[1]])),
            None => Err(format!(
                "is damaged: the record of its compression has only {} bytes",
                record.len()
            )),
        };
        let mut point_length = 0;
        for item in 0..usize::from(word(Self::ITEM_COUNT)?) {
            let item = Self::ITEMS + Self::ITEM_BYTES * item;
            point_length += u64::from(word(item + Self::ITEM_LENGTH)?);
        }
        let low = u64::from(word(Self::CHUNK_SIZE)?);
        let high = u64::from(word(Self::CHUNK_SIZE + 2)?);
        Ok(Self {
            compressor: word(Self::COMPRESSOR)?,
            chunk_size: low | high << 16,
            point_length,
        })
    }
}

/// The position of the table of chunks, and the number of chunks in it.
#[derive(Clone, Copy)]
struct TableClaim {
    offset: u64,
    chunks: u32,
}

/// The points of a compressed file, as its headers claim them.
struct CompressedPoints {
    /// The number of points.
    claimed: u64,
    /// The offset of the points in the file, and the length of the file, in bytes.
    start: u64,
    file_bytes: u64,
    /// The length of a point in bytes.
    record_length: u64,
    chunk_size: u64,
}

/// Checks what compressed points say of themselves: how long they are, how many chunks
/// the table has, and the lengths of the layers of every chunk. Returns the chunks, if
/// they have layers and differ in length, and whether there are more than the points need.
///
/// Chunks of a remote file are those of its table: to look at each of them would take a request. Their layers are
/// checked when they are decoded, by [`check_layers`].
///
/// # Errors
///
/// A text that says what is wrong with the file.
pub(super) fn check_compressed_points(
    file: &mut BufReader<SourceReader>,
    source: &Source,
    header: &raw::Header,
    record: &[u8],
) -> Result<CheckedChunks, String> {
    let compression = Compression::read(record)?;
    let record_length = u64::from(header.point_data_record_length);
    if compression.point_length != record_length || record_length == 0 {
        return Err(format!(
            "is damaged: its points are {record_length} bytes long, and compressed as {}",
            compression.point_length
        ));
    }
    let large = header.large_file.map(|large| large.number_of_point_records);
    let points = CompressedPoints {
        claimed: large.unwrap_or_else(|| header.number_of_point_records.into()),
        start: header.offset_to_point_data.into(),
        file_bytes: source.bytes(),
        record_length,
        chunk_size: compression.chunk_size,
    };
    if compression.compressor == ONE_STREAM || points.claimed == 0 {
        return Ok(CheckedChunks::UNKNOWN);
    }
    let table = points.find_table(file, source).map_err(unreadable)?;
    if let Some(table) = table {
        points.check_table(table)?;
    }
    let layers = layer_count(header)?;
    let mut room = table.and_then(|table| points.room_by(table));
    let chunks = match (layers, table) {
        (layers, Some(table)) if source.is_remote() => {
            let chunks = points.read_table(file, table, record)?;
            match layers {
                Some(_) => CompressedChunks::Layered(chunks),
                None => CompressedChunks::Alike(chunks),
            }
        }
        (None, _) => CompressedChunks::Unknown,
        (Some(layers), table) => {
            let end = table.map_or(source.bytes(), |table| table.offset);
            let (chunks, found) = points.walk_chunks(file, layers, end)?;
            room = table.and(found);
            match points.chunk_size == VARIABLE_CHUNK_SIZE {
                true => CompressedChunks::Layered(chunks),
                false => CompressedChunks::Unknown,
            }
        }
    };
    Ok(CheckedChunks { chunks, room })
}

/// Checks that the layers of `chunk`, of points in this `format`, are as long as the chunk, before a decoder makes room
/// for them.
///
/// # Errors
///
/// A text that says what is wrong with the file.
pub(in crate::las) fn check_layers(
    file: &mut (impl Read + Seek),
    chunk: &Chunk,
    format: &Format,
) -> Result<(), String> {
    let layers = layers_of(format, u64::from(format.extra_bytes));
    let head =
        ChunkHead::read(file, chunk.offset, format.len().into(), layers).map_err(unreadable)?;
    match head.end <= chunk.offset + chunk.bytes {
        true => Ok(()),
        false => Err(format!(
            "is damaged: the chunk at byte {} is {} bytes long by its layers, and {} by the table",
            chunk.offset,
            head.end - chunk.offset,
            chunk.bytes
        )),
    }
}

/// What a chunk with layers says of itself.
struct ChunkHead {
    /// The number of its points.
    points: u64,
    /// The offset of the byte after its last layer.
    end: u64,
}

impl ChunkHead {
    /// Reads the head of the chunk at `offset`.
    fn read(
        file: &mut (impl Read + Seek),
        offset: u64,
        record_length: u64,
        layers: usize,
    ) -> io::Result<Self> {
        let mut count = [0; 4];
        let mut sizes = vec![0; 4 * layers];
        file.seek(SeekFrom::Start(offset + record_length))?;
        file.read_exact(&mut count)?;
        file.read_exact(&mut sizes)?;
        let layer_bytes: u64 = sizes
            .chunks_exact(4)
            .map(|size| u64::from(u32::from_le_bytes([size[0], size[1], size[2], size[3]])))
            .sum();
        Ok(Self {
            points: u32::from_le_bytes(count).into(),
            end: offset + record_length + 4 + sizes.len() as u64 + layer_bytes,
        })
    }
}

fn unreadable(error: io::Error) -> String {
    format!("is truncated or damaged: its points cannot be read: {error}")
}

/// The number of layers of every chunk; `None` if points of the format have none.
fn layer_count(header: &raw::Header) -> Result<Option<usize>, String> {
    let id = header.point_data_record_format & !COMPRESSED_BIT & !LEGACY_COMPRESSED_BIT;
    let format = Format::new(id).map_err(|e| format!("unknown point format: {e}"))?;
    if !format.is_extended {
        return Ok(None);
    }
    let extra_bytes = header.point_data_record_length.saturating_sub(format.len());
    Ok(Some(layers_of(&format, extra_bytes.into())))
}

/// The number of layers of points in `format` with `extra_bytes`.
fn layers_of(format: &Format, extra_bytes: u64) -> usize {
    COMMON_LAYERS
        + usize::from(format.has_color)
        + usize::from(format.has_nir)
        + usize::from(format.has_waveform)
        + extra_bytes as usize
}

impl CompressedPoints {
    /// Finds the table of chunks; `None` if there is no table.
    fn find_table(
        &self,
        file: &mut (impl Read + Seek),
        source: &Source,
    ) -> io::Result<Option<TableClaim>> {
        let mut word = [0; TABLE_OFFSET_BYTES as usize];
        // Writers that cannot go back leave the offset of the table at the end.
        for from in [SeekFrom::Start(self.start), SeekFrom::End(-8)] {
            file.seek(from)?;
            file.read_exact(&mut word)?;
            if let Ok(offset) = u64::try_from(i64::from_le_bytes(word))
                && offset > self.start
            {
                if offset > self.file_bytes.saturating_sub(8) {
                    return Err(io::ErrorKind::UnexpectedEof.into());
                }
                // Behind the table there are extended records, and then the file ends.
                source.keep(offset..self.file_bytes)?;
                file.seek(SeekFrom::Start(offset))?;
                file.read_exact(&mut word)?;
                let chunks = u32::from_le_bytes([word[4], word[5], word[6], word[7]]);
                return Ok(Some(TableClaim { offset, chunks }));
            }
        }
        Ok(None)
    }

    /// Checks that the points can be of as many chunks as the table says.
    fn check_table(&self, table: TableClaim) -> Result<(), String> {
        let bytes = table.offset - self.start;
        let chunks = u64::from(table.chunks);
        if chunks == 0 || chunks > bytes / self.record_length + 1 {
            return Err(format!(
                "is damaged: its table says {chunks} chunks, and its points are {bytes} bytes"
            ));
        }
        let is_fixed = self.chunk_size != VARIABLE_CHUNK_SIZE;
        if is_fixed && self.claimed > chunks * self.chunk_size {
            return Err(self.too_few(chunks * self.chunk_size));
        }
        Ok(())
    }

    /// The points for which chunks of one size have room, if the `table` has more of them than the points need.
    fn room_by(&self, table: TableClaim) -> Option<u64> {
        let chunks = u64::from(table.chunks);
        let is_fixed = self.chunk_size != VARIABLE_CHUNK_SIZE;
        (is_fixed && chunks > self.claimed.div_ceil(self.chunk_size))
            .then_some(chunks * self.chunk_size)
    }

    /// The chunks as the `table` has them, by the `record` of the compression.
    fn read_table(
        &self,
        file: &mut BufReader<SourceReader>,
        table: TableClaim,
        record: &[u8],
    ) -> Result<Vec<Chunk>, String> {
        let compression = LazVlr::read_from(record).map_err(|e| format!("is damaged: {e}"))?;
        file.seek(SeekFrom::Start(self.start)).map_err(unreadable)?;
        let entries = ChunkTable::read_from(file, &compression).map_err(|e| {
            format!("is truncated or damaged: its table of chunks cannot be read: {e}")
        })?;
        let (mut offset, mut points) = (self.start + TABLE_OFFSET_BYTES, 0_u64);
        let mut chunks = Vec::new();
        for entry in &entries {
            if points >= self.claimed {
                break;
            }
            let left = self.claimed - points;
            let chunk = Chunk {
                offset,
                bytes: entry.byte_count,
                points: match self.chunk_size == VARIABLE_CHUNK_SIZE {
                    true => entry.point_count,
                    false => self.chunk_size.min(left),
                },
                rectangle: None,
                spacing_above: None,
            };
            let next = offset
                .checked_add(chunk.bytes)
                .filter(|&next| next <= table.offset);
            offset = next.ok_or_else(|| {
                format!(
                    "is damaged: the chunk after point {points} is {} bytes long by the table, and its points end at {}",
                    chunk.bytes, table.offset
                )
            })?;
            points = points.saturating_add(chunk.points);
            chunks.push(chunk);
        }
        match points < self.claimed {
            true => Err(self.too_few(points)),
            false => Ok(chunks),
        }
    }

    /// Goes from chunk to chunk up to the byte `end`. Returns them if their sizes differ, and the number of points that
    /// are in all chunks if it is larger than the header states.
    fn walk_chunks(
        &self,
        file: &mut BufReader<SourceReader>,
        layers: usize,
        end: u64,
    ) -> Result<(Vec<Chunk>, Option<u64>), String> {
        let (mut offset, mut points) = (self.start + TABLE_OFFSET_BYTES, 0);
        let mut chunks = Vec::new();
        while points < self.claimed && offset < end {
            let head = ChunkHead::read(file, offset, self.record_length, layers);
            let head = head.map_err(unreadable)?;
            if head.end > end {
                return Err(format!(
                    "is damaged: the chunk after point {points} reaches to byte {}, and its \
                     points end at {end}",
                    head.end
                ));
            }
            if self.chunk_size == VARIABLE_CHUNK_SIZE {
                chunks.push(Chunk {
                    offset,
                    bytes: head.end - offset,
                    points: head.points,
                    rectangle: None,
                    spacing_above: None,
                });
            }
            points += head.points;
            offset = head.end;
        }
        if points < self.claimed {
            return Err(self.too_few(points));
        }
        // What stands behind the points that are read need not be chunks: these end where the table begins.
        while offset < end
            && let Ok(head) = ChunkHead::read(file, offset, self.record_length, layers)
        {
            points += head.points;
            offset = head.end;
        }
        let has_more = offset == end && points > self.claimed;
        Ok((chunks, has_more.then_some(points)))
    }

    fn too_few(&self, most: u64) -> String {
        format!(
            "is truncated or damaged: the header says {} points, and its chunks have {most}",
            self.claimed
        )
    }
}
