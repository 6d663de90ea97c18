//! Lines that select the points near them, from well-known text or GeoJSON.

use std::path::Path;

use geo::Geometry;
use serde::{Deserialize, Serialize};

use super::geometry_file::{geometry_of, text_of};

/// Number of corners of a line that share a bounding rectangle. With one rectangle for all of a line of 10 000
/// corners every point within it is compared with all of them.
const CORNERS_PER_RECTANGLE: usize = 16;

/// Lines in the CRS of the data, such as the axis of a road.
///
/// In a job's files they are lists of corners.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Corners", into = "Corners")]
pub(crate) struct LineFilter {
    pieces: Vec<Piece>,
    /// The west, south, east and north side of the bounding rectangle.
    bounds: [f64; 4],
}

/// A part of a line.
#[derive(Clone, Debug, PartialEq)]
struct Piece {
    /// The corners; the last one is the first of the next piece of the same line.
    corners: Vec<[f64; 2]>,
    /// The west, south, east and north side of the bounding rectangle.
    bounds: [f64; 4],
    /// Whether the piece begins a line.
    is_first: bool,
}

type Corners = Vec<Vec<[f64; 2]>>;

impl LineFilter {
    /// Reads lines from a file of well-known text or GeoJSON.
    ///
    /// # Errors
    ///
    /// A text that says what is wrong with the file.
    pub(crate) fn from_file(path: &Path) -> Result<Self, String> {
        Self::from_text(&text_of(path)?)
    }

    fn from_text(text: &str) -> Result<Self, String> {
        let mut lines = Vec::new();
        collect_lines(geometry_of(text)?, &mut lines)?;
        if lines.iter().all(Vec::is_empty) {
            return Err("contains no line; give at least one".to_owned());
        }
        if !lines.iter().flatten().flatten().all(|c| c.is_finite()) {
            return Err("has a corner whose coordinates are not finite numbers".to_owned());
        }
        Ok(Self::from(lines))
    }

    /// Whether the distance of `world` from the nearest line, seen from above, is at most `farthest` and at
    /// least `nearest` (CRS units).
    pub(crate) fn is_near(&self, world: &[f64; 3], [nearest, farthest]: [f64; 2]) -> bool {
        let position = [world[0], world[1]];
        let mut least = farthest * farthest;
        if distance_squared_to_rectangle(position, &self.bounds) > least {
            return false;
        }
        let mut is_near = false;
        for piece in &self.pieces {
            if distance_squared_to_rectangle(position, &piece.bounds) > least {
                continue;
            }
            let found = piece.distance_squared(position);
            is_near |= found <= least;
            least = least.min(found);
        }
        is_near && least >= nearest * nearest
    }
}

impl Piece {
    fn new(corners: &[[f64; 2]], is_first: bool) -> Self {
        let nothing = [f64::MAX, f64::MAX, f64::MIN, f64::MIN];
        let bounds = corners.iter().fold(nothing, |sides, &[x, y]| {
            [
                sides[0].min(x),
                sides[1].min(y),
                sides[2].max(x),
                sides[3].max(y),
            ]
        });
        Self {
            corners: corners.to_vec(),
            bounds,
            is_first,
        }
    }

    /// The squared distance from `position` to the nearest segment.
    fn distance_squared(&self, position: [f64; 2]) -> f64 {
        let segments = self.corners.windows(2).map(|pair| [pair[0], pair[1]]);
        // One corner alone is a segment without length.
        let alone = self.corners.first().map(|&corner| [corner, corner]);
        let distances = segments
            .chain(alone)
            .map(|segment| distance_squared_to_segment(position, segment));
        distances.fold(f64::MAX, f64::min)
    }
}

/// The squared distance from a position to a rectangle: zero inside.
fn distance_squared_to_rectangle([x, y]: [f64; 2], sides: &[f64; 4]) -> f64 {
    let [west, south, east, north] = sides;
    let dx = (west - x).max(x - east).max(0.0);
    let dy = (south - y).max(y - north).max(0.0);
    dx * dx + dy * dy
}

/// The squared distance from a position to the segment from `a` to `b`.
fn distance_squared_to_segment([x, y]: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [x - a[0], y - a[1]]);
    let length_squared = along[0] * along[0] + along[1] * along[1];
    let share = match length_squared > 0.0 {
        true => ((to[0] * along[0] + to[1] * along[1]) / length_squared).clamp(0.0, 1.0),
        false => 0.0,
    };
    let off = [to[0] - share * along[0], to[1] - share * along[1]];
    off[0] * off[0] + off[1] * off[1]
}

