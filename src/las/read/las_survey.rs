//! The survey of a LAS, LAZ or COPC file.
//!
//! A header is a claim. Its counts and lengths are checked against the length
//! of the file before anything is allocated by them, and its bounds are never
//! relied on.

use ::las::{Header, Reader, Vlr, copc::CopcHierarchyVlr, point::Format, raw};

use super::{
    guard::guarded,
    input::{EntryPoints, FARTHEST_COORDINATE, InputFile},
    las_reader::{open_las, seek_to_point},
    octree_nodes::assign_nodes,
};
use crate::las::{
    error::LasError,
    format::{
        chunk_table::{CheckedChunks, Chunk, CompressedChunks},
        crs::Crs,
        extra_bytes::{DESCRIPTOR_BYTES, ExtraAttribute, total_length},
        header::CheckedHeader,
        vlr::{CARRIED_RECORDS, EXTRA_BYTES_RECORD, SPECIFICATION_USER, extended_records, text_of},
    },
};
use crate::store::Source;

/// The scales that can be meant, in CRS units: from far below an atom to a planet.
const PLAUSIBLE_SCALES: std::ops::RangeInclusive<f64> = 1e-12..=1e6;

impl InputFile {
    /// Reads the headers of the LAS, LAZ or COPC file `source`.
    ///
    /// # Errors
    ///
    /// If the file is none, cannot be read, or its headers contradict its length.
    pub(super) fn survey_las(source: Source) -> Result<Self, LasError> {
        let CheckedHeader { header, chunks } = CheckedHeader::read(&source)?;
        let CheckedChunks { chunks, room } = chunks;
        let mut input = Self::of_header(source, &header)?;
        let mut reader = open_las(&input.source, &[])?;
        let las = reader.header().clone();
        input.format = *las.point_format();
        input.points_claimed = las.number_of_points();
        let extended = extended_records(&input.source, &header).unwrap_or_else(|| {
            let note = "some extended variable length records cannot be read";
            input.notes.push(note.into());
            Vec::new()
        });
        let vlrs: Vec<&Vlr> = las.all_vlrs().chain(&extended).collect();
        input.take_records(&vlrs);
        input.check_room()?;
        let room = room.or_else(|| input.room_for_more(&header));
        input.notes.extend(room.map(|room| {
            let claimed = input.points_claimed;
            format!(
                "has room for {room} points, and its header states {claimed}; those beyond are not read, unless the \
                 header is repaired"
            )
        }));
        if input.points_claimed == 0 {
            input.notes.push("has no points".into());
        } else {
            input.verify_bounds(&mut reader, &chunks);
        }
        if input.format.has_waveform {
            let note = "wave packets are not carried over";
            input.notes.push(note.into());
        }
        input.entry_points = match chunks {
            CompressedChunks::Layered(chunks) => entry_points_of_chunks(chunks, &las, &extended),
            CompressedChunks::Alike(chunks) => EntryPoints::AlikeChunks(chunks.into()),
            CompressedChunks::Unknown => input
                .find_stride(&mut reader)
                .map_or(EntryPoints::First, EntryPoints::MultiplesOf),
        };
        Ok(input)
    }

    /// An input of which only the public header block is known.
    fn of_header(source: Source, header: &raw::Header) -> Result<Self, LasError> {
        let wrong = |problem: String| LasError::new(source.path(), problem);
        let format = Format::new(header.point_data_record_format)
            .map_err(|e| wrong(format!("unknown point format: {e}")))?;
        let scale = [
            header.x_scale_factor,
            header.y_scale_factor,
            header.z_scale_factor,
        ];
        let offset = [header.x_offset, header.y_offset, header.z_offset];
        let is_sound = scale.iter().all(|s| PLAUSIBLE_SCALES.contains(s))
            && offset.iter().all(|o| o.abs() <= FARTHEST_COORDINATE);
        if !is_sound {
            return Err(wrong(format!(
                "is damaged: its header states a scale of {scale:?} and an offset of {offset:?}; \
                 scales are from {:e} to {:e}, offsets up to {FARTHEST_COORDINATE:e}",
                PLAUSIBLE_SCALES.start(),
                PLAUSIBLE_SCALES.end()
            )));
        }
        let claimed = [
            [header.min_x, header.min_y, header.min_z],
            [header.max_x, header.max_y, header.max_z],
        ];
        Ok(Self {
            path: source.path().to_owned(),
            bytes: source.bytes(),
            source,
            version: [header.version.major, header.version.minor],
            points_claimed: 0,
            bounds_claimed: claimed,
            bounds: claimed,
            scale,
            offset,
            crs: None,
            extra_bytes: Vec::new(),
            carried_records: Vec::new(),
            has_standard_time: header.global_encoding & 1 == 1,
            generating_software: text_of(&header.generating_software),
            notes: Vec::new(),
            points_start: header.offset_to_point_data.into(),
            format,
            entry_points: EntryPoints::First,
            placement: None,
            finest_spacing: None,
        })
    }

