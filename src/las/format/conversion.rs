//! From the records of an input to the records of the run.
//!
//! Inputs of formats 0 to 5 have other flags ([`modern_flags`]); attributes that an input
//! lacks become zeros, or the no-data value that is declared for them.

use std::sync::Arc;

use ::las::point::Format;

use super::{
    extra_bytes::ExtraAttribute,
    fields::{COLOR, GPS_TIME, INTENSITY, RETURNS, coordinates, scan_angle_units},
    record_format::RecordFormat,
};
use crate::{geometry::Quantization, las::reproject::Reprojection};

/// The offset of the GPS time in formats 1 and 3 to 5.
const LEGACY_GPS_TIME: usize = 20;
/// The length of the GPS time, the colour and near infrared, in bytes.
const GPS_TIME_BYTES: usize = GPS_TIME.end - GPS_TIME.start;
const COLOR_BYTES: usize = COLOR[2].end - COLOR[0].start;
const NEAR_INFRARED_BYTES: usize = 2;

/// The layout of an input's records, and the meaning of their coordinates.
#[derive(Clone, Copy, Debug)]
pub(in crate::las) struct InputLayout<'a> {
    /// The point format.
    pub(in crate::las) point_format: Format,
    /// CRS units to a stored unit, along each axis.
    pub(in crate::las) scale: [f64; 3],
    /// The world coordinates of the stored origin.
    pub(in crate::las) offset: [f64; 3],
    /// The extra bytes in the order of the record.
    pub(in crate::las) extra_bytes: &'a [ExtraAttribute],
}

/// The source of an extra-bytes attribute of the run.
#[derive(Clone, Debug)]
enum ExtraSource {
    /// `length` bytes at `offset` of the input's record, and `padding` zeros behind them.
    Copied {
        offset: usize,
        length: usize,
        padding: usize,
    },
    /// These bytes: the input lacks the attribute.
    Absent(Vec<u8>),
}

/// Turns the records of one input into records of the run.
#[derive(Clone, Debug)]
pub(in crate::las) struct RecordConverter {
    quantization: Quantization,
    scale: [f64; 3],
    offset: [f64; 3],
    is_extended: bool,
    /// The offsets in the input's record, where it has the field.
    gps_time: Option<usize>,
    color: Option<usize>,
    near_infrared: Option<usize>,
    /// Whether the run's records have the field.
    has_color: bool,
    has_near_infrared: bool,
    extras: Vec<ExtraSource>,
    /// The way of the points to the CRS of the run, if they take one.
    reprojection: Option<Arc<Reprojection>>,
}

impl RecordConverter {
    /// A converter from records like `input` to records like `record` on `quantization`.
    pub(in crate::las) fn new(
        input: &InputLayout<'_>,
        record: &RecordFormat,
        quantization: Quantization,
    ) -> Self {
        let format = input.point_format;
        let gps_time = match format.is_extended {
            true => GPS_TIME.start,
            false => LEGACY_GPS_TIME,
        };
        let color = gps_time
            + if format.has_gps_time {
                GPS_TIME_BYTES
            } else {
                0
            };
        let near_infrared = color + if format.has_color { COLOR_BYTES } else { 0 };
        let sources = record.extra_bytes.iter();
        Self {
            quantization,
            scale: input.scale,
            offset: input.offset,
            is_extended: format.is_extended,
            gps_time: format.has_gps_time.then_some(gps_time),
            color: format.has_color.then_some(color),
            near_infrared: format.has_nir.then_some(near_infrared),
            has_color: record.has_color(),
            has_near_infrared: record.has_near_infrared(),
            extras: sources.map(|extra| input.source_of(extra)).collect(),
            reprojection: None,
        }
    }

    /// The converter that also brings points to another CRS, if there is a way to it.
    pub(in crate::las) fn with_reprojection(self, reprojection: Option<Arc<Reprojection>>) -> Self {
        Self {
            reprojection,
            ..self
        }
    }

