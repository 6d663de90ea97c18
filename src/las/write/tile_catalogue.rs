//! The catalogue of tiles: a Virtual Point Cloud, by which others open all of them as one cloud.
//!
//! It is a collection of STAC 1.0 items with the extensions for point clouds (1.0) and projections (1.1), as
//! `pdal_wrench` and QGIS read it. `geometry` and `bbox` are degrees on the datum of the CRS; where a cloud states no
//! CRS, or one that has no code, they are the coordinates of the cloud, as `pdal_wrench` has them then.

use serde_json::{Value, json};

use super::{cloud::CloudHeader, las_header::creation_date};
use crate::las::{
    format::{crs::Crs, record_format::RecordFormat},
    reproject::Degrees,
};

/// The schemas of the extensions of STAC that items have.
const EXTENSIONS: [&str; 2] = [
    "https://stac-extensions.github.io/pointcloud/v1.0.0/schema.json",
    "https://stac-extensions.github.io/projection/v1.1.0/schema.json",
];

/// The dimensions of points of format 6, by the names of PDAL: name, type, bytes.
const DIMENSIONS: [(&str, &str, usize); 15] = [
    ("X", "floating", 8),
    ("Y", "floating", 8),
    ("Z", "floating", 8),
    ("Intensity", "unsigned", 2),
    ("ReturnNumber", "unsigned", 1),
    ("NumberOfReturns", "unsigned", 1),
    ("ScanChannel", "unsigned", 1),
    ("ScanDirectionFlag", "unsigned", 1),
    ("EdgeOfFlightLine", "unsigned", 1),
    ("Classification", "unsigned", 1),
    ("ClassFlags", "unsigned", 1),
    ("ScanAngleRank", "floating", 4),
    ("UserData", "unsigned", 1),
    ("PointSourceId", "unsigned", 2),
    ("GpsTime", "floating", 8),
];
/// The dimensions that formats 7 and 8 add, and that format 8 adds.
const COLORS: [&str; 3] = ["Red", "Green", "Blue"];
const NEAR_INFRARED: &str = "Infrared";
/// The types of extra bytes by their numbers in the specification, and the bytes of each.
const EXTRA_TYPES: [(&str, usize); 11] = [
    ("unsigned", 1),
    ("unsigned", 1),
    ("signed", 1),
    ("unsigned", 2),
    ("signed", 2),
    ("unsigned", 4),
    ("signed", 4),
    ("unsigned", 8),
    ("signed", 8),
    ("floating", 4),
    ("floating", 8),
];

/// A tile, as the catalogue has it.
pub(super) struct CataloguedTile {
    /// The name of the file, beside the catalogue.
    pub(super) file: String,
    /// The number of points.
    pub(super) points: u64,
    /// The bounds of the points, in world coordinates: min, max.
    pub(super) bounds: [[f64; 3]; 2],
}

/// The catalogue of `tiles`, which are clouds with this `header`.
pub(super) fn tile_catalogue(header: &CloudHeader, tiles: &[CataloguedTile]) -> Value {
    let degrees = header.crs.as_ref().and_then(Degrees::of);
    let schemas = schemas(&header.record);
    let day = creation_date().map(|day| format!("{day}T00:00:00Z"));
    let item = |tile: &CataloguedTile| {
        let [min, max] = tile.bounds;
        let native = [
            [min[0], min[1]],
            [max[0], min[1]],
            [max[0], max[1]],
            [min[0], max[1]],
            [min[0], min[1]],
        ];
        let corners: Option<Vec<[f64; 2]>> = degrees
            .as_ref()
            .and_then(|degrees| native.iter().map(|&corner| degrees.at(corner)).collect());
        let corners = corners.unwrap_or_else(|| native.to_vec());
        let side = |axis: usize, pick: fn(f64, f64) -> f64| {
            corners
                .iter()
                .map(|corner| corner[axis])
                .reduce(pick)
                .unwrap_or_default()
        };
        let mut properties = json!({
            "datetime": day,
            "pc:count": tile.points,
            "pc:type": "lidar",
            "pc:encoding": "LASzip",
            "pc:schemas": schemas,
            "proj:geometry": { "type": "Polygon", "coordinates": [native] },
            "proj:bbox": [min[0], min[1], min[2], max[0], max[1], max[2]],
        });
        // Readers expect the text, even where there is none.
        properties["proj:wkt2"] = header
            .crs
            .as_ref()
            .and_then(Crs::wkt)
            .unwrap_or_default()
            .into();
        json!({
            "type": "Feature",
            "stac_version": "1.0.0",
            "stac_extensions": EXTENSIONS,
            "id": tile.file.trim_end_matches(".laz"),
            "geometry": { "type": "Polygon", "coordinates": [corners] },
            "bbox": [side(0, f64::min), side(1, f64::min), min[2], side(0, f64::max), side(1, f64::max), max[2]],
            "properties": properties,
            "links": [],
            "assets": { "data": { "href": format!("./{}", tile.file), "roles": ["data"] } },
        })
    };
    let items: Vec<Value> = tiles.iter().map(item).collect();
    json!({ "type": "FeatureCollection", "features": items })
}

/// The dimensions of `record`, with their types.
fn schemas(record: &RecordFormat) -> Vec<Value> {
    let schema =
        |name: &str, kind: &str, bytes: usize| json!({ "name": name, "type": kind, "size": bytes });
    let mut schemas: Vec<Value> = DIMENSIONS
        .iter()
        .map(|&(name, kind, bytes)| schema(name, kind, bytes))
        .collect();
    if record.has_color() {
        schemas.extend(COLORS.map(|name| schema(name, "unsigned", 2)));
    }
    if record.has_near_infrared() {
        schemas.push(schema(NEAR_INFRARED, "unsigned", 2));
    }
    let described = record
        .extra_bytes
        .iter()
        .filter(|extra| extra.is_described());
    schemas.extend(described.filter_map(|extra| {
        // Bytes without a type, and lists of numbers, are no dimension.
        let &(kind, bytes) = EXTRA_TYPES
            .get(usize::from(extra.data_type()))
            .filter(|_| extra.data_type() > 0)?;
        Some(schema(&extra.name, kind, bytes))
    }));
    schemas
}
