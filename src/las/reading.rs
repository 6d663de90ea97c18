//! From files to the run's records.
//!
//! A header is a claim. Its counts and lengths are checked against the length
//! of the file before anything is allocated by them, its bounds are never
//! relied on.

use std::{
    ops::Range,
    path::{Path, PathBuf},
    sync::Arc,
};

use ::las::{Reader, Vlr, copc::CopcHierarchyVlr, point::Format};

#[cfg(feature = "e57")]
use super::e57::E57File;
use super::{
    Crs, ExtraByte, LasError, PlyFile, PointFilter, RecordFormat,
    chunks::{Chunk, place_chunks},
    decoding::{Decoder, finds, open_las},
    guard::guarded,
    header::{extended_records, read_header, text_of},
    record::{Converter, DESCRIPTOR_BYTES},
};
use crate::{geometry::Quantization, tile::PointCounts};

/// Points decoded at a time …
const BATCH: u64 = 65_536;
/// … unless they are long: bytes decoded at a time.
const BATCH_BYTES: u64 = 4 << 20;
/// Scales that can be meant, in CRS units: from far below an atom to a planet.
const SCALES: std::ops::RangeInclusive<f64> = 1e-12..=1e6;
/// The farthest offset that can be meant, likewise.
pub(super) const FARTHEST_OFFSET: f64 = 1e12;
/// Classification lookup and text area description (LAS 1.4, section 4.2).
const KEPT_RECORDS: [u16; 2] = [0, 3];
/// Parts of a file at the most.
const MOST_PARTS: u64 = 4096;

/// What the headers of a file say.
#[derive(Clone, Debug)]
pub(crate) struct InputFile {
    /// Where it is.
    pub(crate) path: PathBuf,
    /// Its length in bytes.
    pub(crate) bytes: u64,
    /// LAS version: major and minor.
    pub(crate) version: [u8; 2],
    /// Points it claims to hold.
    pub(crate) points_claimed: u64,
    /// Bounds it claims, in world coordinates: min, max.
    pub(crate) bounds_claimed: [[f64; 3]; 2],
    /// The same where the claim can be true, else those of the points.
    pub(crate) bounds: [[f64; 3]; 2],
    /// Scale of its coordinates.
    pub(crate) scale: [f64; 3],
    /// Offset of its coordinates.
    pub(crate) offset: [f64; 3],
    /// Its coordinate reference system, if it states one.
    pub(crate) crs: Option<Crs>,
    /// Its extra bytes, in order.
    pub(crate) extra_bytes: Vec<ExtraByte>,
    /// Records that are as true of the output: what classes are called, and the text that
    /// describes the area.
    pub(crate) kept_records: Vec<Vlr>,
    /// Whether GPS times are adjusted standard times, not seconds of the week.
    pub(crate) has_standard_time: bool,
    /// The program that wrote it.
    pub(crate) generating_software: String,
    /// What is odd about it.
    pub(crate) notes: Vec<String>,
    pub(super) format: Format,
    pub(super) access: Access,
}

/// Where reading can begin, and how it is done.
#[derive(Clone, Debug)]
pub(super) enum Access {
    /// At its first point only.
    Start,
    /// After so many points, again and again.
    Stride(u64),
    /// At these chunks.
    Chunks {
        chunks: Arc<[Chunk]>,
        /// Whether they are the nodes of an octree.
        is_octree: bool,
    },
    /// A polygon file, from its first vertex.
    Ply(PlyFile),
    /// An E57 file, from its first point.
    #[cfg(feature = "e57")]
    E57(E57File),
}

