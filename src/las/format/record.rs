//! A record of the run, read and written by its fields.

use super::fields::{
    AveragedField, CLASSIFICATION, COLOR, COORDINATES, FLAGS, GPS_TIME, INTENSITY, POINT_SOURCE,
    RETURNS, RealAttribute, SCAN_ANGLE, SINGLE_RETURN, WITHHELD, coordinates, scan_angle_units,
};
use crate::geometry::Stored;

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

    /// The value of an extra-bytes attribute.
    #[inline]
    pub(crate) fn real(&self, attribute: RealAttribute) -> f32 {
        let bytes = &self.0.as_ref()[attribute.offset()..attribute.offset() + 4];
        f32::from_le_bytes(bytes.try_into().expect("a real is four bytes long"))
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
        self.put(attribute.offset(), (value as f32).to_le_bytes());
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
}
