//! From records of the run to the properties of vertices: the way back of
//! [`vertex_layout`](super::vertex_layout).
//!
//! All attributes are carried but the returns, which are 1 of 1 for all points of an output. What
//! programs for meshes know has the names and types that they expect: colours are bytes, and
//! unit normals are `nx ny nz`, with 0 0 0 for an unknown one, because readers spread NaN.

use std::{collections::HashSet, ops::Range};

use super::{
    extra_bytes::{ExtraAttribute, SCALAR_DATA_TYPES},
    fields::{
        CLASSIFICATION, COLOR, FLAGS, GPS_TIME, INTENSITY, NEAR_INFRARED, POINT_SOURCE, SCAN_ANGLE,
        USER_DATA,
    },
    ply::{COLOR_NAMES, ColorDepth, NORMAL_NAMES},
    record_format::RecordFormat,
};

/// The scalar data types 1 to 10 (LAS 1.4, table 25) as PLY has them: a name and a length in
/// bytes. PLY has no integers of 64 bits: they become reals.
const PLY_TYPES: [(&str, usize); SCALAR_DATA_TYPES] = [
    ("uchar", 1),
    ("char", 1),
    ("ushort", 2),
    ("short", 2),
    ("uint", 4),
    ("int", 4),
    ("double", 8),
    ("double", 8),
    ("float", 4),
    ("double", 8),
];
/// The number of the type of single precision in descriptors of extra bytes.
const SINGLE: u8 = 9;
/// The indices of the unsigned and of the signed integers of 64 bits in [`PLY_TYPES`].
const LONG_UNSIGNED: usize = 6;
const LONG_SIGNED: usize = 7;

/// How bytes of a record become those of a property.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Conversion {
    Copied,
    RealOfUnsigned,
    RealOfSigned,
    /// Single precision, zero for NaN.
    KnownOrZero,
}

/// A property of the vertices, and the bytes of the record that it is made of.
pub(in crate::las) struct VertexProperty {
    /// The name of the property.
    pub(in crate::las) name: String,
    /// The name of its PLY type.
    pub(in crate::las) kind: &'static str,
    bytes: Range<usize>,
    conversion: Conversion,
}

impl VertexProperty {
    /// The properties of records of the format `record`, in their order.
    pub(in crate::las) fn of_format(record: &RecordFormat) -> Vec<Self> {
        let mut properties = Vec::new();
        let mut add = |name: &str, kind, bytes| {
            properties.push(Self {
                name: name.to_owned(),
                kind,
                bytes,
                conversion: Conversion::Copied,
            });
        };
        if record.has_color() {
            // First the upper bytes, then the lower ones.
            let names = ColorDepth::Sixteen.names();
            for (name, bytes) in COLOR_NAMES.iter().zip(COLOR) {
                add(name, "uchar", bytes.start + 1..bytes.end);
            }
            for (name, bytes) in names[3..].iter().zip(COLOR) {
                add(name, "uchar", bytes.start..bytes.start + 1);
            }
        }
        if record.has_near_infrared() {
            add("nir", "ushort", NEAR_INFRARED);
        }
        add("intensity", "ushort", INTENSITY);
        add("flags", "uchar", FLAGS..FLAGS + 1);
        add(
            "classification",
            "uchar",
            CLASSIFICATION..CLASSIFICATION + 1,
        );
        add("user_data", "uchar", USER_DATA..USER_DATA + 1);
        add("scan_angle", "short", SCAN_ANGLE);
        add("point_source_id", "ushort", POINT_SOURCE);
        add("gps_time", "double", GPS_TIME);
        let mut offset = record.standard_length();
        let has_normals = NORMAL_NAMES.iter().all(|(of_las, _)| {
            let mut extras = record.extra_bytes.iter();
            extras.any(|extra| extra.name == *of_las && extra.data_type() == SINGLE)
        });
        for extra in &record.extra_bytes {
            let mut made = Self::of_extra_bytes(extra, offset);
            let normal = NORMAL_NAMES
                .iter()
                .find(|(of_las, _)| extra.name == *of_las);
            let is_normal = has_normals && extra.data_type() == SINGLE;
            if let (true, Some((_, of_ply)), [only]) = (is_normal, normal, &mut made[..]) {
                only.name = (*of_ply).to_owned();
                only.conversion = Conversion::KnownOrZero;
            }
            properties.extend(made);
            offset += extra.length;
        }
        // An attribute of the scan can have the name of a coordinate, of a normal, or of a property above it.
        let mut names = HashSet::from(["x", "y", "z"].map(str::to_owned));
        if has_normals {
            names.extend(NORMAL_NAMES.map(|(_, of_ply)| of_ply.to_owned()));
        }
        let is_normal = |property: &&mut Self| property.conversion == Conversion::KnownOrZero;
        for property in properties.iter_mut().filter(|it| !is_normal(it)) {
            while !names.insert(property.name.clone()) {
                property.name.push('_');
            }
        }
        properties
    }