impl InputFile {
    /// Reads the headers of the file at `path`.
    ///
    /// # Errors
    ///
    /// If there is no such file, it cannot be read, is neither a LAS or LAZ file of
    /// version 1.0 to 1.4 nor, by its name, PLY or E57, or says what cannot be.
    pub(crate) fn survey(path: &Path) -> Result<Self, LasError> {
        let wrong = |problem: String| LasError::new(path, problem);
        let metadata =
            std::fs::metadata(path).map_err(|e| wrong(format!("cannot be read: {e}")))?;
        if !metadata.is_file() {
            return Err(wrong("is not a regular file".into()));
        }
        let bytes = metadata.len();
        match path.extension().map(|e| e.to_ascii_lowercase()) {
            Some(e) if e == "ply" => return Self::survey_ply(path, bytes),
            #[cfg(feature = "e57")]
            Some(e) if e == "e57" => return Self::survey_e57(path, bytes),
            #[cfg(not(feature = "e57"))]
            Some(e) if e == "e57" => {
                let problem = "is E57, which this program was built without; build it with \
                               --features e57, or convert the file to LAZ";
                return Err(wrong(problem.into()));
            }
            _ => {}
        }
        let (header, chunks) = read_header(path, bytes)?;
        let format = Format::new(header.point_data_record_format)
            .map_err(|e| wrong(format!("unknown point format: {e}")))?;
        let scale = [
            header.x_scale_factor,
            header.y_scale_factor,
            header.z_scale_factor,
        ];
        let offset = [header.x_offset, header.y_offset, header.z_offset];
        let is_sound = scale.iter().all(|s| SCALES.contains(s))
            && offset.iter().all(|o| o.abs() <= FARTHEST_OFFSET);
        if !is_sound {
            return Err(wrong(format!(
                "a scale of {scale:?} with an offset of {offset:?} places no point; \
                 the header is damaged"
            )));
        }

        let claimed = [
            [header.min_x, header.min_y, header.min_z],
            [header.max_x, header.max_y, header.max_z],
        ];
        let mut input = Self {
            path: path.to_owned(),
            bytes,
            version: [header.version.major, header.version.minor],
            points_claimed: 0,
            bounds_claimed: claimed,
            bounds: claimed,
            scale,
            offset,
            crs: None,
            extra_bytes: Vec::new(),
            kept_records: Vec::new(),
            has_standard_time: header.global_encoding & 1 == 1,
            generating_software: text_of(&header.generating_software),
            notes: Vec::new(),
            format,
            access: Access::Start,
        };
        let mut reader = open_las(path)?;
        let las = reader.header().clone();
        input.format = *las.point_format();
        input.points_claimed = las.number_of_points();
        let extended = extended_records(path, &header).unwrap_or_else(|| {
            input
                .notes
                .push("some extended variable length records cannot be read".into());
            Vec::new()
        });
        let vlrs: Vec<&Vlr> = las.all_vlrs().chain(&extended).collect();
        input.crs = Crs::from_vlrs(vlrs.iter().copied());
        let is_kept =
            |vlr: &&&Vlr| vlr.user_id == "LASF_Spec" && KEPT_RECORDS.contains(&vlr.record_id);
        input.kept_records = vlrs
            .iter()
            .filter(is_kept)
            .map(|vlr| (*vlr).clone())
            .collect();
        input.extra_bytes = extra_bytes(&vlrs, input.format.extra_bytes.into(), &mut input.notes);
        if !input.format.is_compressed {
            let record = u64::from(input.format.len());
            let held = bytes.saturating_sub(header.offset_to_point_data.into()) / record;
            if held < input.points_claimed {
                return Err(wrong(format!(
                    "is truncated: the header says {} points, the file has room for {held}",
                    input.points_claimed
                )));
            }
        }
        if input.points_claimed == 0 {
            input.notes.push("holds no point".into());
        } else if let Some(first) = input.bounds_of_next(&mut reader, 1)
            && !input.may_claim(&first)
        {
            input.bounds = input.bounds_of_points(first, &mut reader);
            input
                .notes
                .push("the bounds in its header are not those of its points".into());
        }
        if input.format.has_waveform {
            input.notes.push("wave packets are not carried over".into());
        }
        input.access = match chunks {
            Some(mut chunks) => {
                let info = las.copc_info_vlr();
                let table = extended
                    .iter()
                    .find(|vlr| vlr.is_copc_hierarchy())
                    .zip(info.as_ref())
                    .and_then(|(vlr, info)| {
                        guarded(|| CopcHierarchyVlr::read_from_with(vlr, info).ok()).flatten()
                    });
                if let (Some(info), Some(table)) = (&info, &table) {
                    place_chunks(&mut chunks, info, table);
                }
                Access::Chunks {
                    chunks: chunks.into(),
                    is_octree: info.is_some(),
                }
            }
            None => input
                .find_stride(&mut reader)
                .map_or(Access::Start, Access::Stride),
        };
        Ok(input)
    }

