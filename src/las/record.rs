//! The run's record: LAS 1.4 format 6, 7 or 8, and extra bytes.
//!
//! ```text
//!    0  x y z            3 × i32, on the run's quantization
//!   12  intensity        u16
//!   14  returns          number (4 bits), of how many (4 bits)
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
//! (LAS Specification 1.4 R15, tables 6 to 16.) Wave packets are dropped: what
//! they point to is not copied.

use serde::{Deserialize, Serialize};

use super::{
    InputFile, LasError,
    format::record::{AveragedField, RealAttribute, RecordView, scan_angle_units, standard_length},
};
use crate::geometry::Quantization;

/// An extra-bytes attribute.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct ExtraByte {
    /// Its name.
    pub(crate) name: String,
    /// Its length in bytes.
    pub(crate) length: usize,
    /// The 192 bytes of the specification that describe it; empty for bytes
    /// that no record describes.
    pub(crate) descriptor: Vec<u8>,
}

/// Length of a descriptor (LAS 1.4, table 24).
pub(super) const DESCRIPTOR_BYTES: usize = 192;

impl ExtraByte {
    /// Reads one descriptor.
    pub(super) fn from_descriptor(descriptor: &[u8]) -> Option<Self> {
        let data_type = *descriptor.get(2)?;
        // 1 to 10 are u8, i8, u16, i16, u32, i32, u64, i64, f32, f64; 11 to 30
        // are pairs and triples of them (deprecated, still met); 0 is as many
        // opaque bytes as the options say.
        let single = |t: u8| [1, 1, 2, 2, 4, 4, 8, 8, 4, 8][usize::from(t - 1) % 10];
        let length = match data_type {
            0 => usize::from(*descriptor.get(3)?),
            1..=30 => single(data_type) * (usize::from(data_type - 1) / 10 + 1),
            _ => return None,
        };
        let name = descriptor.get(4..36)?;
        let end = name.iter().position(|&b| b == 0).unwrap_or(name.len());
        Some(Self {
            name: String::from_utf8_lossy(&name[..end]).into_owned(),
            length,
            descriptor: descriptor.get(..DESCRIPTOR_BYTES)?.to_vec(),
        })
    }

    /// One of this name and type (LAS 1.4, table 25).
    pub(super) fn named(name: &str, data_type: u8) -> Self {
        let mut descriptor = vec![0; DESCRIPTOR_BYTES];
        descriptor[2] = data_type;
        let name: Vec<u8> = name.bytes().take(32).collect();
        descriptor[4..4 + name.len()].copy_from_slice(&name);
        Self::from_descriptor(&descriptor).unwrap_or_else(|| Self::undescribed(0))
    }

    /// Bytes that no record describes.
    pub(super) fn undescribed(length: usize) -> Self {
        Self {
            name: String::new(),
            length,
            descriptor: Vec::new(),
        }
    }

    /// What stands where an input lacks the attribute: its no-data value if it
    /// declares one, else zeros.
    fn absent(&self) -> Vec<u8> {
        let declares = self
            .descriptor
            .get(3)
            .is_some_and(|options| options & 1 != 0)
            && self
                .descriptor
                .get(2)
                .is_some_and(|&t| (1..=10).contains(&t));
        if declares {
            self.descriptor[40..40 + self.length].to_vec()
        } else {
            vec![0; self.length]
        }
    }
}

/// Format of all records of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct RecordFormat {
    /// LAS point format: 6, 7 or 8.
    pub(crate) point_format: u8,
    /// Extra bytes, in order: those that no record describes last, as there is nothing
    /// that would say how long they are.
    pub(crate) extra_bytes: Vec<ExtraByte>,
}

