//! What a polygon file (PLY) is made of: encodings, scalars, elements, and the comments by
//! which our own writer says more than PLY can.

use super::{crs::Crs, extra_bytes::ExtraAttribute};

/// The beginning of a comment that states the coordinate reference system, as WKT.
pub(in crate::las) const CRS_COMMENT: &str = "crs ";
/// The beginning of a comment that continues the last one about the coordinate reference system.
pub(in crate::las) const CRS_CONTINUED: &str = "crs+ ";
/// The most bytes of a part of the coordinate reference system in a line: some programs refuse headers with lines of 511
/// bytes and more, the library `RPly` of 1024.
const LONGEST_CRS_PART: usize = 400;
/// The beginning of a comment that describes an extra-bytes attribute: the 192 bytes of its
/// LAS descriptor in hexadecimal digits.
pub(in crate::las) const EXTRA_BYTES_COMMENT: &str = "extra bytes ";
/// The comment that says that GPS times are adjusted standard times.
pub(in crate::las) const STANDARD_TIME_COMMENT: &str = "gps time is adjusted standard time";

/// The names of the extra bytes that hold unit normals, with those of PLY's properties.
pub(in crate::las) const NORMAL_NAMES: [(&str, &str); 3] =
    [("NormalX", "nx"), ("NormalY", "ny"), ("NormalZ", "nz")];

/// The names of the colours, which programs expect to be bytes.
pub(in crate::las) const COLOR_NAMES: [&str; 3] = ["red", "green", "blue"];

/// How many bits the colours of a cloud have. LAS has two bytes for each; those that make the
/// colour are named as programs expect it, the others stand beside them, so that nothing is lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::las) enum ColorDepth {
    /// No value is greater than 255: the lower bytes are the colour.
    Eight,
    /// The upper bytes are the colour.
    Sixteen,
}

impl ColorDepth {
    /// The names of the upper bytes of red, green and blue, then those of the lower ones.
    pub(in crate::las) fn names(self) -> [&'static str; 6] {
        let [red, green, blue] = COLOR_NAMES;
        match self {
            Self::Eight => ["red_high", "green_high", "blue_high", red, green, blue],
            Self::Sixteen => [red, green, blue, "red_low", "green_low", "blue_low"],
        }
    }

    /// The lines of a header for these names, of the same length for both depths.
    pub(in crate::las) fn header_lines(self) -> String {
        let line = |name: &str| format!("property uchar {name:<10}\n");
        self.names().into_iter().map(line).collect()
    }

    /// The offset of the byte `name` from the first byte of red in a record, if bytes of these
    /// `properties` are the two halves of colours.
    pub(super) fn offset_of_byte(name: &str, properties: &[Property]) -> Option<usize> {
        let is_byte = |wanted: &&str| {
            let mut all = properties.iter();
            all.any(|(name, kind)| name == wanted && *kind == Scalar::Uint(1))
        };
        [Self::Eight, Self::Sixteen].into_iter().find_map(|depth| {
            let names = depth.names();
            let index = names.iter().position(|n| *n == name)?;
            names
                .iter()
                .all(is_byte)
                .then_some(2 * (index % 3) + usize::from(index < 3))
        })
    }
}

/// The first lines of a header: the format, and the coordinate reference system if one is known.
pub(in crate::las) fn first_lines(crs: Option<&Crs>) -> String {
    let text = "ply\nformat binary_little_endian 1.0\ncomment lloydar\n";
    let wkt = crs.and_then(Crs::wkt_in_one_line).unwrap_or_default();
    text.to_owned() + &crs_lines("comment ", &wkt)
}

/// The lines of a header that state a coordinate reference system, by its WKT in one line; `mark` begins a comment.
pub(in crate::las) fn crs_lines(mark: &str, wkt: &str) -> String {
    let mut text = String::new();
    let (mut rest, mut beginning) = (wkt, CRS_COMMENT);
    while !rest.is_empty() {
        // Spaces at the end of a line would be lost.
        let is_whole = |&at: &usize| {
            at == rest.len()
                || rest.is_char_boundary(at)
                    && !rest[..at].ends_with(' ')
                    && !rest[at..].starts_with(' ')
        };
        let longest = rest.len().min(LONGEST_CRS_PART);
        let at = (1..=longest).rev().find(is_whole).unwrap_or(rest.len());
        text += &format!("{mark}{beginning}{}\n", &rest[..at]);
        rest = &rest[at..];
        beginning = CRS_CONTINUED;
    }
    text
}

/// The encoding of the elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::las) enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

impl Encoding {
    /// The encoding of this name in the line `format`.
    pub(in crate::las) fn of_name(name: &str) -> Option<Self> {
        match name {
            "ascii" => Some(Self::Text),
            "binary_little_endian" => Some(Self::LittleEndian),
            "binary_big_endian" => Some(Self::BigEndian),
            _ => None,
        }
    }
}

/// The type of a property, with its length in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::las) enum Scalar {
    Int(usize),
    Uint(usize),
    Float(usize),
}

