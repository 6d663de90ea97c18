//! Files with one geometry: well-known text, or GeoJSON.

use std::path::Path;

use geo::Geometry;
use geojson::GeoJson;
use wkt::TryFromWkt;

/// Reads the text of a file.
///
/// # Errors
///
/// A text that says why it cannot be read.
pub(super) fn text_of(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|e| format!("cannot be read: {e}"))
}

/// The geometry that `text` describes; all geometries of a GeoJSON together.
///
/// # Errors
///
/// A text that says what is wrong with it.
pub(super) fn geometry_of(text: &str) -> Result<Geometry<f64>, String> {
    match text.trim_start().starts_with('{') {
        true => text
            .parse::<GeoJson>()
            .and_then(|json| geo::GeometryCollection::try_from(&json))
            .map(Geometry::GeometryCollection)
            .map_err(|e| format!("is no GeoJSON: {e}")),
        false => Geometry::try_from_wkt_str(text.trim())
            .map_err(|e| format!("is neither GeoJSON nor well-known text: {e}")),
    }
}
