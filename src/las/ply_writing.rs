//! Records of the run as vertices of a polygon file: binary, little endian.
//!
//! All attributes but the returns, which are the same for all, by the names that our own
//! reader knows; extra bytes by their names, and what LAS says of them in comments.

use super::{
    CloudHeader, ExtraByte,
    ply::{CRS_COMMENT, EXTRA_COMMENT, TIME_COMMENT},
};
use crate::geometry::{Quantization, Stored};

/// How a record becomes a vertex.
pub(super) struct Vertices {
    quantization: Quantization,
    properties: Vec<Property>,
}

/// A property: some bytes of the record as they are, or what they stand for.
struct Property {
    name: String,
    kind: &'static str,
    at: usize,
    length: usize,
    /// Integers that are too long for the format are written as reals.
    is_signed: Option<bool>,
}

impl Vertices {
    pub(super) fn new(header: &CloudHeader) -> Self {
        let record = &header.record;
        let mut properties = Vec::new();
        let mut add = |name: &str, kind, at, length| {
            properties.push(Property {
                name: name.to_owned(),
                kind,
                at,
                length,
                is_signed: None,
            });
        };
        if record.has_color() {
            add("red", "ushort", 30, 2);
            add("green", "ushort", 32, 2);
            add("blue", "ushort", 34, 2);
        }
        if record.point_format == 8 {
            add("nir", "ushort", 36, 2);
        }
        add("intensity", "ushort", 12, 2);
        add("flags", "uchar", 15, 1);
        add("classification", "uchar", 16, 1);
        add("user_data", "uchar", 17, 1);
        add("scan_angle", "short", 18, 2);
        add("point_source_id", "ushort", 20, 2);
        add("gps_time", "double", 22, 8);
        let mut at = record.standard_length();
        for extra in &record.extra_bytes {
            properties.extend(components(extra, at));
            at += extra.length;
        }
        Self {
            quantization: header.quantization,
            properties,
        }
    }

    /// The header of the file, and where in it the number of vertices stands, twenty
    /// letters wide.
    pub(super) fn header(&self, header: &CloudHeader) -> (String, u64) {
        let mut text = String::from("ply\nformat binary_little_endian 1.0\ncomment lloydar\n");
        if let Some(wkt) = header.crs.as_ref().and_then(super::Crs::wkt) {
            let line: Vec<&str> = wkt.split_whitespace().collect();
            text += &format!("comment {CRS_COMMENT}{}\n", line.join(" "));
        }
        if header.has_standard_time {
            text += &format!("comment {TIME_COMMENT}\n");
        }
        for extra in &header.record.extra_bytes {
            let hex: String = extra
                .descriptor
                .iter()
                .map(|b| format!("{b:02x}"))
                .collect();
            if !hex.is_empty() {
                text += &format!("comment {EXTRA_COMMENT}{hex}\n");
            }
        }
        text += "element vertex ";
        let count_at = text.len() as u64;
        text += &format!("{:<20}\n", 0);
        text += "property double x\nproperty double y\nproperty double z\n";
        for Property { name, kind, .. } in &self.properties {
            text += &format!("property {kind} {name}\n");
        }
        text += "end_header\n";
        (text, count_at)
    }

    /// Appends the vertex of `record`.
    pub(super) fn append(&self, record: &[u8], out: &mut Vec<u8>) {
        for c in self.quantization.world(Stored::of_record(record)) {
            out.extend(c.to_le_bytes());
        }
        for property in &self.properties {
            let bytes = &record[property.at..property.at + property.length];
            let Some(is_signed) = property.is_signed else {
                out.extend(bytes);
                continue;
            };
            let word = u64::from_le_bytes(bytes.try_into().expect("such are eight bytes long"));
            let value = match is_signed {
                true => word as i64 as f64,
                false => word as f64,
            };
            out.extend(value.to_le_bytes());
        }
    }
}

/// The properties of an extra-bytes attribute at byte `at` of the record: one, or several
/// with numbers after their name for pairs, triples, and bytes that nothing describes.
fn components(extra: &ExtraByte, at: usize) -> Vec<Property> {
    // LAS 1.4, table 25; pairs and triples of these follow.
    const KINDS: [(&str, usize); 10] = [
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
    let data_type = extra.descriptor.get(2).copied().unwrap_or(0);
    let of_type = match data_type {
        0 => 0,
        number => usize::from(number - 1) % KINDS.len(),
    };
    let (kind, length) = KINDS[of_type];
    let is_signed = match (data_type, of_type) {
        (0, _) => None,
        (_, 6) => Some(false),
        (_, 7) => Some(true),
        _ => None,
    };
    let name: String = extra
        .name
        .chars()
        .map(|c| if c.is_ascii_graphic() { c } else { '_' })
        .collect();
    let name = if name.is_empty() {
        "extra".to_owned()
    } else {
        name
    };
    let count = extra.length / length;
    (0..count)
        .map(|number| Property {
            name: match count {
                1 => name.clone(),
                _ => format!("{name}_{number}"),
            },
            kind,
            at: at + number * length,
            length,
            is_signed,
        })
        .collect()
}