    /// A lattice for the points of all `inputs`, as fine as the finest of theirs.
    pub(crate) fn common_quantization<'a>(inputs: impl Iterator<Item = &'a Self>) -> Quantization {
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let mut scale = f64::INFINITY;
        for input in inputs {
            for axis in 0..3 {
                min[axis] = min[axis].min(input.bounds[0][axis]);
                max[axis] = max[axis].max(input.bounds[1][axis]);
                scale = scale.min(input.scale[axis]);
            }
        }
        Quantization::around(min, max, scale)
    }

    /// Its chunks, if they differ in length.
    pub(super) fn chunks(&self) -> Option<&[Chunk]> {
        match &self.access {
            Access::Chunks { chunks, .. } => Some(chunks),
            _ => None,
        }
    }

    /// What kind of file it is, as people call it.
    pub(crate) fn kind(&self) -> &'static str {
        match &self.access {
            Access::Ply(_) => "PLY",
            #[cfg(feature = "e57")]
            Access::E57(_) => "E57",
            Access::Chunks {
                is_octree: true, ..
            } => "COPC",
            _ if self.format.is_compressed => "LAZ",
            _ => "LAS",
        }
    }

    /// The points of a chunk of LAZ, if all chunks are alike and `reader` finds them.
    fn find_stride(&self, reader: &mut Reader) -> Option<u64> {
        if !self.format.is_compressed {
            return Some(1);
        }
        let records = reader.header().laz_vlr().ok()?;
        let stride = u64::from(records.chunk_size());
        // The chunk table may be missing, or damaged.
        (stride > 0
            && stride < self.points_claimed
            && !records.uses_variable_size_chunks()
            && finds(reader, stride))
        .then_some(stride)
    }

    /// Its points in parts that can be read apart from each other, each of about
    /// `points`; without those of an octree of which `filter` wants none.
    pub(crate) fn parts(&self, points: u64, filter: &PointFilter) -> Vec<Range<u64>> {
        let all = self.points_claimed;
        // The claim may be a lie: it must not say how much is allocated.
        let points = points.max(all.div_ceil(MOST_PARTS));
        let length = match &self.access {
            Access::Stride(stride) => points.div_ceil(*stride).saturating_mul(*stride),
            Access::Chunks { chunks, .. } => return parts_of(chunks, points, all, filter),
            _ => all,
        };
        let starts = (0..all.max(1)).step_by(usize::try_from(length.max(1)).unwrap_or(usize::MAX));
        starts
            .map(|start| start..start.saturating_add(length).min(all))
            .collect()
    }

    /// Points that are decoded at a time.
    pub(super) fn batch_points(&self) -> u64 {
        BATCH.min(BATCH_BYTES / u64::from(self.format.len())).max(1)
    }

    /// Whether the header's bounds can be true of a file with a point at
    /// `first`.
    fn may_claim(&self, first: &[[f64; 3]; 2]) -> bool {
        let [min, max] = self.bounds_claimed;
        (0..3).all(|axis| {
            let (scale, offset) = (self.scale[axis], self.offset[axis]);
            let range =
                (offset + f64::from(i32::MIN) * scale)..=(offset + f64::from(i32::MAX) * scale);
            // Written so that NaN fails.
            range.contains(&min[axis])
                && range.contains(&max[axis])
                && min[axis] <= first[0][axis] + 1.5 * scale
                && max[axis] >= first[1][axis] - 1.5 * scale
        })
    }

    /// Bounds of `first` and all points that `reader` still gives.
    fn bounds_of_points(&self, first: [[f64; 3]; 2], reader: &mut Reader) -> [[f64; 3]; 2] {
        let mut bounds = first;
        while let Some([min, max]) = self.bounds_of_next(reader, self.batch_points()) {
            for axis in 0..3 {
                bounds[0][axis] = bounds[0][axis].min(min[axis]);
                bounds[1][axis] = bounds[1][axis].max(max[axis]);
            }
        }
        bounds
    }

    /// Bounds of the next points, up to `wanted`; `None` at the end and where
    /// the file is damaged, which is told when it is read.
    fn bounds_of_next(&self, reader: &mut Reader, wanted: u64) -> Option<[[f64; 3]; 2]> {
        let read = guarded(|| reader.read_points(wanted));
        let batch = read?.ok().filter(|batch| !batch.is_empty())?;
        let mut bounds = [[i32::MAX; 3], [i32::MIN; 3]];
        for raw in batch.raw_bytes().chunks_exact(batch.record_len()) {
            for (axis, stored) in stored(raw).into_iter().enumerate() {
                bounds[0][axis] = bounds[0][axis].min(stored);
                bounds[1][axis] = bounds[1][axis].max(stored);
            }
        }
        Some(bounds.map(|corner| {
            [0, 1, 2].map(|axis| self.offset[axis] + f64::from(corner[axis]) * self.scale[axis])
        }))
    }

    /// The format of its points.
    pub(crate) fn format(&self) -> Format {
        self.format
    }

    /// Number of the format, as in the specification.
    pub(crate) fn format_number(&self) -> u8 {
        let mut plain = self.format;
        plain.is_compressed = false;
        plain.to_u8().unwrap_or(u8::MAX)
    }
}

/// The extra bytes that the records describe, and one more for those that no
/// record does.
fn extra_bytes(vlrs: &[&Vlr], length: usize, notes: &mut Vec<String>) -> Vec<ExtraByte> {
    let described: Option<Vec<ExtraByte>> = vlrs
        .iter()
        .find(|vlr| vlr.user_id == "LASF_Spec" && vlr.record_id == 4)
        .and_then(|vlr| {
            vlr.data
                .chunks_exact(DESCRIPTOR_BYTES)
                .map(ExtraByte::from_descriptor)
                .collect()
        });
    let mut extras = described.unwrap_or_default();
    let total: usize = extras.iter().map(|extra| extra.length).sum();
    if total > length {
        notes.push(format!(
            "describes {total} extra bytes and has {length}; they are carried undescribed"
        ));
        extras.clear();
    }
    let described: usize = extras.iter().map(|extra| extra.length).sum();
    if described < length {
        extras.push(ExtraByte::undescribed(length - described));
    }
    extras
}

