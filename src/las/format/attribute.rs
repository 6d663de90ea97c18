//! Numbers in the records of a run by their names: fields of the point format, and scalar extra bytes.
//!
//! Extra bytes may be stored as whole numbers with a scale and an offset (LAS Specification 1.4 R15, table 24):
//!
//! ```text
//!   value = stored × scale + offset
//!     3  options   bit 0: no-data value, bit 3: scale, bit 4: offset is declared
//!   112  scale     f64
//!   136  offset    f64
//! ```

use super::{
    extra_bytes::ExtraAttribute,
    fields::{
        COLOR, GPS_TIME, INTENSITY, NEAR_INFRARED, POINT_SOURCE, RETURNS, SCAN_ANGLE,
        SCAN_ANGLE_UNIT_IN_DEGREES, USER_DATA,
    },
    record_format::RecordFormat,
};

const OPTIONS: usize = 3;
const SCALE: usize = 112;
const OFFSET: usize = 136;
/// The option that says that the scale is declared.
const DECLARES_SCALE: u8 = 1 << 3;
/// The option that says that the offset is declared.
const DECLARES_OFFSET: u8 = 1 << 4;

/// The fields of all point formats by name.
const FIELDS: [(&str, usize, Encoding); 7] = [
    ("intensity", INTENSITY.start, Encoding::U16),
    ("return_number", RETURNS, Encoding::LowBits),
    ("number_of_returns", RETURNS, Encoding::HighBits),
    ("scan_angle", SCAN_ANGLE.start, Encoding::I16),
    ("gps_time", GPS_TIME.start, Encoding::F64),
    ("point_source", POINT_SOURCE.start, Encoding::U16),
    ("user_data", USER_DATA, Encoding::U8),
];
/// The fields by name that only records with colour have, or with near infrared.
const COLOR_FIELDS: [(&str, usize, Encoding); 4] = [
    ("red", COLOR[0].start, Encoding::U16),
    ("green", COLOR[1].start, Encoding::U16),
    ("blue", COLOR[2].start, Encoding::U16),
    ("nir", NEAR_INFRARED.start, Encoding::U16),
];

/// How a number is stored in a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    /// The four low bits of a byte.
    LowBits,
    /// The four high bits of a byte.
    HighBits,
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

impl Encoding {
    /// The encoding of a scalar data type of extra bytes, by its number (1 to 10).
    fn of_data_type(data_type: u8) -> Option<Self> {
        Some(match data_type {
            1 => Self::U8,
            2 => Self::I8,
            3 => Self::U16,
            4 => Self::I16,
            5 => Self::U32,
            6 => Self::I32,
            7 => Self::U64,
            8 => Self::I64,
            9 => Self::F32,
            10 => Self::F64,
            _ => return None,
        })
    }

    /// The number that is stored at the beginning of `bytes`; `None` if they end before it does.
    #[inline]
    fn read(self, bytes: &[u8]) -> Option<f64> {
        let first = *bytes.first()?;
        Some(match self {
            Self::LowBits => f64::from(first & 15),
            Self::HighBits => f64::from(first >> 4),
            Self::U8 => f64::from(first),
            Self::I8 => f64::from(first.cast_signed()),
            Self::U16 => f64::from(u16::from_le_bytes(*bytes.first_chunk()?)),
            Self::I16 => f64::from(i16::from_le_bytes(*bytes.first_chunk()?)),
            Self::U32 => f64::from(u32::from_le_bytes(*bytes.first_chunk()?)),
            Self::I32 => f64::from(i32::from_le_bytes(*bytes.first_chunk()?)),
            Self::U64 => u64::from_le_bytes(*bytes.first_chunk()?) as f64,
            Self::I64 => i64::from_le_bytes(*bytes.first_chunk()?) as f64,
            Self::F32 => f64::from(f32::from_le_bytes(*bytes.first_chunk()?)),
            Self::F64 => f64::from_le_bytes(*bytes.first_chunk()?),
        })
    }
}

/// A number that all records of a run have.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Attribute {
    /// The offset of its first byte in a record.
    start: usize,
    encoding: Encoding,
    scale: f64,
    offset: f64,
    /// The bytes that stand for a missing number; empty if there are none.
    no_data: Vec<u8>,
}

impl Attribute {
    /// The number in `record`, in its unit: scan angles in degrees, times in seconds, extra bytes as
    /// their scale and offset make them. `None` if it is the no-data value.
    #[inline]
    pub(crate) fn value(&self, record: &[u8]) -> Option<f64> {
        let bytes = record.get(self.start..)?;
        if !self.no_data.is_empty() && bytes.starts_with(&self.no_data) {
            return None;
        }
        Some(self.encoding.read(bytes)? * self.scale + self.offset)
    }

    /// The field of a point format that is stored at `start`.
    fn field(start: usize, encoding: Encoding, scale: f64) -> Self {
        Self {
            start,
            encoding,
            scale,
            offset: 0.0,
            no_data: Vec::new(),
        }
    }