    /// The properties of an extra-bytes attribute at `offset` of the record: one, or several
    /// with numbers behind their name for pairs, triples, and bytes that nothing describes.
    fn of_extra_bytes(extra: &ExtraAttribute, offset: usize) -> Vec<Self> {
        let index = match extra.data_type() {
            0 => 0,
            number => usize::from(number - 1) % PLY_TYPES.len(),
        };
        let (kind, length) = PLY_TYPES[index];
        let conversion = match index {
            LONG_UNSIGNED => Conversion::RealOfUnsigned,
            LONG_SIGNED => Conversion::RealOfSigned,
            _ => Conversion::Copied,
        };
        let graphic = |c: char| if c.is_ascii_graphic() { c } else { '_' };
        let mut name: String = extra.name.chars().map(graphic).collect();
        if name.is_empty() {
            name = "extra".to_owned();
        }
        let count = extra.length / length;
        (0..count)
            .map(|number| Self {
                name: match count {
                    1 => name.clone(),
                    _ => format!("{name}_{number}"),
                },
                kind,
                bytes: offset + number * length..offset + (number + 1) * length,
                conversion,
            })
            .collect()
    }

    /// Appends the value of the property in `record`, little endian.
    #[inline]
    pub(in crate::las) fn append(&self, record: &[u8], out: &mut Vec<u8>) {
        let bytes = &record[self.bytes.clone()];
        let long = || u64::from_le_bytes(bytes.try_into().expect("long integers have 8 bytes"));
        match self.conversion {
            Conversion::Copied => out.extend(bytes),
            Conversion::RealOfUnsigned => out.extend((long() as f64).to_le_bytes()),
            Conversion::RealOfSigned => out.extend((long() as i64 as f64).to_le_bytes()),
            Conversion::KnownOrZero => {
                let value =
                    f32::from_le_bytes(bytes.try_into().expect("single precision is four bytes"));
                let known = if value.is_nan() { 0.0 } else { value };
                out.extend(known.to_le_bytes());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_properties_have_the_same_name() {
        let named = |(name, kind)| ExtraAttribute::named(name, kind);
        let normals = NORMAL_NAMES.map(|(of_las, _)| (of_las, SINGLE));
        let others = [
            ("nx", 1),
            ("flags", 3),
            ("x", 9),
            ("red_low", 9),
            ("flags", 5),
        ];
        let record = RecordFormat {
            point_format: 7,
            extra_bytes: others.into_iter().chain(normals).map(named).collect(),
        };
        let properties = VertexProperty::of_format(&record);
        let names: Vec<&str> = properties.iter().map(|it| it.name.as_str()).collect();
        let last = [
            "nx_", "flags_", "x_", "red_low_", "flags__", "nx", "ny", "nz",
        ];
        assert!(names.ends_with(&last), "{names:?}");
        let distinct: HashSet<&str> = names.iter().copied().collect();
        assert_eq!(distinct.len(), names.len());
    }

    #[test]
    fn normals_of_double_precision_are_copied() {
        let named = |(name, _)| ExtraAttribute::named(name, 10);
        let record = RecordFormat {
            point_format: 6,
            extra_bytes: NORMAL_NAMES.map(named).into(),
        };
        let properties = VertexProperty::of_format(&record);
        let mut out = Vec::new();
        properties
            .last()
            .unwrap()
            .append(&vec![7; record.record_length()], &mut out);
        assert_eq!(out, [7; 8]);
    }
}