/// Runs of `chunks` that are wanted, each of about `points` of the first `all`.
fn parts_of(chunks: &[Chunk], points: u64, all: u64, filter: &PointFilter) -> Vec<Range<u64>> {
    let mut parts: Vec<Range<u64>> = Vec::new();
    let mut start = 0;
    for chunk in chunks {
        let end = all.min(start + chunk.points);
        let is_wanted = chunk
            .ground
            .is_none_or(|[min, max]| filter.may_keep(min, max));
        if is_wanted && end > start {
            match parts.last_mut() {
                Some(last) if last.end == start && last.end - last.start < points => last.end = end,
                _ => parts.push(start..end),
            }
        }
        start = end;
    }
    parts
}

/// The points of a part of a file, as records of the run.
#[allow(missing_debug_implementations, reason = "the reader inside has none")]
pub(crate) struct PointStream {
    path: PathBuf,
    decoder: Decoder,
    record_length: usize,
    converter: Converter,
    filter: PointFilter,
    part: Range<u64>,
    claimed: u64,
    /// Points read so far, and at a time.
    read: u64,
    batch_points: u64,
    /// Bounds that the header claims, in the file's own stored units.
    bounds: [[f64; 3]; 2],
}

impl PointStream {
    /// Opens a `part` of `input`, to be read as `record` on `lattice` where `filter`
    /// wants it.
    ///
    /// # Errors
    ///
    /// If the file cannot be opened (any more), or the part not be found in it.
    pub(crate) fn open(
        input: &InputFile,
        part: Range<u64>,
        record: &RecordFormat,
        quantization: Quantization,
        filter: &PointFilter,
    ) -> Result<Self, LasError> {
        Ok(Self {
            path: input.path.clone(),
            decoder: Decoder::open(input, &part)?,
            record_length: input.format.len().into(),
            converter: Converter::new(input, record, quantization),
            filter: filter.clone(),
            part,
            claimed: input.points_claimed,
            read: 0,
            batch_points: input.batch_points(),
            bounds: input.bounds.map(|corner| {
                [0, 1, 2].map(|axis| (corner[axis] - input.offset[axis]) / input.scale[axis])
            }),
        })
    }

    /// Replaces `records` by the next ones and says what points were read, rejected
    /// ones included; none at the end.
    ///
    /// # Errors
    ///
    /// If the file ends early or cannot be decoded.
    pub(crate) fn next_batch(&mut self, records: &mut Vec<u8>) -> Result<PointCounts, LasError> {
        records.clear();
        let mut counts = PointCounts::default();
        let wanted = self
            .batch_points
            .min(self.part.end - self.part.start - self.read);
        if wanted == 0 {
            return Ok(counts);
        }
        let read = match self.decoder.fill(wanted) {
            Ok(read) if read > 0 => read,
            Ok(_) => return Err(self.broken("no more points")),
            Err(why) => return Err(self.broken(&why)),
        };
        let is_filtered = !self.filter.is_empty();
        for raw in self.decoder.raw().chunks_exact(self.record_length) {
            let start = records.len();
            if !self.converter.convert(raw, records) {
                counts.rejected += 1;
            } else if is_filtered
                && !self
                    .filter
                    .keeps(&records[start..], &self.converter.world(raw))
            {
                records.truncate(start);
                counts.filtered += 1;
            }
            counts.outside += u64::from(!is_within(raw, &self.bounds));
        }
        counts.read = read;
        self.read += read;
        Ok(counts)
    }

    fn broken(&self, why: &str) -> LasError {
        LasError::new(
            &self.path,
            format!(
                "is truncated or damaged after point {} of {}: {why}",
                self.part.start + self.read,
                self.claimed
            ),
        )
    }
}

/// The coordinates of a record, as stored.
fn stored(raw: &[u8]) -> [i32; 3] {
    [0, 4, 8].map(|at| i32::from_le_bytes([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]]))
}

/// Whether a record lies within `bounds`, give or take the rounding of a
/// header that was written in decimals.
fn is_within(raw: &[u8], bounds: &[[f64; 3]; 2]) -> bool {
    stored(raw).into_iter().enumerate().all(|(axis, stored)| {
        (bounds[0][axis] - 1.5..=bounds[1][axis] + 1.5).contains(&f64::from(stored))
    })
}
