//! Which points of the inputs take part.

use std::path::Path;

use geo::{BoundingRect, Coord, Geometry, Intersects, MultiPolygon};
use geojson::GeoJson;
use serde::{Deserialize, Serialize};
use wkt::TryFromWkt;

use super::RecordView;

/// A condition on points; by default all fulfil it. Places are in the CRS of the data.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct PointFilter {
    /// Classes to keep; `None` for all.
    pub(crate) keep_classes: Option<Vec<u8>>,
    /// Classes to leave out.
    pub(crate) drop_classes: Vec<u8>,
    /// Whether points that are withheld are left out.
    pub(crate) drop_withheld: bool,
    /// West, south, east and north side; points on them are inside.
    pub(crate) bounds: Option<[f64; 4]>,
    /// The ground to keep; points on its edges are inside.
    pub(crate) polygons: Option<Ground>,
}

/// Polygons, as rings of corners: of each the outer ring, then its holes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Rings", into = "Rings")]
pub(crate) struct Ground {
    polygons: MultiPolygon<f64>,
    /// West, south, east and north side.
    bounds: [f64; 4],
}

type Rings = Vec<Vec<Vec<(f64, f64)>>>;

impl Ground {
    /// West, south, east and north side of the bounding rectangle.
    pub(crate) fn bounds(&self) -> [f64; 4] {
        self.bounds
    }

    /// Reads polygons from a file of well-known text or GeoJSON.
    ///
    /// # Errors
    ///
    /// A text that says what is wrong with it.
    pub(crate) fn from_file(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|e| format!("cannot be read: {e}"))?;
        Self::from_text(&text)
    }

    fn from_text(text: &str) -> Result<Self, String> {
        let geometry: Geometry<f64> = match text.trim_start().starts_with('{') {
            true => text
                .parse::<GeoJson>()
                .and_then(|json| geo::GeometryCollection::try_from(&json))
                .map(Geometry::GeometryCollection)
                .map_err(|e| format!("is no GeoJSON: {e}"))?,
            false => Geometry::try_from_wkt_str(text.trim())
                .map_err(|e| format!("is neither GeoJSON nor well-known text: {e}"))?,
        };
        let mut polygons = Vec::new();
        collect(geometry, &mut polygons)?;
        Self::new(MultiPolygon(polygons))
    }

    fn new(polygons: MultiPolygon<f64>) -> Result<Self, String> {
        let bounds = polygons.bounding_rect().ok_or("holds no polygon")?;
        let bounds = [
            bounds.min().x,
            bounds.min().y,
            bounds.max().x,
            bounds.max().y,
        ];
        match bounds.iter().all(|c| c.is_finite()) {
            true => Ok(Self { polygons, bounds }),
            false => Err("has a corner that is no number".to_owned()),
        }
    }
}

/// All polygons of `geometry`, in collections of collections, too.
fn collect(geometry: Geometry<f64>, found: &mut Vec<geo::Polygon<f64>>) -> Result<(), String> {
    match geometry {
        Geometry::Polygon(polygon) => found.push(polygon),
        Geometry::MultiPolygon(polygons) => found.extend(polygons),
        Geometry::Rect(rect) => found.push(rect.to_polygon()),
        Geometry::GeometryCollection(parts) => {
            for part in parts {
                collect(part, found)?;
            }
        }
        _ => return Err("holds what is no polygon".to_owned()),
    }
    Ok(())
}