    /// Takes the CRS, the extra bytes and the records for the output from `vlrs`.
    fn take_records(&mut self, vlrs: &[&Vlr]) {
        self.crs = Crs::from_vlrs(vlrs.iter().copied());
        let is_carried = |vlr: &&&Vlr| {
            vlr.user_id == SPECIFICATION_USER && CARRIED_RECORDS.contains(&vlr.record_id)
        };
        let carried = vlrs.iter().filter(is_carried);
        self.carried_records = carried.map(|vlr| (*vlr).clone()).collect();
        self.extra_bytes = extra_bytes(vlrs, self.format.extra_bytes.into(), &mut self.notes);
    }

    /// Checks that an uncompressed file is long enough for the points that it claims.
    fn check_room(&self) -> Result<(), LasError> {
        if self.format.is_compressed {
            return Ok(());
        }
        let room = self.bytes.saturating_sub(self.points_start) / u64::from(self.format.len());
        match room < self.points_claimed {
            true => Err(LasError::new(
                &self.path,
                format!(
                    "is truncated: the header says {} points, the file has room for {room}",
                    self.points_claimed
                ),
            )),
            false => Ok(()),
        }
    }

    /// The points for which an uncompressed file has room before its extended records and wave packets, if they are
    /// more than its `header` states.
    fn room_for_more(&self, header: &raw::Header) -> Option<u64> {
        if self.format.is_compressed {
            return None;
        }
        let records = header.evlr.map(|evlr| evlr.start_of_first_evlr);
        let behind = records
            .into_iter()
            .chain(header.start_of_waveform_data_packet_record)
            .filter(|&start| start >= self.points_start);
        let end = behind.fold(self.bytes, u64::min);
        let room = (end - self.points_start) / u64::from(self.format.len());
        (room > self.points_claimed).then_some(room)
    }

    /// The points of a chunk of LAZ, if all chunks are alike and `reader` can seek to the
    /// second one; 1 for LAS.
    fn find_stride(&self, reader: &mut Reader) -> Option<u64> {
        if !self.format.is_compressed {
            return Some(1);
        }
        let compression = reader.header().laz_vlr().ok()?;
        let stride = u64::from(compression.chunk_size());
        // The chunk table may be missing, or damaged.
        (stride > 0
            && stride < self.points_claimed
            && !compression.uses_variable_size_chunks()
            && seek_to_point(reader, stride))
        .then_some(stride)
    }
}

/// The chunks as entry points, with what is known of the octree's nodes if the file is COPC.
fn entry_points_of_chunks(mut chunks: Vec<Chunk>, las: &Header, extended: &[Vlr]) -> EntryPoints {
    let info = las.copc_info_vlr();
    let hierarchy = extended
        .iter()
        .find(|vlr| vlr.is_copc_hierarchy())
        .zip(info.as_ref())
        .and_then(|(vlr, info)| {
            guarded(|| CopcHierarchyVlr::read_from_with(vlr, info).ok()).flatten()
        });
    if let (Some(info), Some(hierarchy)) = (&info, &hierarchy) {
        assign_nodes(&mut chunks, info, hierarchy);
    }
    EntryPoints::Chunks {
        chunks: chunks.into(),
        is_octree: info.is_some(),
    }
}

/// The extra bytes that the records describe, and one more attribute for those that no
/// record does; together they are `length` bytes long.
fn extra_bytes(vlrs: &[&Vlr], length: usize, notes: &mut Vec<String>) -> Vec<ExtraAttribute> {
    let described: Option<Vec<ExtraAttribute>> = vlrs
        .iter()
        .find(|vlr| vlr.user_id == SPECIFICATION_USER && vlr.record_id == EXTRA_BYTES_RECORD)
        .and_then(|vlr| {
            vlr.data
                .chunks_exact(DESCRIPTOR_BYTES)
                .map(ExtraAttribute::from_descriptor)
                .collect()
        });
    let mut extras = described.unwrap_or_default();
    let total = total_length(&extras);
    if total > length {
        notes.push(format!(
            "describes {total} extra bytes to a point, but its points have {length}; the bytes \
             are copied without a name and a type"
        ));
        extras.clear();
    }
    let described = total_length(&extras);
    if described < length {
        extras.push(ExtraAttribute::undescribed(length - described));
    }
    extras
}