    /// The world coordinates of the input's record `raw`, in the CRS of the run; `None` where that has none.
    fn world(&self, raw: &[u8]) -> Option<[f64; 3]> {
        let stored = coordinates(raw);
        let world =
            [0, 1, 2].map(|axis| f64::from(stored[axis]) * self.scale[axis] + self.offset[axis]);
        match &self.reprojection {
            Some(reprojection) => reprojection.point(world),
            None => Some(world),
        }
    }

    /// Appends the run's form of the input's record `raw` to `out`, and returns its world coordinates. Returns `None`
    /// and appends nothing if the point lies outside of the range of the quantization, or of the CRS of the run.
    pub(in crate::las) fn convert(&self, raw: &[u8], out: &mut Vec<u8>) -> Option<[f64; 3]> {
        let world = self.world(raw)?;
        let point = self.quantization.quantise(world)?;
        for c in [point.x, point.y, point.z] {
            out.extend(c.to_le_bytes());
        }
        out.extend(&raw[INTENSITY]);
        if self.is_extended {
            out.extend(&raw[RETURNS..GPS_TIME.start]);
        } else {
            out.extend(&modern_flags(raw));
        }
        match self.gps_time {
            Some(at) => out.extend(&raw[at..at + GPS_TIME_BYTES]),
            None => out.extend([0; GPS_TIME_BYTES]),
        }
        if self.has_color {
            match self.color {
                Some(at) => out.extend(&raw[at..at + COLOR_BYTES]),
                None => out.extend([0; COLOR_BYTES]),
            }
        }
        if self.has_near_infrared {
            match self.near_infrared {
                Some(at) => out.extend(&raw[at..at + NEAR_INFRARED_BYTES]),
                None => out.extend([0; NEAR_INFRARED_BYTES]),
            }
        }
        for extra in &self.extras {
            match extra {
                ExtraSource::Copied {
                    offset,
                    length,
                    padding,
                } => {
                    out.extend(&raw[*offset..offset + length]);
                    out.resize(out.len() + padding, 0);
                }
                ExtraSource::Absent(value) => out.extend(value),
            }
        }
        Some(world)
    }
}

impl InputLayout<'_> {
    /// The source of the run's attribute `extra`: the input's attribute of the same name.
    fn source_of(&self, extra: &ExtraAttribute) -> ExtraSource {
        // Extra bytes stand last, behind the wave packets if there are any.
        let mut offset = usize::from(self.point_format.len() - self.point_format.extra_bytes);
        for own in self.extra_bytes {
            if own.name == extra.name {
                return ExtraSource::Copied {
                    offset,
                    length: own.length,
                    padding: extra.length - own.length,
                };
            }
            offset += own.length;
        }
        ExtraSource::Absent(extra.no_data())
    }
}

/// Turns bytes 14 to 19 of formats 0 to 5 into bytes 14 to 21 of formats 6 to 10:
///
/// ```text
///   0 to 5    returns and flags, class and flags, angle (i8, 1°), user data, source (2)
///   6 to 10   returns, flags, class, user data, angle (i16, 0.006°), source (2)
/// ```
fn modern_flags(raw: &[u8]) -> [u8; 8] {
    let (returns, class) = (raw[14], raw[15]);
    // Class 12 meant overlap before there was a flag for it; the class proper is not known
    // then: 1, unclassified.
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
        let flags = modern_flags(&raw);
        assert_eq!(flags[0], 2 | 5 << 4);
        assert_eq!(flags[1], 1 | 4 | 1 << 6 | 1 << 7);
        assert_eq!(flags[2], 6);
        assert_eq!(flags[3], 99);
        assert_eq!(i16::from_le_bytes([flags[4], flags[5]]), -5000);
        assert_eq!(u16::from_le_bytes([flags[6], flags[7]]), 777);
        raw[15] = 12;
        assert_eq!(&modern_flags(&raw)[1..3], &[1 << 3 | 1 << 6 | 1 << 7, 1]);
    }
}