    /// The scalar attribute of extra bytes that is stored at `start`; `None` if `extra` is no scalar.
    fn extra(start: usize, extra: &ExtraAttribute) -> Option<Self> {
        let encoding = Encoding::of_data_type(extra.data_type())?;
        let options = extra.descriptor.get(OPTIONS).copied().unwrap_or(0);
        let declared = |option: u8, start: usize| {
            let bytes = extra.descriptor.get(start..)?.first_chunk()?;
            (options & option != 0).then_some(f64::from_le_bytes(*bytes))
        };
        Some(Self {
            start,
            encoding,
            scale: declared(DECLARES_SCALE, SCALE).unwrap_or(1.0),
            offset: declared(DECLARES_OFFSET, OFFSET).unwrap_or(0.0),
            no_data: match extra.declares_no_data() {
                true => extra.no_data(),
                false => Vec::new(),
            },
        })
    }
}

impl RecordFormat {
    /// The names of the fields that records have, each with its place.
    fn fields(&self) -> impl Iterator<Item = &'static (&'static str, usize, Encoding)> {
        let length = self.standard_length();
        let colors = COLOR_FIELDS.iter();
        FIELDS
            .iter()
            .chain(colors.filter(move |field| field.1 < length))
    }

    /// The scalar extra bytes by name.
    fn scalars(&self) -> impl Iterator<Item = (&str, Attribute)> {
        let mut end = self.standard_length();
        self.extra_bytes.iter().filter_map(move |extra| {
            let start = end;
            end += extra.length;
            Some((extra.name.as_str(), Attribute::extra(start, extra)?))
        })
    }

    /// The number of this name in the records: `intensity`, `return_number`, `number_of_returns`, `scan_angle`,
    /// `gps_time`, `point_source`, `user_data`, `red`, `green`, `blue`, `nir`, or scalar extra bytes. `None` if
    /// records have none of that name.
    pub(crate) fn attribute(&self, name: &str) -> Option<Attribute> {
        let field = self.fields().find(|field| field.0 == name);
        let of_field = field.map(|&(name, start, encoding)| match name {
            "scan_angle" => Attribute::field(start, encoding, SCAN_ANGLE_UNIT_IN_DEGREES),
            _ => Attribute::field(start, encoding, 1.0),
        });
        let mut scalars = self.scalars();
        of_field.or_else(|| Some(scalars.find(|(known, _)| *known == name)?.1))
    }

    /// The names of all numbers that [`attribute`](Self::attribute) finds.
    pub(crate) fn attribute_names(&self) -> Vec<&str> {
        let extra = self.scalars().map(|(name, _)| name);
        self.fields().map(|field| field.0).chain(extra).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::{RecordView, format::fields::scan_angle_units};

    fn format() -> RecordFormat {
        let mut scaled = ExtraAttribute::named("amplitude", 4);
        scaled.descriptor[OPTIONS] = 1 | DECLARES_SCALE | DECLARES_OFFSET;
        scaled.descriptor[40..42].copy_from_slice(&(-9_i16).to_le_bytes());
        scaled.descriptor[SCALE..SCALE + 8].copy_from_slice(&0.01_f64.to_le_bytes());
        scaled.descriptor[OFFSET..OFFSET + 8].copy_from_slice(&5.0_f64.to_le_bytes());
        RecordFormat {
            point_format: 7,
            extra_bytes: vec![
                ExtraAttribute::named("pair", 11),
                scaled,
                ExtraAttribute::undescribed(3),
            ],
        }
    }

    #[test]
    fn attributes_are_where_the_record_has_them() {
        let format = format();
        let mut record = RecordView::new(vec![0; format.record_length()]);
        record.set_intensity(300);
        record.set_single_return();
        record.set_scan_angle(-30.0);
        record.set_gps_time(12.5);
        record.set_color([1, 2, 65_535]);
        record.set_point_source(7);
        let mut record = record.into_bytes();
        record[38..40].copy_from_slice(&150_i16.to_le_bytes());
        let value = |name: &str, record: &[u8]| format.attribute(name)?.value(record);
        assert_eq!(scan_angle_units(-30.0), -5000);
        for (name, expected) in [
            ("intensity", 300.0),
            ("return_number", 1.0),
            ("number_of_returns", 1.0),
            ("scan_angle", -30.0),
            ("gps_time", 12.5),
            ("point_source", 7.0),
            ("user_data", 0.0),
            ("green", 2.0),
            ("blue", 65_535.0),
            ("amplitude", 6.5),
        ] {
            assert_eq!(value(name, &record), Some(expected), "{name}");
        }
        record[38..40].copy_from_slice(&(-9_i16).to_le_bytes());
        assert_eq!(value("amplitude", &record), None);
    }

    #[test]
    fn names_are_those_that_are_found() {
        let format = format();
        assert_eq!(format.attribute("nir"), None);
        assert_eq!(format.attribute("pair"), None);
        assert_eq!(format.attribute(""), None);
        let names = format.attribute_names();
        assert_eq!(names.len(), 11);
        assert!(names.iter().all(|name| format.attribute(name).is_some()));
    }
}
