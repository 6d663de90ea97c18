//! The run's record: LAS 1.4 format 6, 7 or 8, and extra bytes.
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

use crate::geometry::Stored;

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
const SINGLE_RETURN: u8 = 0x11;
/// The flag of a point that is withheld.
pub(in crate::las) const WITHHELD: u8 = 1 << 2;
/// Units of the scan angle in a degree.
const DEGREES_PER_SCAN_ANGLE_UNIT: f64 = 0.006;

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
    (degrees / DEGREES_PER_SCAN_ANGLE_UNIT).round() as i16
}

/// The coordinates at the beginning of a record of any point format, in its own stored units.
#[inline]
pub(in crate::las) fn coordinates(record: &[u8]) -> [i32; 3] {
    [0, 1, 2].map(|axis| {
        let at = COORDINATES.start + 4 * axis;
        i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
    })
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
    const fn offset(self) -> usize {
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
    pub(in crate::las) fn at(offset: usize) -> Self {
        Self { offset }
    }

    /// The offset of the attribute's first byte in a record.
    #[cfg(test)]
    pub(in crate::las) fn offset(self) -> usize {
        self.offset
    }
}

/// A record of the run by its fields.
///
/// The bytes are borrowed, borrowed mutably or an array: `RecordView::new(&mut bytes[..])`.
/// Every accessor panics if the bytes end before its field.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RecordView<B>(B);

impl<B> RecordView<B> {
    /// A view of the record whose bytes are `bytes`.
    #[inline]
    pub(crate) fn new(bytes: B) -> Self {
        Self(bytes)
    }

    /// The bytes of the record.
    #[inline]
    pub(crate) fn into_bytes(self) -> B {
        self.0
    }
}

impl<B: AsRef<[u8]>> RecordView<B> {
    #[inline]
    fn word(&self, offset: usize) -> u16 {
        let bytes = self.0.as_ref();
        u16::from_le_bytes([bytes[offset], bytes[offset + 1]])
    }

    /// The position of the point, in stored units.
    #[inline]
    pub(crate) fn position(&self) -> Stored {
        let [x, y, z] = coordinates(self.0.as_ref());
        Stored { x, y, z }
    }

    /// The intensity of the return.
    #[inline]
    pub(crate) fn intensity(&self) -> u16 {
        self.word(INTENSITY.start)
    }

    /// Whether the point is flagged as withheld.
    #[inline]
    pub(crate) fn is_withheld(&self) -> bool {
        self.0.as_ref()[FLAGS] & WITHHELD != 0
    }

    /// The class of the point, by its ASPRS number.
    #[inline]
    pub(crate) fn classification(&self) -> u8 {
        self.0.as_ref()[CLASSIFICATION]
    }

    /// The GPS time, in seconds: of the week, or adjusted standard time.
    #[inline]
    pub(crate) fn gps_time(&self) -> f64 {
        let bytes = &self.0.as_ref()[GPS_TIME];
        f64::from_le_bytes(bytes.try_into().expect("the GPS time is eight bytes long"))
    }

    /// Red, green and blue; only records of formats 7 and 8 have them.
    #[inline]
    pub(crate) fn color(&self) -> [u16; 3] {
        [0, 1, 2].map(|channel| self.word(COLOR[channel].start))
    }

    /// The value of a field that can be averaged; the record's format has to have it
    /// (see [`AveragedField::of_format`]).
    #[inline]
    pub(crate) fn averaged(&self, field: AveragedField) -> u16 {
        self.word(field.offset())
    }
}

impl<B: AsRef<[u8]> + AsMut<[u8]>> RecordView<B> {
    #[inline]
    fn put<const N: usize>(&mut self, offset: usize, bytes: [u8; N]) {
        self.0.as_mut()[offset..offset + N].copy_from_slice(&bytes);
    }

    /// Sets the position of the point, in stored units.
    #[inline]
    pub(crate) fn set_position(&mut self, position: Stored) {
        for (axis, c) in [position.x, position.y, position.z].into_iter().enumerate() {
            self.put(COORDINATES.start + 4 * axis, c.to_le_bytes());
        }
    }

    /// Sets the intensity of the return.
    #[inline]
    pub(crate) fn set_intensity(&mut self, intensity: u16) {
        self.put(INTENSITY.start, intensity.to_le_bytes());
    }

    /// Says that the point is return 1 of 1: points that no pulse has returned are that, too.
    #[inline]
    pub(crate) fn set_single_return(&mut self) {
        self.0.as_mut()[RETURNS] = SINGLE_RETURN;
    }

    /// Sets the class of the point, by its ASPRS number.
    #[inline]
    pub(crate) fn set_classification(&mut self, class: u8) {
        self.0.as_mut()[CLASSIFICATION] = class;
    }

    /// Sets the scan angle; `degrees` are rounded to multiples of 0.006°.
    #[inline]
    pub(crate) fn set_scan_angle(&mut self, degrees: f64) {
        self.put(SCAN_ANGLE.start, scan_angle_units(degrees).to_le_bytes());
    }

    /// Sets the number of the flight line, pass or station that the point is from.
    #[inline]
    pub(crate) fn set_point_source(&mut self, source: u16) {
        self.put(POINT_SOURCE.start, source.to_le_bytes());
    }

    /// Sets the GPS time, in seconds.
    #[inline]
    pub(crate) fn set_gps_time(&mut self, seconds: f64) {
        self.put(GPS_TIME.start, seconds.to_le_bytes());
    }

    /// Sets red, green and blue; only records of formats 7 and 8 have them.
    #[inline]
    pub(crate) fn set_color(&mut self, color: [u16; 3]) {
        for (range, channel) in COLOR.into_iter().zip(color) {
            self.put(range.start, channel.to_le_bytes());
        }
    }

    /// Sets a field that can be averaged; the record's format has to have it (see
    /// [`AveragedField::of_format`]).
    #[inline]
    pub(crate) fn set_averaged(&mut self, field: AveragedField, value: u16) {
        self.put(field.offset(), value.to_le_bytes());
    }

    /// Sets an extra-bytes attribute to `value`, rounded to single precision.
    #[inline]
    pub(crate) fn set_real(&mut self, attribute: RealAttribute, value: f64) {
        self.put(attribute.offset, (value as f32).to_le_bytes());
    }

    /// Moves the point to `position`, as return 1 of 1: no pulse was returned there.
    #[inline]
    pub(crate) fn move_to(&mut self, position: Stored) {
        self.set_position(position);
        self.set_single_return();
    }
}

impl Stored {
    /// The position of the point that `record` describes: its first twelve bytes, x, y and z,
    /// little endian.
    ///
    /// # Panics
    ///
    /// If the record is shorter than twelve bytes.
    #[inline]
    pub fn of_record(record: &[u8]) -> Self {
        RecordView::new(record).position()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_is_where_the_specification_has_it() {
        let mut record = RecordView::new([0_u8; 38]);
        let position = Stored { x: 1, y: -2, z: 3 };
        record.move_to(position);
        record.set_intensity(0x0102);
        record.set_classification(6);
        record.set_scan_angle(-30.0);
        record.set_point_source(777);
        record.set_gps_time(9.5);
        record.set_color([10, 20, 30]);
        record.set_averaged(AveragedField::NearInfrared, 40);
        assert_eq!(record.position(), position);
        assert_eq!(record.intensity(), 0x0102);
        assert_eq!(record.classification(), 6);
        assert_eq!(record.gps_time(), 9.5);
        assert_eq!(record.color(), [10, 20, 30]);
        let values = AveragedField::ALL.map(|field| record.averaged(field));
        assert_eq!(values, [0x0102, 10, 20, 30, 40]);
        assert!(!record.is_withheld());
        let bytes = record.into_bytes();
        assert_eq!(
            bytes[..12],
            [1, 0, 0, 0, 0xfe, 0xff, 0xff, 0xff, 3, 0, 0, 0]
        );
        assert_eq!(bytes[12..18], [2, 1, 0x11, 0, 6, 0]);
        assert_eq!(bytes[18..20], (-5000_i16).to_le_bytes());
        assert_eq!(bytes[20..22], 777_u16.to_le_bytes());
        assert_eq!(bytes[22..30], 9.5_f64.to_le_bytes());
        assert_eq!(bytes[30..], [10, 0, 20, 0, 30, 0, 40, 0]);
    }

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
