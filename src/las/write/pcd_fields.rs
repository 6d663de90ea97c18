//! The fields of PCD points, and the parts of records that they are made of.

use crate::{
    geometry::{Quantization, Stored},
    las::format::{
        display::DisplayAttributes, extra_bytes::REAL_DATA_TYPE, record::RecordView,
        record_format::RecordFormat,
    },
};

/// Attributes of 32-bit reals with the names that they have in the Point Cloud Library.
const REALS: [(&str, &str); 4] = [
    ("NormalX", "normal_x"),
    ("NormalY", "normal_y"),
    ("NormalZ", "normal_z"),
    ("Curvature", "curvature"),
];

/// A field of PCD points: 32 bits, little endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PcdField {
    /// The coordinate along an axis.
    Coordinate(usize),
    Intensity,
    /// Red, green and blue, eight bits each, in the bits of a real.
    Color,
    /// The class.
    Label,
    /// A real of this name, whose first byte is at this offset of the record.
    Real(&'static str, usize),
}

impl PcdField {
    /// The fields of records of the format `record`.
    pub(super) fn of_format(record: &RecordFormat) -> Vec<Self> {
        let mut fields: Vec<Self> = (0..3).map(Self::Coordinate).collect();
        fields.push(Self::Intensity);
        if record.has_color() {
            fields.push(Self::Color);
        }
        fields.push(Self::Label);
        for (attribute, name) in REALS {
            let mut offset = record.standard_length();
            for extra in &record.extra_bytes {
                if extra.name == attribute && extra.data_type() == REAL_DATA_TYPE {
                    fields.push(Self::Real(name, offset));
                    break;
                }
                offset += extra.length;
            }
        }
        fields
    }

    pub(super) fn name(&self) -> &'static str {
        match *self {
            Self::Coordinate(axis) => ["x", "y", "z"][axis],
            Self::Intensity => "intensity",
            Self::Color => "rgb",
            Self::Label => "label",
            Self::Real(name, _) => name,
        }
    }

    /// The letter of the type: real or unsigned.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Label => "U",
            _ => "F",
        }
    }

    /// The value of `record`, with coordinates by `local`, and colours of a cloud that has none brighter than `brightest`.
    pub(super) fn value(&self, record: &[u8], local: &Quantization, brightest: u16) -> [u8; 4] {
        match *self {
            Self::Coordinate(axis) => {
                let point = Stored::of_record(record);
                let stored = [point.x, point.y, point.z][axis];
                let coordinate = local.offset[axis] + f64::from(stored) * local.scale;
                (coordinate as f32).to_le_bytes()
            }
            Self::Intensity => f32::from(RecordView::new(record).intensity()).to_le_bytes(),
            Self::Color => {
                let attributes = DisplayAttributes::of_record(record, true);
                let [red, green, blue] = attributes.color_in_bytes(brightest);
                [blue, green, red, 0]
            }
            Self::Label => u32::from(RecordView::new(record).classification()).to_le_bytes(),
            Self::Real(_, at) => [record[at], record[at + 1], record[at + 2], record[at + 3]],
        }
    }
}

/// The largest red, green or blue of `records`; zero if they have no colour.
pub(crate) fn brightness(records: &[u8], format: &RecordFormat) -> u16 {
    let brightness = |record| DisplayAttributes::of_record(record, format.has_color()).brightness();
    let records = records.chunks_exact(format.record_length());
    records.map(brightness).max().unwrap_or(0)
}