impl RecordFormat {
    /// The format that loses nothing of `inputs`: 8 if one has near infrared,
    /// 7 if one has colour, else 6; extra bytes of all, by name, of those without one as
    /// many as the input has that has most.
    ///
    /// # Errors
    ///
    /// If two inputs give one name to attributes of different types.
    pub(crate) fn for_inputs(inputs: &[InputFile]) -> Result<Self, LasError> {
        let point_format = inputs
            .iter()
            .map(|input| {
                let format = input.format();
                6 + u8::from(format.has_color) + u8::from(format.has_nir)
            })
            .max()
            .unwrap_or(6);
        let mut extra_bytes: Vec<ExtraByte> = Vec::new();
        let mut undescribed = 0;
        for input in inputs {
            for extra in &input.extra_bytes {
                if extra.descriptor.is_empty() {
                    undescribed = undescribed.max(extra.length);
                    continue;
                }
                match extra_bytes.iter().find(|known| known.name == extra.name) {
                    Some(known) if known.length == extra.length => {}
                    Some(known) => {
                        return Err(LasError::new(
                            &input.path,
                            format!(
                                "its extra bytes `{}` are {} bytes long, those of an earlier \
                                 input {}; convert one of them first",
                                extra.name, extra.length, known.length
                            ),
                        ));
                    }
                    None => extra_bytes.push(extra.clone()),
                }
            }
        }
        if undescribed > 0 {
            extra_bytes.push(ExtraByte::undescribed(undescribed));
        }
        Ok(Self {
            point_format,
            extra_bytes,
        })
    }

    /// Adds an extra-bytes attribute of 32-bit reals, unless there is one of that name and
    /// type already, and returns the attribute.
    pub(crate) fn add_real(&mut self, name: &str, description: &str) -> RealAttribute {
        const REAL: u8 = 9;
        let mut at = self.standard_length();
        for known in self.described() {
            if known.name == name && known.descriptor[2] == REAL {
                return RealAttribute::at(at);
            }
            at += known.length;
        }
        let mut added = ExtraByte::named(name, REAL);
        let text = description.as_bytes();
        added.descriptor[160..160 + text.len()].copy_from_slice(text);
        self.extra_bytes.insert(self.described().count(), added);
        RealAttribute::at(at)
    }

    /// The extra bytes that a record describes.
    fn described(&self) -> impl Iterator<Item = &ExtraByte> {
        let is_described = |extra: &&ExtraByte| !extra.descriptor.is_empty();
        self.extra_bytes.iter().filter(is_described)
    }

    /// Length of what comes before the bytes that nothing describes.
    pub(crate) fn described_length(&self) -> usize {
        let lengths = self.described().map(|extra| extra.length);
        self.standard_length() + lengths.sum::<usize>()
    }

    /// Length of the standard part of a record in bytes.
    pub(crate) fn standard_length(&self) -> usize {
        standard_length(self.point_format)
    }

    /// Length of the extra bytes of a record.
    pub(crate) fn extra_length(&self) -> usize {
        self.extra_bytes.iter().map(|extra| extra.length).sum()
    }

    /// Length of a record in bytes.
    pub(crate) fn record_length(&self) -> usize {
        self.standard_length() + self.extra_length()
    }

    /// The fields of the records that can be averaged: the first of [`AveragedField::ALL`].
    pub(crate) fn averaged_fields(&self) -> &'static [AveragedField] {
        AveragedField::of_format(self.point_format)
    }

    /// Whether records have colour.
    pub(crate) fn has_color(&self) -> bool {
        self.point_format >= 7
    }
}

/// What of a record meets the eye.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DisplayAttributes {
    /// Intensity of the return.
    pub(crate) intensity: u16,
    /// Red, green and blue; zeros where records have none.
    pub(crate) color: [u16; 3],
    /// Class.
    pub(crate) class: u8,
}

impl DisplayAttributes {
    /// That of `record`, of a format with colour or without.
    ///
    /// # Panics
    ///
    /// If the record is shorter than the standard's.
    pub(crate) fn of_record(record: &[u8], has_color: bool) -> Self {
        let record = RecordView::new(record);
        Self {
            intensity: record.intensity(),
            color: match has_color {
                true => record.color(),
                false => [0; 3],
            },
            class: record.classification(),
        }
    }

