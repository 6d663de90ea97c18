//! GeoTIFF keys: a coordinate reference system as numbers.
//!
//! The directory of keys is a sequence of 16-bit words, four to an entry: key, location,
//! count, value; the first entry is its header. A value stands in the entry itself if the
//! location is 0. (OGC GeoTIFF 1.1, section 7.)

use std::ops::RangeInclusive;

/// The number of the record that has the directory of keys.
pub(super) const DIRECTORY_RECORD: u16 = 34_735;
/// The numbers of all records of GeoTIFF keys: directory, reals and texts.
pub(super) const KEY_RECORDS: RangeInclusive<u16> = 34_735..=34_737;
/// The values that are EPSG codes; others mean undefined or user-defined.
const EPSG_CODES: RangeInclusive<u16> = 1024..=32_766;
/// The key of the model type, and its value for geographic coordinates.
pub(super) const MODEL_TYPE: u16 = 1024;
pub(super) const GEOGRAPHIC_MODEL: u16 = 2;
/// The keys of the geodetic, the projected and the vertical system.
pub(super) const GEODETIC_SYSTEM: u16 = 2048;
pub(super) const PROJECTED_SYSTEM: u16 = 3072;
pub(super) const VERTICAL_SYSTEM: u16 = 4096;
/// The keys of the linear unit of a projected system, and of the unit of heights.
const LINEAR_UNIT: u16 = 3076;
const VERTICAL_UNIT: u16 = 4099;

/// The value of the key `wanted`, if it stands in the directory itself.
pub(super) fn value_of_key(directory: &[u8], wanted: u16) -> Option<u16> {
    let words: Vec<u16> = directory
        .chunks_exact(2)
        .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
        .collect();
    words
        .chunks_exact(4)
        .skip(1)
        .find(|entry| entry[0] == wanted && entry[1] == 0)
        .map(|entry| entry[3])
}

/// The EPSG code that is the value of the key `wanted`.
pub(super) fn code_of_key(directory: &[u8], wanted: u16) -> Option<u16> {
    value_of_key(directory, wanted).filter(|code| EPSG_CODES.contains(code))
}

/// Metres to the linear unit of a projected system, if it is one of the metre, the
/// international foot and the US survey foot.
pub(super) fn metres_per_linear_unit(directory: &[u8]) -> Option<f64> {
    metres_per_unit(directory, LINEAR_UNIT)
}

/// Metres to the unit of heights, if it is one of the metre, the international foot and the US survey foot.
pub(super) fn metres_per_vertical_unit(directory: &[u8]) -> Option<f64> {
    metres_per_unit(directory, VERTICAL_UNIT)
}

fn metres_per_unit(directory: &[u8], key: u16) -> Option<f64> {
    match value_of_key(directory, key) {
        Some(9001) => Some(1.0),
        Some(9002) => Some(0.3048),
        Some(9003) => Some(1200.0 / 3937.0),
        _ => None,
    }
}