impl Scalar {
    /// The type of this name.
    pub(in crate::las) fn of_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Int(1),
            "short" | "int16" => Self::Int(2),
            "int" | "int32" => Self::Int(4),
            "uchar" | "uint8" => Self::Uint(1),
            "ushort" | "uint16" => Self::Uint(2),
            "uint" | "uint32" => Self::Uint(4),
            "float" | "float32" => Self::Float(4),
            "double" | "float64" => Self::Float(8),
            _ => return None,
        })
    }

    /// The length of a value in bytes.
    pub(in crate::las) fn bytes(self) -> usize {
        match self {
            Self::Int(bytes) | Self::Uint(bytes) | Self::Float(bytes) => bytes,
        }
    }

    /// The value whose little-endian bytes begin `raw`; zeros follow.
    pub(in crate::las) fn value(self, raw: [u8; 8]) -> f64 {
        let word = u64::from_le_bytes(raw);
        match self {
            Self::Float(4) => f32::from_bits(word as u32).into(),
            Self::Float(_) => f64::from_bits(word),
            Self::Uint(_) => word as f64,
            Self::Int(bytes) => {
                let unused = 64 - 8 * bytes as u32;
                ((word << unused) as i64 >> unused) as f64
            }
        }
    }

    /// Writes `value` to `raw`, little endian; integers are rounded and saturate.
    pub(super) fn put(self, value: f64, raw: &mut [u8]) {
        match self {
            Self::Float(4) => raw.copy_from_slice(&(value as f32).to_le_bytes()),
            Self::Float(_) => raw.copy_from_slice(&value.to_le_bytes()),
            Self::Uint(bytes) => {
                let most = (1_u64 << (8 * bytes)) - 1;
                let value = (value.round() as u64).min(most);
                raw.copy_from_slice(&value.to_le_bytes()[..bytes]);
            }
            Self::Int(bytes) => {
                let most = (1_i64 << (8 * bytes - 1)) - 1;
                let value = (value.round() as i64).clamp(-most - 1, most);
                raw.copy_from_slice(&value.to_le_bytes()[..bytes]);
            }
        }
    }

    /// The number of the type in descriptors of extra bytes (LAS 1.4, table 25).
    pub(super) fn data_type(self) -> u8 {
        match self {
            Self::Uint(1) => 1,
            Self::Int(1) => 2,
            Self::Uint(2) => 3,
            Self::Int(2) => 4,
            Self::Uint(_) => 5,
            Self::Int(_) => 6,
            Self::Float(4) => 9,
            Self::Float(_) => 10,
        }
    }
}

/// A property: its name and type.
pub(in crate::las) type Property = (String, Scalar);

/// An element: `count` times the values of its properties.
#[derive(Clone, Debug)]
pub(in crate::las) struct Element {
    pub(in crate::las) name: String,
    pub(in crate::las) count: u64,
    pub(in crate::las) properties: Vec<Property>,
}

impl Element {
    /// The length of one of them in a binary file, in bytes.
    pub(in crate::las) fn bytes(&self) -> u64 {
        let bytes = self.properties.iter().map(|(_, kind)| kind.bytes() as u64);
        bytes.sum()
    }

    /// The indices of the properties x, y and z.
    pub(in crate::las) fn coordinate_columns(&self) -> Option<[usize; 3]> {
        let find = |wanted: &str| self.properties.iter().position(|(name, _)| name == wanted);
        Some([find("x")?, find("y")?, find("z")?])
    }
}

/// The hexadecimal digits of the descriptor of `extra`, for a comment.
pub(in crate::las) fn descriptor_digits(extra: &ExtraAttribute) -> String {
    let bytes = extra.descriptor.iter();
    bytes.map(|b| format!("{b:02x}")).collect()
}

/// The attribute whose descriptor has these hexadecimal digits.
pub(in crate::las) fn attribute_of_digits(digits: &str) -> Option<ExtraAttribute> {
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok();
    let descriptor: Option<Vec<u8>> = digits.trim().as_bytes().chunks(2).map(byte).collect();
    ExtraAttribute::from_descriptor(&descriptor?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_crs_is_stated_in_lines_that_every_reader_takes() {
        let wkt = format!("COMPD_CS[\"{}\"]", "Höhe über NHN ".repeat(200));
        let lines = crs_lines("comment ", &wkt);
        assert!(lines.lines().count() > 2);
        assert!(
            lines
                .lines()
                .all(|line| line.len() < 500 && line.trim() == line)
        );
        let parts = lines.lines().map(|line| {
            let comment = line.strip_prefix("comment ").unwrap();
            let first = comment.strip_prefix(CRS_COMMENT);
            first.or(comment.strip_prefix(CRS_CONTINUED)).unwrap()
        });
        assert_eq!(parts.collect::<String>(), wkt);
    }

    #[test]
    fn names_of_both_depths_fill_the_same_bytes_of_a_header() {
        let [eight, sixteen] =
            [ColorDepth::Eight, ColorDepth::Sixteen].map(ColorDepth::header_lines);
        assert_eq!(eight.len(), sixteen.len());
        assert!(sixteen.starts_with("property uchar red "));
    }

    #[test]
    fn bytes_are_halves_of_colours_only_together() {
        let byte = |name: &&str| ((*name).to_owned(), Scalar::Uint(1));
        for (depth, offset) in [(ColorDepth::Eight, 2), (ColorDepth::Sixteen, 3)] {
            let mut properties: Vec<Property> = depth.names().iter().map(byte).collect();
            let of_green = |all: &[Property]| ColorDepth::offset_of_byte("green", all);
            assert_eq!(of_green(&properties), Some(offset));
            assert_eq!(ColorDepth::offset_of_byte("x", &properties), None);
            properties.pop();
            assert_eq!(of_green(&properties), None);
        }
    }

    #[test]
    fn integers_keep_their_sign() {
        assert_eq!(Scalar::Int(2).value([0xfe, 0xff, 0, 0, 0, 0, 0, 0]), -2.0);
        assert_eq!(Scalar::Uint(1).value([0xfe, 0, 0, 0, 0, 0, 0, 0]), 254.0);
    }
}
