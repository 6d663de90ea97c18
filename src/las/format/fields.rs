//! The fields of the run's record: LAS 1.4 format 6, 7 or 8, and extra bytes.
//!
//! ```text
//!    0  x y z            3 × i32, on the run's quantization
//!   12  intensity        u16
//!   14  returns          return number (4 bits), number of returns (4 bits)
//!   15  flags            synthetic key-point withheld overlap, channel (2),
//!                        scan direction, edge of flight line
//!   16  classification   u8
//!   17  user data        u8
//!   18  scan angle       i16, 0.006°
//!   20  point source     u16
//!   22  GPS time         f64
//!   30  red green blue   3 × u16    (formats 7 and 8)
//!   36  near infrared    u16        (format 8)
//!       extra bytes
//! ```
//!
//! (LAS Specification 1.4 R15, tables 6 to 16.) All numbers are little endian. Wave packets
//! are dropped: the bytes that they refer to are not copied.

use std::ops::Range;

/// The bytes of the coordinates: x, y and z, four bytes each.
pub(in crate::las) const COORDINATES: Range<usize> = 0..12;
/// The bytes of the intensity.
pub(in crate::las) const INTENSITY: Range<usize> = 12..14;
/// The byte of the return number and of the number of returns.
pub(in crate::las) const RETURNS: usize = 14;
/// The byte of the flags.
pub(in crate::las) const FLAGS: usize = 15;
/// The byte of the class.
pub(in crate::las) const CLASSIFICATION: usize = 16;
/// The byte of the user data.
pub(in crate::las) const USER_DATA: usize = 17;
/// The bytes of the scan angle.
pub(in crate::las) const SCAN_ANGLE: Range<usize> = 18..20;
/// The bytes of the point source's number.
pub(in crate::las) const POINT_SOURCE: Range<usize> = 20..22;
/// The bytes of the GPS time.
pub(in crate::las) const GPS_TIME: Range<usize> = 22..30;
/// The bytes of red, of green and of blue, in formats 7 and 8.
pub(in crate::las) const COLOR: [Range<usize>; 3] = [30..32, 32..34, 34..36];
/// The bytes of near infrared, in format 8.
pub(in crate::las) const NEAR_INFRARED: Range<usize> = 36..38;

/// Return 1 of 1, as the byte of the returns says it.
pub(super) const SINGLE_RETURN: u8 = 0x11;
/// The flag of a point that is withheld.
pub(in crate::las) const WITHHELD: u8 = 1 << 2;
/// The unit of the scan angle in degrees.
pub(super) const SCAN_ANGLE_UNIT_IN_DEGREES: f64 = 0.006;

/// The length of a record of `point_format` (6, 7 or 8) without extra bytes, in bytes.
#[inline]
pub(crate) const fn standard_length(point_format: u8) -> usize {
    match point_format {
        6 => GPS_TIME.end,
        7 => COLOR[2].end,
        _ => NEAR_INFRARED.end,
    }
}

/// The scan angle of `degrees` in the units of the record, rounded half away from zero.
#[inline]
pub(in crate::las) fn scan_angle_units(degrees: f64) -> i16 {
    (degrees / SCAN_ANGLE_UNIT_IN_DEGREES).round() as i16
}

/// The coordinates at the beginning of a record of any point format, in its own stored units.
#[inline]
pub(in crate::las) fn coordinates(record: &[u8]) -> [i32; 3] {
    // One check of the length, where twelve would be made byte by byte.
    let bytes: &[u8; COORDINATES.end] = record
        .first_chunk()
        .expect("a record begins with coordinates");
    let coordinate =
        |at: usize| i32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    [coordinate(0), coordinate(4), coordinate(8)]
}

/// A field of 16 bits that can be averaged over several records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AveragedField {
    /// The intensity of the return; every format has it.
    Intensity,
    /// The red of the colour (formats 7 and 8).
    Red,
    /// The green of the colour (formats 7 and 8).
    Green,
    /// The blue of the colour (formats 7 and 8).
    Blue,
    /// The near infrared (format 8).
    NearInfrared,
}

impl AveragedField {
    /// All fields that can be averaged, in the order in which records have them.
    pub(crate) const ALL: [Self; 5] = [
        Self::Intensity,
        Self::Red,
        Self::Green,
        Self::Blue,
        Self::NearInfrared,
    ];

    /// The fields among [`ALL`](Self::ALL) that `point_format` (6, 7 or 8) has: its first one,
    /// four or five.
    #[inline]
    pub(crate) fn of_format(point_format: u8) -> &'static [Self] {
        match point_format {
            6 => &Self::ALL[..1],
            7 => &Self::ALL[..4],
            _ => &Self::ALL,
        }
    }

    /// The offset of the field's first byte in a record.
    #[inline]
    pub(super) const fn offset(self) -> usize {
        match self {
            Self::Intensity => INTENSITY.start,
            Self::Red => COLOR[0].start,
            Self::Green => COLOR[1].start,
            Self::Blue => COLOR[2].start,
            Self::NearInfrared => NEAR_INFRARED.start,
        }
    }
}

/// An extra-bytes attribute of 32-bit reals in the records of a run, by its offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct RealAttribute {
    offset: usize,
}

impl RealAttribute {
    /// The attribute whose first byte is at `offset` of each record.
    pub(super) fn at(offset: usize) -> Self {
        Self { offset }
    }

    /// The offset of the attribute's first byte in a record.
    #[inline]
    pub(super) fn offset(self) -> usize {
        self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_format_averages_only_fields_that_it_has() {
        for format in [6, 7, 8] {
            let fields = AveragedField::of_format(format);
            let is_within = |field: &AveragedField| field.offset() + 2 <= standard_length(format);
            assert!(fields.iter().all(is_within));
            assert_eq!(
                AveragedField::ALL.iter().filter(|f| is_within(f)).count(),
                fields.len()
            );
        }
    }
}