/// Adds the corners of all lines of `geometry` to `found`, those in collections of collections included.
fn collect_lines(geometry: Geometry<f64>, found: &mut Corners) -> Result<(), String> {
    let corners = |line: geo::LineString<f64>| line.coords().map(|c| [c.x, c.y]).collect();
    match geometry {
        Geometry::LineString(line) => found.push(corners(line)),
        Geometry::MultiLineString(lines) => found.extend(lines.into_iter().map(corners)),
        Geometry::Line(line) => found.push(vec![line.start.into(), line.end.into()]),
        Geometry::GeometryCollection(parts) => {
            for part in parts {
                collect_lines(part, found)?;
            }
        }
        _ => {
            let problem = "contains a geometry that is no line; remove points and polygons";
            return Err(problem.to_owned());
        }
    }
    Ok(())
}

impl From<Corners> for LineFilter {
    fn from(lines: Corners) -> Self {
        let mut pieces: Vec<Piece> = Vec::new();
        for corners in lines {
            let mut start = 0;
            while start < corners.len() && (start == 0 || start + 1 < corners.len()) {
                let end = (start + CORNERS_PER_RECTANGLE).min(corners.len() - 1);
                pieces.push(Piece::new(&corners[start..=end], start == 0));
                start = end.max(start + 1);
            }
        }
        let all: Vec<[f64; 2]> = pieces
            .iter()
            .flat_map(|p| p.corners.iter().copied())
            .collect();
        Self {
            bounds: Piece::new(&all, true).bounds,
            pieces,
        }
    }
}

impl From<LineFilter> for Corners {
    fn from(filter: LineFilter) -> Self {
        let mut lines = Self::new();
        for piece in filter.pieces {
            match lines.last_mut().filter(|_| !piece.is_first) {
                Some(line) => line.extend(&piece.corners[1..]),
                None => lines.push(piece.corners),
            }
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_and_json_are_the_same_lines_and_survive_storing() {
        let corners: Vec<String> = (0..50).map(|i| format!("{i} {}", i % 3)).collect();
        let wkt = format!("LINESTRING ({})", corners.join(", "));
        let json_corners: Vec<String> = (0..50).map(|i| format!("[{i}, {}]", i % 3)).collect();
        let json = format!(
            r#"{{"type": "LineString", "coordinates": [{}]}}"#,
            json_corners.join(", ")
        );
        let filter = LineFilter::from_text(&wkt).unwrap();
        assert_eq!(LineFilter::from_text(&json).unwrap(), filter);
        assert!(filter.pieces.len() > 2);
        let stored = serde_json::to_string(&filter).unwrap();
        assert_eq!(serde_json::from_str::<LineFilter>(&stored).unwrap(), filter);
        assert_eq!(Corners::from(filter)[0].len(), 50);
    }

    #[test]
    fn distances_are_those_of_the_nearest_segment() {
        let corners: Vec<[f64; 2]> = (0..60)
            .map(|i| [f64::from(i), f64::from(i * i % 17)])
            .collect();
        let filter = LineFilter::from(vec![corners.clone()]);
        for i in 0..400 {
            let position = [f64::from(i % 67) - 3.3, f64::from(i % 23) - 2.7];
            let all = corners
                .windows(2)
                .map(|pair| distance_squared_to_segment(position, [pair[0], pair[1]]).sqrt());
            let distance = all.fold(f64::MAX, f64::min);
            let world = [position[0], position[1], 9.0];
            assert_eq!(filter.is_near(&world, [0.0, 2.0]), distance <= 2.0);
            assert_eq!(
                filter.is_near(&world, [1.0, 2.0]),
                (1.0..=2.0).contains(&distance)
            );
        }
    }

    #[test]
    fn a_line_of_one_corner_or_none_is_no_panic() {
        let filter = LineFilter::from(vec![vec![[1.0, 1.0]], vec![]]);
        assert!(filter.is_near(&[1.0, 2.0, 0.0], [0.0, 1.0]));
        assert!(!LineFilter::from(vec![]).is_near(&[0.0; 3], [0.0, 1e9]));
    }

    #[test]
    fn other_geometries_are_refused() {
        for (text, why) in [
            ("POINT (1 2)", "no line"),
            ("GEOMETRYCOLLECTION EMPTY", "no line"),
            ("POLYGON ((0 0, 1 0, 1 1, 0 0))", "no line"),
            ("hello", "well-known"),
        ] {
            let error = LineFilter::from_text(text).unwrap_err();
            assert!(error.contains(why), "{text}: {error}");
        }
    }
}
