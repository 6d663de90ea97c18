//! The points of a file as records of its own format, whatever kind of file it is.

use std::ops::Range;

use ::las::{PointData, PointDataBuilder, Reader};

#[cfg(feature = "e57")]
use super::e57::E57Stream;
use super::{
    chunk_reader::ChunkReader,
    guard::{DECODER_FAILED, guarded},
    input::{EntryPoints, InputFile},
    las_reader::{open_las, seek_to_point, skip_points},
    ply::PlyStream,
};
use crate::las::{error::LasError, format::vertex_layout::VertexLayout};

/// A file that is being decoded.
pub(super) enum Decoder {
    /// LAS, or LAZ whose chunks are alike.
    Las {
        reader: Box<Reader>,
        batch: PointData,
    },
    /// LAZ whose chunks differ in length.
    Chunks { reader: ChunkReader, raw: Vec<u8> },
    /// A file whose points have to be made records first.
    Vertices(VertexDecoder),
}

/// The vertices of a file, and the records that they become.
pub(super) struct VertexDecoder {
    stream: VertexStream,
    layout: VertexLayout,
    scale: [f64; 3],
    offset: [f64; 3],
    raw: Vec<u8>,
}

/// A stream of vertices: the values of their properties.
enum VertexStream {
    Ply(PlyStream),
    #[cfg(feature = "e57")]
    E57(E57Stream, Vec<f64>),
}

impl VertexStream {
    /// The values of the next vertex; `None` after the last.
    fn next(&mut self) -> Result<Option<&[f64]>, String> {
        match self {
            Self::Ply(stream) => stream.next_vertex().map_err(|e| e.problem),
            #[cfg(feature = "e57")]
            Self::E57(stream, values) => {
                let Some(next) = stream.next().transpose()? else {
                    return Ok(None);
                };
                values.clear();
                values.extend(next);
                Ok(Some(values))
            }
        }
    }
}

impl VertexDecoder {
    /// Opens `input` at the vertex of this index; `None` if its points are records already.
    fn open(input: &InputFile, first: u64) -> Result<Option<Self>, LasError> {
        let (mut stream, layout) = match &input.entry_points {
            EntryPoints::Ply(file) => (VertexStream::Ply(file.open()?), file.layout()),
            #[cfg(feature = "e57")]
            EntryPoints::E57(file) => (VertexStream::E57(file.open(), Vec::new()), file.layout()),
            _ => return Ok(None),
        };
        for _ in 0..first {
            let skipped = stream.next();
            skipped.map_err(|problem| LasError::new(&input.path, problem))?;
        }
        Ok(Some(Self {
            stream,
            layout,
            scale: input.scale,
            offset: input.offset,
            raw: Vec::new(),
        }))
    }

    fn fill(&mut self, wanted: u64) -> Result<u64, String> {
        self.raw.clear();
        for read in 0..wanted {
            let Some(values) = self.stream.next()? else {
                return Ok(read);
            };
            let is_within = self
                .layout
                .append(values, self.scale, self.offset, &mut self.raw);
            if !is_within {
                return Err(
                    "a coordinate is not finite, or outside of the bounds found before; the \
                     file has changed"
                        .to_owned(),
                );
            }
        }
        Ok(wanted)
    }
}

impl Decoder {
    /// Opens a `part` of `input`.
    ///
    /// # Errors
    ///
    /// If the file cannot be opened (any more), or has no such part.
    pub(super) fn open(input: &InputFile, part: &Range<u64>) -> Result<Self, LasError> {
        if let Some(vertices) = VertexDecoder::open(input, part.start)? {
            return Ok(Self::Vertices(vertices));
        }
        let ranges = match input.chunks() {
            Some(_) => Vec::new(),
            None => input.byte_ranges(part),
        };
        let mut reader = open_las(&input.source, &ranges)?;
        if let Some(chunks) = input.chunks() {
            let wrong = |problem| LasError::new(&input.path, problem);
            let items = reader.header().laz_vlr().map(|vlr| vlr.items().clone());
            let items = items.map_err(|e| wrong(format!("cannot be opened: {e}")))?;
            let reader = ChunkReader::open(input, items, chunks, part).map_err(wrong)?;
            return Ok(Self::Chunks {
                reader,
                raw: Vec::new(),
            });
        }
        if part.start > 0 && !seek_to_point(&mut reader, part.start) {
            // A reader that has failed to seek is of no use any more.
            reader = open_las(&input.source, &ranges)?;
            if !skip_points(&mut reader, part.start, input.batch_points()) {
                let problem = format!(
                    "is damaged: point {} of {} cannot be reached",
                    part.start, input.points_claimed
                );
                return Err(LasError::new(&input.path, problem));
            }
        }
        Ok(Self::Las {
            batch: PointDataBuilder::new().for_header(reader.header()).build(),
            reader: Box::new(reader),
        })
    }

    /// Decodes the next records, up to `wanted`, and returns their number.
    ///
    /// # Errors
    ///
    /// A text that says why they cannot be decoded.
    pub(super) fn fill(&mut self, wanted: u64) -> Result<u64, String> {
        match self {
            Self::Las { reader, batch } => match guarded(|| reader.fill_points(wanted, batch)) {
                Some(Ok(read)) => Ok(read),
                Some(Err(error)) => Err(error.to_string()),
                None => Err(DECODER_FAILED.to_owned()),
            },
            Self::Chunks { reader, raw } => reader.fill(wanted, raw),
            Self::Vertices(vertices) => vertices.fill(wanted),
        }
    }

    /// The records that were decoded last.
    pub(super) fn raw(&self) -> &[u8] {
        match self {
            Self::Las { batch, .. } => batch.raw_bytes(),
            Self::Chunks { raw, .. } => raw,
            Self::Vertices(vertices) => &vertices.raw,
        }
    }
}
