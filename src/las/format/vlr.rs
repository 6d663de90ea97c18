//! Variable length records: what a file says beside its header.
//!
//! ```text
//!                    record     extended record (EVLR), at the end of the file
//!   reserved         0 .. 2     0 .. 2
//!   user             2 .. 18    2 .. 18
//!   record number   18 .. 20   18 .. 20
//!   length of data  20 .. 22   20 .. 28
//!   description     22 .. 54   28 .. 60
//! ```

use std::{
    io::{self, BufReader, Read, Seek, SeekFrom},
    ops::Range,
};

use ::las::{Vlr, raw};

use crate::store::{Source, SourceReader};

/// The length of the head of a record, in bytes.
pub(super) const VLR_HEAD_BYTES: u64 = 54;
/// The length of the head of an extended record, in bytes.
pub(super) const EVLR_HEAD_BYTES: u64 = 60;
/// The longest data of an extended record that are read: a CRS is a few thousand bytes.
const LONGEST_EVLR_BYTES: u64 = 16 << 20;
/// The most bytes between the records of the header and the points.
const WIDEST_PADDING_BYTES: u64 = 16 << 20;
/// The user of the record that describes the compression of the points.
const COMPRESSION_USER: &str = "laszip encoded";

/// The user of the records that the LAS specification defines.
pub(in crate::las) const SPECIFICATION_USER: &str = "LASF_Spec";
/// The number of the record that describes the extra bytes.
pub(in crate::las) const EXTRA_BYTES_RECORD: u16 = 4;
/// The records of the specification that are as true of the output as of an input: the
/// classification lookup and the text area description (LAS 1.4, section 4.2).
pub(in crate::las) const CARRIED_RECORDS: [u16; 2] = [0, 3];

const USER: Range<usize> = 2..18;
const RECORD_NUMBER: Range<usize> = 18..20;
const LENGTH: Range<usize> = 20..22;
const EXTENDED_LENGTH: Range<usize> = 20..28;
const EXTENDED_DESCRIPTION: Range<usize> = 28..60;

/// Checks that no variable length record reaches into the points, and returns the data of
/// the one that describes how points are compressed.
///
/// # Errors
///
/// A text that says what is wrong with the file.
pub(super) fn check_records(
    file: &mut BufReader<SourceReader>,
    header: &raw::Header,
) -> Result<Option<Vec<u8>>, String> {
    let end = u64::from(header.offset_to_point_data);
    let mut at = u64::from(header.header_size);
    let mut compression = None;
    for number in 0..header.number_of_variable_length_records {
        let unreadable =
            |e: io::Error| format!("variable length record {number} cannot be read: {e}");
        let mut head = [0; VLR_HEAD_BYTES as usize];
        file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        file.read_exact(&mut head).map_err(unreadable)?;
        let length = u16::from_le_bytes([head[LENGTH.start], head[LENGTH.start + 1]]);
        at += VLR_HEAD_BYTES + u64::from(length);
        if at > end {
            return Err(format!(
                "is damaged: variable length record {number} reaches to byte {at}, points start \
                 at {end}"
            ));
        }
        if compression.is_none() && text_of(&head[USER]) == COMPRESSION_USER {
            let mut data = vec![0; length.into()];
            file.read_exact(&mut data).map_err(unreadable)?;
            compression = Some(data);
        }
    }
    if end - at > WIDEST_PADDING_BYTES {
        return Err(format!(
            "is damaged: its records end at byte {at}, and its points start at {end}"
        ));
    }
    Ok(compression)
}

/// Reads the extended records of the file `source`, but those of more than 16 MiB:
/// hierarchies and wave packets may be huge, and are of no use here. Returns `None` if they
/// cannot be read.
pub(in crate::las) fn extended_records(source: &Source, header: &raw::Header) -> Option<Vec<Vlr>> {
    let Some(evlr) = header.evlr else {
        return Some(Vec::new());
    };
    let mut file = source.open(&[]).ok()?;
    let bytes = source.bytes();
    let mut at = evlr.start_of_first_evlr;
    let mut vlrs = Vec::new();
    for _ in 0..evlr.number_of_evlrs {
        let mut head = [0; EVLR_HEAD_BYTES as usize];
        file.seek(SeekFrom::Start(at)).ok()?;
        file.read_exact(&mut head).ok()?;
        let length = u64::from_le_bytes(head[EXTENDED_LENGTH].try_into().ok()?);
        at = at.checked_add(EVLR_HEAD_BYTES)?.checked_add(length)?;
        if at > bytes {
            return None;
        }
        if length <= LONGEST_EVLR_BYTES {
            if !source.keep(at - length..at).ok()? {
                file.expect(at - length..at);
            }
            let mut data = Vec::new();
            file.by_ref().take(length).read_to_end(&mut data).ok()?;
            vlrs.push(Vlr {
                user_id: text_of(&head[USER]),
                record_id: u16::from_le_bytes(head[RECORD_NUMBER].try_into().ok()?),
                description: text_of(&head[EXTENDED_DESCRIPTION]),
                data,
            });
        }
    }
    Some(vlrs)
}

/// The head of an extended record.
///
/// # Panics
///
/// If the user is longer than 16 bytes, or the description than 32.
pub(super) fn extended_head(
    user: &str,
    record_number: u16,
    description: &str,
    length: u64,
) -> [u8; EVLR_HEAD_BYTES as usize] {
    let mut head = [0; EVLR_HEAD_BYTES as usize];
    head[USER][..user.len()].copy_from_slice(user.as_bytes());
    head[RECORD_NUMBER].copy_from_slice(&record_number.to_le_bytes());
    head[EXTENDED_LENGTH].copy_from_slice(&length.to_le_bytes());
    head[EXTENDED_DESCRIPTION][..description.len()].copy_from_slice(description.as_bytes());
    head
}

/// The text in `bytes`, up to the first zero.
pub(in crate::las) fn text_of(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}