    /// The colour in eight bits, of a cloud whose `brightest` value is this: some write
    /// eight bits into sixteen.
    pub(crate) fn color_in_bytes(&self, brightest: u16) -> [u8; 3] {
        let shift = if brightest > 255 { 8 } else { 0 };
        self.color.map(|c| (c >> shift) as u8)
    }

    /// The largest of red, green and blue.
    pub(crate) fn brightness(&self) -> u16 {
        let [red, green, blue] = self.color;
        red.max(green).max(blue)
    }
}

/// Where an extra-bytes attribute of the run comes from.
#[derive(Clone, Debug)]
enum ExtraSource {
    Copied {
        from: usize,
        length: usize,
        /// Zeros that follow.
        padding: usize,
    },
    Absent(Vec<u8>),
}

/// Turns the records of one input into the run's.
#[derive(Clone, Debug)]
pub(super) struct Converter {
    quantization: Quantization,
    scale: [f64; 3],
    offset: [f64; 3],
    is_extended: bool,
    gps_time: Option<usize>,
    color: Option<usize>,
    near_infrared: Option<usize>,
    has_color: bool,
    has_near_infrared: bool,
    extras: Vec<ExtraSource>,
}

impl Converter {
    pub(super) fn new(
        input: &InputFile,
        record: &RecordFormat,
        quantization: Quantization,
    ) -> Self {
        let format = input.format();
        let gps_at = if format.is_extended { 22 } else { 20 };
        let color_at = gps_at + if format.has_gps_time { 8 } else { 0 };
        let nir_at = color_at + if format.has_color { 6 } else { 0 };
        // Extra bytes stand last, after the wave packets if there are any.
        let standard = usize::from(format.len() - format.extra_bytes);
        let extras = record
            .extra_bytes
            .iter()
            .map(|extra| {
                let mut from = standard;
                for own in &input.extra_bytes {
                    if own.name == extra.name {
                        return ExtraSource::Copied {
                            from,
                            length: own.length,
                            padding: extra.length - own.length,
                        };
                    }
                    from += own.length;
                }
                ExtraSource::Absent(extra.absent())
            })
            .collect();
        Self {
            quantization,
            scale: input.scale,
            offset: input.offset,
            is_extended: format.is_extended,
            gps_time: format.has_gps_time.then_some(gps_at),
            color: format.has_color.then_some(color_at),
            near_infrared: format.has_nir.then_some(nir_at),
            has_color: record.point_format >= 7,
            has_near_infrared: record.point_format >= 8,
            extras,
        }
    }

    /// The place of `raw` in world coordinates.
    pub(super) fn world(&self, raw: &[u8]) -> [f64; 3] {
        [0, 1, 2].map(|axis| {
            let at = 4 * axis;
            let stored = i32::from_le_bytes([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]]);
            f64::from(stored) * self.scale[axis] + self.offset[axis]
        })
    }

    /// Appends the run's form of `raw` to `out`; `false`, and nothing appended,
    /// if the point lies outside of what the lattice can hold.
    pub(super) fn convert(&self, raw: &[u8], out: &mut Vec<u8>) -> bool {
        let world = self.world(raw);
        let Some(point) = self.quantization.quantise(world) else {
            return false;
        };
        for c in [point.x, point.y, point.z] {
            out.extend(c.to_le_bytes());
        }
        out.extend(&raw[12..14]);
        if self.is_extended {
            out.extend(&raw[14..22]);
        } else {
            out.extend(&legacy_flags(raw));
        }
        match self.gps_time {
            Some(at) => out.extend(&raw[at..at + 8]),
            None => out.extend([0; 8]),
        }
        if self.has_color {
            match self.color {
                Some(at) => out.extend(&raw[at..at + 6]),
                None => out.extend([0; 6]),
            }
        }
        if self.has_near_infrared {
            match self.near_infrared {
                Some(at) => out.extend(&raw[at..at + 2]),
                None => out.extend([0; 2]),
            }
        }
        for extra in &self.extras {
            match extra {
                ExtraSource::Copied {
                    from,
                    length,
                    padding,
                } => {
                    out.extend(&raw[*from..from + length]);
                    out.resize(out.len() + padding, 0);
                }
                ExtraSource::Absent(value) => out.extend(value),
            }
        }
        true
    }
}

