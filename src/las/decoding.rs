//! The points of a file as raw records of its own format, whatever kind of file it is.

use std::{fs::File, ops::Range, path::Path};

use ::las::{LazParallelism, PointData, PointDataBuilder, Reader, ReaderOptions};

#[cfg(feature = "e57")]
use super::e57::E57Stream;
use super::{
    InputFile, LasError, PlyStream,
    chunks::ChunkReader,
    guard::{GuardedFile, guarded},
    ply::PlyLayout,
    reading::Access,
};

/// A file that is being decoded.
pub(super) enum Decoder {
    /// LAS, or LAZ whose chunks are alike.
    Las {
        reader: Box<Reader>,
        batch: PointData,
    },
    /// LAZ whose chunks differ in length.
    Chunks { reader: ChunkReader, raw: Vec<u8> },
    /// A file whose points are no records yet.
    Vertices {
        stream: Vertices,
        layout: PlyLayout,
        scale: [f64; 3],
        offset: [f64; 3],
        raw: Vec<u8>,
    },
}

/// Points as numbers.
pub(super) enum Vertices {
    Ply(PlyStream),
    #[cfg(feature = "e57")]
    E57(E57Stream, Vec<f64>),
}

impl Vertices {
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

impl Decoder {
    /// Opens a `part` of `input`.
    ///
    /// # Errors
    ///
    /// If the file cannot be opened (any more), or the part not be found in it.
    pub(super) fn open(input: &InputFile, part: &Range<u64>) -> Result<Self, LasError> {
        let vertices = match &input.access {
            Access::Ply(file) => Some((Vertices::Ply(file.open()?), file.layout())),
            #[cfg(feature = "e57")]
            Access::E57(file) => Some((Vertices::E57(file.open(), Vec::new()), file.layout())),
            _ => None,
        };
        if let Some((mut stream, layout)) = vertices {
            for _ in 0..part.start {
                let skipped = stream.next();
                skipped.map_err(|problem| LasError::new(&input.path, problem))?;
            }
            return Ok(Self::Vertices {
                stream,
                layout,
                scale: input.scale,
                offset: input.offset,
                raw: Vec::new(),
            });
        }
        let mut reader = open_las(&input.path)?;
        if let Some(chunks) = input.chunks() {
            let wrong = |problem| LasError::new(&input.path, problem);
            let items = reader.header().laz_vlr().map(|vlr| vlr.items().clone());
            let items = items.map_err(|e| wrong(format!("cannot be opened: {e}")))?;
            let reader = ChunkReader::open(&input.path, items, chunks, part).map_err(wrong)?;
            return Ok(Self::Chunks {
                reader,
                raw: Vec::new(),
            });
        }
        if part.start > 0
            && !(finds(&mut reader, part.start) || skips(input, &mut reader, part.start)?)
        {
            return Err(LasError::new(
                &input.path,
                format!(
                    "is damaged: point {} of {} is not found",
                    part.start, input.points_claimed
                ),
            ));
        }
        Ok(Self::Las {
            batch: PointDataBuilder::new().for_header(reader.header()).build(),
            reader: Box::new(reader),
        })
    }

    /// Takes in the next records, up to `wanted`; how many there are.
    ///
    /// # Errors
    ///
    /// Why they cannot be decoded.
    pub(super) fn fill(&mut self, wanted: u64) -> Result<u64, String> {
        match self {
            Self::Las { reader, batch } => match guarded(|| reader.fill_points(wanted, batch)) {
                Some(Ok(read)) => Ok(read),
                Some(Err(error)) => Err(error.to_string()),
                None => Err("the decoder gave up".to_owned()),
            },
            Self::Chunks { reader, raw } => reader.fill(wanted, raw),
            Self::Vertices {
                stream,
                layout,
                scale,
                offset,
                raw,
            } => {
                raw.clear();
                for read in 0..wanted {
                    let Some(values) = stream.next()? else {
                        return Ok(read);
                    };
                    if !layout.append(values, *scale, *offset, raw) {
                        return Err("a point is not finite, or out of the bounds".to_owned());
                    }
                }
                Ok(wanted)
            }
        }
    }

    /// The records that were taken in last.
    pub(super) fn raw(&self) -> &[u8] {
        match self {
            Self::Las { batch, .. } => batch.raw_bytes(),
            Self::Chunks { raw, .. } | Self::Vertices { raw, .. } => raw,
        }
    }
}

/// A reader of the LAS or LAZ file at `path`.
pub(super) fn open_las(path: &Path) -> Result<Reader, LasError> {
    let file = File::open(path).map_err(|e| LasError::new(path, format!("cannot be read: {e}")))?;
    // Parts of files are decoded in parallel, by a reader each: the parallel
    // decoder holds whole chunks, and some files are a single one.
    let options = ReaderOptions::default().with_laz_parallelism(LazParallelism::No);
    let open = || Reader::with_options(GuardedFile::new(file)?, options);
    match guarded(open) {
        Some(Ok(reader)) => Ok(reader),
        Some(Err(error)) => Err(LasError::new(
            path,
            format!("cannot be opened: {error}; the file is damaged or truncated"),
        )),
        None => Err(LasError::new(path, "cannot be opened: the file is damaged")),
    }
}

/// Goes on reading at `point`; whether the reader finds it.
pub(super) fn finds(reader: &mut Reader, point: u64) -> bool {
    matches!(guarded(|| reader.seek(point)), Some(Ok(())))
}

/// Reads over the first `points` of a file in which they cannot be jumped over;
/// whether there are so many.
fn skips(input: &InputFile, reader: &mut Reader, points: u64) -> Result<bool, LasError> {
    *reader = open_las(&input.path)?;
    let mut left = points;
    while left > 0 {
        let read = guarded(|| reader.read_points(left.min(input.batch_points())));
        match read {
            Some(Ok(batch)) if !batch.is_empty() => left -= batch.len() as u64,
            _ => return Ok(false),
        }
    }
    Ok(true)
}