impl From<Rings> for Ground {
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

impl From<Ground> for Rings {
    fn from(ground: Ground) -> Self {
        let corners = |ring: &geo::LineString<f64>| ring.coords().map(|c| (c.x, c.y)).collect();
        let rings = |polygon: &geo::Polygon<f64>| {
            let holes = polygon.interiors().iter();
            std::iter::once(polygon.exterior())
                .chain(holes)
                .map(corners)
                .collect()
        };
        ground.polygons.iter().map(rings).collect()
    }
}

impl PointFilter {
    /// Whether all points fulfil it.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether the point of `record`, in the run's format, at `world` takes part.
    pub(super) fn keeps(&self, record: &[u8], world: &[f64; 3]) -> bool {
        let record = RecordView::new(record);
        let class = record.classification();
        let has_class = self
            .keep_classes
            .as_ref()
            .is_none_or(|k| k.contains(&class))
            && !self.drop_classes.contains(&class);
        has_class
            && !(self.drop_withheld && record.is_withheld())
            && self.bounds.is_none_or(|sides| is_within(world, &sides))
            && self.polygons.as_ref().is_none_or(|ground| {
                let place = Coord {
                    x: world[0],
                    y: world[1],
                };
                is_within(world, &ground.bounds) && ground.polygons.intersects(&place)
            })
    }

    /// Whether a point that takes part may lie in the rectangle from `min` to `max`.
    pub(super) fn may_keep(&self, min: [f64; 2], max: [f64; 2]) -> bool {
        let sides = [self.bounds, self.polygons.as_ref().map(|g| g.bounds)];
        sides
            .into_iter()
            .flatten()
            .all(|[west, south, east, north]| {
                min[0] <= east && max[0] >= west && min[1] <= north && max[1] >= south
            })
    }
}

fn is_within(world: &[f64; 3], [west, south, east, north]: &[f64; 4]) -> bool {
    (*west..=*east).contains(&world[0]) && (*south..=*north).contains(&world[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::format::record::{CLASSIFICATION, FLAGS, WITHHELD};

    fn record(class: u8, flags: u8) -> [u8; 30] {
        let mut record = [0; 30];
        record[FLAGS] = flags;
        record[CLASSIFICATION] = class;
        record
    }

    #[test]
    fn classes_and_flags_decide() {
        let filter = PointFilter {
            keep_classes: Some(vec![2, 6]),
            drop_classes: vec![6],
            drop_withheld: true,
            ..PointFilter::default()
        };
        let keeps = |class, flags| filter.keeps(&record(class, flags), &[0.0; 3]);
        assert!(keeps(2, 0) && keeps(2, 1));
        assert!(!keeps(6, 0) && !keeps(3, 0) && !keeps(2, WITHHELD));
        assert!(PointFilter::default().keeps(&record(7, WITHHELD), &[1e9; 3]));
    }

    #[test]
    fn text_and_json_are_the_same_ground() {
        let wkt = "POLYGON ((0 0, 10 0, 10 10, 0 10, 0 0), (4 4, 6 4, 6 6, 4 6, 4 4))";
        let json = r#"{"type": "FeatureCollection", "features": [{"type": "Feature",
            "properties": null, "geometry": {"type": "Polygon", "coordinates":
            [[[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]],
             [[4, 4], [6, 4], [6, 6], [4, 6], [4, 4]]]}}]}"#;
        let ground = Ground::from_text(wkt).unwrap();
        assert_eq!(Ground::from_text(json).unwrap(), ground);
        let kept = serde_json::to_string(&ground).unwrap();
        assert_eq!(serde_json::from_str::<Ground>(&kept).unwrap(), ground);
        let filter = PointFilter {
            polygons: Some(ground),
            ..PointFilter::default()
        };
        let keeps = |x, y| filter.keeps(&record(0, 0), &[x, y, 0.0]);
        assert!(keeps(1.0, 1.0) && keeps(0.0, 5.0) && keeps(4.0, 5.0));
        assert!(!keeps(5.0, 5.0) && !keeps(10.1, 5.0));
        assert!(filter.may_keep([-5.0, 1.0], [0.0, 2.0]));
        assert!(!filter.may_keep([11.0, 1.0], [12.0, 2.0]));
    }

    #[test]
    fn what_is_no_polygon_is_refused() {
        for (text, why) in [
            ("POINT (1 2)", "no polygon"),
            ("GEOMETRYCOLLECTION EMPTY", "no polygon"),
            ("{\"type\": 3}", "GeoJSON"),
            ("hello", "well-known"),
        ] {
            let error = Ground::from_text(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}
