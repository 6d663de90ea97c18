//! Polygons that select points, from well-known text or GeoJSON.

use std::path::Path;

use geo::{BoundingRect, Coord, Geometry, Intersects, MultiPolygon};
use serde::{Deserialize, Serialize};

use super::geometry_file::{geometry_of, text_of};

/// Polygons in the CRS of the data; points on their edges are inside.
///
/// In a job's files they are rings of corners: of each polygon the outer ring, then its holes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Rings", into = "Rings")]
pub(crate) struct PolygonFilter {
    polygons: MultiPolygon<f64>,
    /// The west, south, east and north side of the bounding rectangle.
    bounds: [f64; 4],
}

type Rings = Vec<Vec<Vec<(f64, f64)>>>;

impl PolygonFilter {
    /// Reads polygons from a file of well-known text or GeoJSON.
    ///
    /// # Errors
    ///
    /// A text that says what is wrong with the file.
    pub(crate) fn from_file(path: &Path) -> Result<Self, String> {
        Self::from_text(&text_of(path)?)
    }

    fn from_text(text: &str) -> Result<Self, String> {
        let mut polygons = Vec::new();
        collect_polygons(geometry_of(text)?, &mut polygons)?;
        Self::new(MultiPolygon(polygons))
    }

    fn new(polygons: MultiPolygon<f64>) -> Result<Self, String> {
        let bounds = polygons
            .bounding_rect()
            .ok_or("contains no polygon; give at least one")?;
        let (min, max) = (bounds.min(), bounds.max());
        let bounds = [min.x, min.y, max.x, max.y];
        match bounds.iter().all(|c| c.is_finite()) {
            true => Ok(Self { polygons, bounds }),
            false => Err("has a corner whose coordinates are not finite numbers".to_owned()),
        }
    }

    /// The west, south, east and north side of the bounding rectangle.
    pub(crate) fn bounds(&self) -> [f64; 4] {
        self.bounds
    }

    /// Whether `world` lies in one of the polygons, seen from above.
    pub(crate) fn contains(&self, world: &[f64; 3]) -> bool {
        let position = Coord {
            x: world[0],
            y: world[1],
        };
        is_within(world, &self.bounds) && self.polygons.intersects(&position)
    }
}

/// Whether `world` lies between the west, south, east and north side, those included.
pub(super) fn is_within(world: &[f64; 3], [west, south, east, north]: &[f64; 4]) -> bool {
    (*west..=*east).contains(&world[0]) && (*south..=*north).contains(&world[1])
}

/// Adds all polygons of `geometry` to `found`, those in collections of collections included.
fn collect_polygons(
    geometry: Geometry<f64>,
    found: &mut Vec<geo::Polygon<f64>>,
) -> Result<(), String> {
    match geometry {
        Geometry::Polygon(polygon) => found.push(polygon),
        Geometry::MultiPolygon(polygons) => found.extend(polygons),
        Geometry::Rect(rect) => found.push(rect.to_polygon()),
        Geometry::GeometryCollection(parts) => {
            for part in parts {
                collect_polygons(part, found)?;
            }
        }
        _ => {
            let problem = "contains a geometry that is no polygon; remove points and lines";
            return Err(problem.to_owned());
        }
    }
    Ok(())
}

impl From<Rings> for PolygonFilter {
    fn from(rings: Rings) -> Self {
        let ring = |corners: Vec<(f64, f64)>| geo::LineString::from(corners);
        let polygons = rings.into_iter().map(|rings| {
            let mut rings = rings.into_iter().map(ring);
            let outer = rings.next().unwrap_or_else(|| geo::LineString(Vec::new()));
            geo::Polygon::new(outer, rings.collect())
        });
        let polygons: MultiPolygon<f64> = polygons.collect();
        Self::new(polygons.clone()).unwrap_or(Self {
            polygons,
            bounds: [0.0; 4],
        })
    }
}

impl From<PolygonFilter> for Rings {
    fn from(filter: PolygonFilter) -> Self {
        let corners = |ring: &geo::LineString<f64>| ring.coords().map(|c| (c.x, c.y)).collect();
        let rings = |polygon: &geo::Polygon<f64>| {
            let holes = polygon.interiors().iter();
            std::iter::once(polygon.exterior())
                .chain(holes)
                .map(corners)
                .collect()
        };
        filter.polygons.iter().map(rings).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_json_are_the_same_polygons() {
        let wkt = "POLYGON ((0 0, 10 0, 10 10, 0 10, 0 0), (4 4, 6 4, 6 6, 4 6, 4 4))";
        let json = r#"{"type": "FeatureCollection", "features": [{"type": "Feature",
            "properties": null, "geometry": {"type": "Polygon", "coordinates":
            [[[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]],
             [[4, 4], [6, 4], [6, 6], [4, 6], [4, 4]]]}}]}"#;
        let filter = PolygonFilter::from_text(wkt).unwrap();
        assert_eq!(PolygonFilter::from_text(json).unwrap(), filter);
        let stored = serde_json::to_string(&filter).unwrap();
        assert_eq!(
            serde_json::from_str::<PolygonFilter>(&stored).unwrap(),
            filter
        );
        let contains = |x, y| filter.contains(&[x, y, 0.0]);
        assert!(contains(1.0, 1.0) && contains(0.0, 5.0) && contains(4.0, 5.0));
        assert!(!contains(5.0, 5.0) && !contains(10.1, 5.0));
    }

    #[test]
    fn other_geometries_are_refused() {
        for (text, why) in [
            ("POINT (1 2)", "no polygon"),
            ("GEOMETRYCOLLECTION EMPTY", "no polygon"),
            ("{\"type\": 3}", "GeoJSON"),
            ("hello", "well-known"),
        ] {
            let error = PolygonFilter::from_text(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}