/// Bytes 14 to 21 of formats 0 to 5 as bytes 14 to 21 of formats 6 to 10.
fn legacy_flags(raw: &[u8]) -> [u8; 8] {
    let (returns, class) = (raw[14], raw[15]);
    // Class 12 meant overlap before there was a flag for it; the class proper
    // is not known then: 1, unclassified.
    let is_overlap = class & 31 == 12;
    let [angle_low, angle_high] = scan_angle_units((raw[16] as i8).into()).to_le_bytes();
    [
        (returns & 7) | (returns >> 3 & 7) << 4,
        class >> 5 | u8::from(is_overlap) << 3 | (returns >> 6 & 3) << 6,
        if is_overlap { 1 } else { class & 31 },
        raw[17],
        angle_low,
        angle_high,
        raw[18],
        raw[19],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legacy_flags_keep_their_meaning() {
        let mut raw = [0_u8; 20];
        // Return 2 of 5, scan direction and edge of flight line set.
        raw[14] = 2 | 5 << 3 | 1 << 6 | 1 << 7;
        // Class 6, synthetic and withheld.
        raw[15] = 6 | 1 << 5 | 1 << 7;
        raw[16] = (-30_i8) as u8;
        raw[17] = 99;
        raw[18..20].copy_from_slice(&777_u16.to_le_bytes());
        let flags = legacy_flags(&raw);
        assert_eq!(flags[0], 2 | 5 << 4);
        assert_eq!(flags[1], 1 | 4 | 1 << 6 | 1 << 7);
        assert_eq!(flags[2], 6);
        assert_eq!(flags[3], 99);
        assert_eq!(i16::from_le_bytes([flags[4], flags[5]]), -5000);
        assert_eq!(u16::from_le_bytes([flags[6], flags[7]]), 777);
        raw[15] = 12;
        assert_eq!(&legacy_flags(&raw)[1..3], &[1 << 3 | 1 << 6 | 1 << 7, 1]);
    }

    #[test]
    fn what_nothing_describes_stays_last() {
        let mut record = RecordFormat {
            point_format: 7,
            extra_bytes: vec![ExtraByte::named("roll", 4), ExtraByte::undescribed(3)],
        };
        assert_eq!(record.add_real("CellArea", "of the cell").offset(), 38);
        assert_eq!(record.add_real("Curvature", "mean").offset(), 42);
        assert_eq!(record.add_real("CellArea", "of the cell").offset(), 38);
        assert_eq!(record.described_length(), 46);
        assert_eq!(record.record_length(), 49);
        assert!(record.extra_bytes[3].descriptor.is_empty());
    }

    #[test]
    fn the_length_of_an_extra_byte_follows_its_type() {
        let mut descriptor = [0_u8; 192];
        descriptor[4..8].copy_from_slice(b"roll");
        for (data_type, length) in [(1, 1), (3, 2), (6, 4), (10, 8), (19, 8), (30, 24)] {
            descriptor[2] = data_type;
            let extra = ExtraByte::from_descriptor(&descriptor).unwrap();
            assert_eq!((extra.length, extra.name.as_str()), (length, "roll"));
        }
        descriptor[2] = 31;
        assert_eq!(ExtraByte::from_descriptor(&descriptor), None);
    }
}
