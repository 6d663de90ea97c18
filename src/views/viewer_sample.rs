//! A square cut out of input and output, for the 3-D viewer.

use rayon::prelude::*;

use super::{cloud_pair::CloudPair, error::ViewError, square_triangles::SquareTriangles};
use crate::{
    geometry::{NeighborGrid, Rect, Stored},
    las::{CloudLevels, DisplayAttributes},
};

/// A square of the plane with the points of input and output in it. Lengths are CRS units;
/// coordinates are counted from the south-west corner of the square and from the lowest point.
#[derive(Clone, Debug, Default)]
pub(crate) struct ViewerSample {
    /// The side of the square.
    pub(crate) side: f64,
    /// The middle of the square (world coordinates).
    pub(crate) middle: [f64; 2],
    /// The spacing of the output.
    pub(crate) spacing: f64,
    /// The length of one unit of [`ViewerPoint::position`].
    pub(crate) step: f64,
    /// The heights between which all points lie except for strays.
    pub(crate) heights: [f64; 2],
    /// Whether points have a colour.
    pub(crate) has_color: bool,
    /// The number of input points in the square.
    pub(crate) input_points: u64,
    /// The points of the input, or a random sample of them.
    pub(crate) before: Vec<ViewerPoint>,
    /// The points of the output.
    pub(crate) after: Vec<ViewerPoint>,
    /// The triangles between points of the output, in ascending order: the indices of their corners in `after`, the
    /// least first, counterclockwise as seen from the front. Empty without a mesh.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The west, south, east and north borders of the tiles that meet in the square.
    pub(crate) borders: Vec<[f64; 4]>,
    /// The number of points of the whole output down to each level; empty if it has no levels.
    pub(crate) levels: Vec<u64>,
}

/// A point as the viewer shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ViewerPoint {
    /// The coordinates, in steps of [`ViewerSample::step`].
    pub(crate) position: [u16; 3],
    /// Red, green and blue.
    pub(crate) color: [u8; 3],
    /// The intensity: 255 is the 99th percentile of the square, larger values are cut off.
    pub(crate) intensity: u8,
    /// The class.
    pub(crate) class: u8,
    /// The distance to the nearest other point of the output, in 1/128 of a spacing; 0 for a point
    /// of the input.
    pub(crate) distance: u8,
    /// The level of a point of the output; 0 for a point of the input, or if there are no levels.
    pub(crate) level: u8,
}

/// The expected number of input points that are shown, at most.
const VIEWER_INPUT_POINTS: u64 = 400_000;
/// The share of the heights that counts as strays at either end.
const STRAY_HEIGHT_SHARE: f64 = 0.002;
/// How far the nearest point is searched for, in spacings. A byte contains no larger distance.
const FARTHEST_SHOWN_NEIGHBOR_IN_SPACINGS: f64 = 2.0;
/// Units of [`ViewerPoint::distance`] in a spacing.
const DISTANCE_UNITS_PER_SPACING: f64 = 128.0;

/// A point with its display attributes.
type SeenPoint = (Stored, DisplayAttributes);

impl CloudPair<'_> {
    /// Cuts out the square of `mesh`, whose triangles are shown with its points, and which `levels` cover if there are any;
    /// the sample is empty if there is no square.
    ///
    /// # Errors
    ///
    /// [`ViewError::Tile`] if a temporary file cannot be read.
    pub(crate) fn viewer_sample(
        &self,
        mesh: &SquareTriangles,
        levels: Option<&CloudLevels>,
    ) -> Result<ViewerSample, ViewError> {
        let Some(square) = mesh.square else {
            return Ok(ViewerSample::default());
        };
        let (input_points, before) = self.seen_input(&square)?;
        // Nearest points may lie outside of the square.
        let reach = FARTHEST_SHOWN_NEIGHBOR_IN_SPACINGS * self.spacing;
        let around = self.seen_output(&square.grown(self.quantization.units(reach)))?;
        let distances = self.nearest_distances(&around);
        let (after, distances): (Vec<SeenPoint>, Vec<u8>) = around
            .into_iter()
            .zip(distances)
            .filter(|((point, _), _)| square.contains(*point))
            .unzip();
        let Some(frame) = Frame::of(square, &before, &after) else {
            return Ok(ViewerSample::default());
        };
        let after = sorted(
            (after.iter().zip(distances))
                .map(|(seen, distance)| ViewerPoint {
                    level: levels.map_or(0, |levels| levels.level_of(seen.0)),
                    ..frame.show(seen, distance)
                })
                .collect(),
        );
        let scale = self.quantization.scale;
        Ok(ViewerSample {
            side: frame.side() as f64 * scale,
            middle: [0, 1].map(|axis| {
                let middle = square.min[axis] + frame.side() / 2;
                self.quantization.offset[axis] + middle as f64 * scale
            }),
            spacing: self.spacing,
            step: frame.step * scale,
            heights: frame.heights.map(|height| height as f64 * scale),
            has_color: frame.brightest > 0,
            input_points,
            before: sorted(before.iter().map(|seen| frame.show(seen, 0)).collect()),
            triangles: frame.triangles(&mesh.triangles, &after),
            after,
            borders: self.borders(&square),
            levels: levels.map_or(Vec::new(), |levels| levels.points.clone()),
        })
    }

    /// Returns the number of input points in `square`, and those of a sample with equal inclusion
    /// probabilities.
    fn seen_input(&self, square: &Rect) -> Result<(u64, Vec<SeenPoint>), ViewError> {
        let mut count = 0;
        self.spill.gather(square, |_| count += 1)?;
        let threshold = (u64::MAX / count.max(1)).saturating_mul(VIEWER_INPUT_POINTS);
        let mut seen = Vec::new();
        self.spill.gather(square, |record| {
            let point = Stored::of_record(record);
            if point.tie_break_hash() <= threshold {
                seen.push((point, DisplayAttributes::of_record(record, self.has_color)));
            }
        })?;
        Ok((count, seen))
    }

    /// Returns the points of the output in `square`.
    fn seen_output(&self, square: &Rect) -> Result<Vec<SeenPoint>, ViewError> {
        let mut seen = Vec::new();
        let reach = FARTHEST_SHOWN_NEIGHBOR_IN_SPACINGS * self.spacing;
        self.gather_output(square, self.quantization.units(reach), |point, record| {
            seen.push((point, DisplayAttributes::of_record(record, self.has_color)));
        })?;
        Ok(seen)
    }

    /// Returns the distance of each point to the nearest other one, in the units of
    /// [`ViewerPoint::distance`].
    fn nearest_distances(&self, points: &[SeenPoint]) -> Vec<u8> {
        let positions: Vec<_> = points
            .iter()
            .map(|(p, _)| self.quantization.local(*p))
            .collect();
        let grid = NeighborGrid::new(&positions, self.spacing);
        let reach = FARTHEST_SHOWN_NEIGHBOR_IN_SPACINGS * self.spacing;
        (0..positions.len())
            .into_par_iter()
            .map(|index| {
                let is_own = |other: u32| other as usize == index;
                let nearest = grid.nearest(positions[index], reach, is_own);
                let distance_squared = nearest.map_or(f64::INFINITY, |(_, squared)| squared);
                // `as` saturates, so that a point alone gets the largest distance.
                (DISTANCE_UNITS_PER_SPACING * distance_squared.sqrt() / self.spacing) as u8
            })
            .collect()
    }

    /// Returns the borders of the tiles that intersect `square`, cut off at its sides.
    fn borders(&self, square: &Rect) -> Vec<[f64; 4]> {
        let side = square.max[0] - square.min[0];
        let inside = |axis: usize, c: i64| {
            (c - square.min[axis]).clamp(0, side) as f64 * self.quantization.scale
        };
        let meeting = self.plan.tiles.iter().filter(|t| t.core.intersects(square));
        meeting
            .map(|tile| {
                let Rect { min, max } = tile.core;
                [
                    inside(0, min[0]),
                    inside(1, min[1]),
                    inside(0, max[0]),
                    inside(1, max[1]),
                ]
            })
            .collect()
    }
}

/// The ranges that the values of points are shown in. Lengths are stored units.
struct Frame {
    square: Rect,
    /// The height of the lowest point.
    lowest: i32,
    /// The heights above the lowest point between which all points lie except for strays.
    heights: [i64; 2],
    /// The length of one unit of [`ViewerPoint::position`].
    step: f64,
    /// The intensity that is shown as 255.
    strong_intensity: f64,
    /// The largest value of a colour.
    brightest: u16,
}

impl Frame {
    /// Computes the ranges of the points in `square`; `None` if there are none.
    fn of(square: Rect, before: &[SeenPoint], after: &[SeenPoint]) -> Option<Self> {
        let all = || before.iter().chain(after);
        let mut heights: Vec<i32> = all().map(|(point, _)| point.z).collect();
        heights.par_sort_unstable();
        let (&lowest, &highest) = (heights.first()?, heights.last()?);
        let strays = (STRAY_HEIGHT_SHARE * heights.len() as f64) as usize;
        let usual = [heights[strays], heights[heights.len() - 1 - strays]];
        let above = |height: i32| i64::from(height) - i64::from(lowest);
        let side = square.max[0] - square.min[0];
        let mut intensities: Vec<u16> = all().map(|(_, attributes)| attributes.intensity).collect();
        let high = intensities.len() * 99 / 100;
        let strong = *intensities.select_nth_unstable(high).1;
        let brightness = all().map(|(_, attributes)| attributes.brightness());
        Some(Self {
            square,
            lowest,
            heights: usual.map(above),
            step: side.max(above(highest)) as f64 / f64::from(u16::MAX),
            strong_intensity: f64::from(strong.max(1)),
            brightest: brightness.max().unwrap_or(0),
        })
    }

    fn side(&self) -> i64 {
        self.square.max[0] - self.square.min[0]
    }

    /// Converts a point, whose nearest `distance` is given, to what the viewer shows.
    fn show(&self, (point, attributes): &SeenPoint, distance: u8) -> ViewerPoint {
        ViewerPoint {
            position: self.position(point),
            color: attributes.color_in_bytes(self.brightest),
            intensity: (255.0 * f64::from(attributes.intensity) / self.strong_intensity) as u8,
            class: attributes.class,
            distance,
            level: 0,
        }
    }

    /// Converts the coordinates of a point to those of [`ViewerPoint::position`].
    fn position(&self, point: &Stored) -> [u16; 3] {
        [
            i64::from(point.x) - self.square.min[0],
            i64::from(point.y) - self.square.min[1],
            i64::from(point.z) - i64::from(self.lowest),
        ]
        .map(|c| (c as f64 / self.step).round() as u16)
    }

    /// Converts triangles between the points `after`, which are sorted, to those of [`ViewerSample::triangles`]. A
    /// triangle of which two corners are shown at one position is left out.
    fn triangles(&self, triangles: &[[Stored; 3]], after: &[ViewerPoint]) -> Vec<[u32; 3]> {
        let index = |point: &Stored| {
            let key = order(self.position(point));
            let found = after.binary_search_by_key(&key, |shown| order(shown.position));
            found.ok().and_then(|index| u32::try_from(index).ok())
        };
        let mut shown: Vec<[u32; 3]> = triangles
            .par_iter()
            .filter_map(|[a, b, c]| {
                let mut corners = [index(a)?, index(b)?, index(c)?];
                let [a, b, c] = corners;
                // A rotation leaves the front where it is.
                corners.rotate_left(match a.min(b).min(c) {
                    least if least == a => 0,
                    least if least == b => 1,
                    _ => 2,
                });
                (a != b && b != c && c != a).then_some(corners)
            })
            .collect();
        shown.par_sort_unstable();
        shown
    }
}

/// Sorts `points` by blocks of space: neighbours have similar values, and are compressed well.
fn sorted(mut points: Vec<ViewerPoint>) -> Vec<ViewerPoint> {
    points.par_sort_unstable_by_key(|shown| order(shown.position));
    points
}

/// The key by which points are sorted: their block, then their position in it.
fn order([x, y, z]: [u16; 3]) -> [u16; 6] {
    [x >> 10, y >> 10, z >> 7, x, y, z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_keep_their_corners_and_their_front() {
        let frame = Frame {
            square: Rect {
                min: [100, 100],
                max: [200, 200],
            },
            lowest: -5,
            heights: [0, 1],
            step: 0.01,
            strong_intensity: 1.0,
            brightest: 0,
        };
        let places = [[199, 150], [101, 180], [150, 101], [160, 160]];
        let stored = places.map(|[x, y]| Stored { x, y, z: x - y });
        let attributes = DisplayAttributes {
            intensity: 0,
            color: [0; 3],
            class: 0,
        };
        let show = |point: &Stored| frame.show(&(*point, attributes), 0);
        let after = sorted(stored.iter().map(show).collect());
        let [a, b, c, d] = stored;
        let triangles = frame.triangles(&[[a, b, c], [b, c, d], [a, a, c]], &after);
        assert_eq!(triangles.len(), 2);
        let turns = |corners: [Stored; 3]| {
            [0, 1, 2].map(|turn| {
                let mut turned = corners.map(|point| frame.position(&point));
                turned.rotate_left(turn);
                turned
            })
        };
        for expected in [[a, b, c], [b, c, d]] {
            let is_shown = triangles.iter().any(|corners| {
                assert!(corners[0] < corners[1] && corners[0] < corners[2]);
                let positions = corners.map(|corner| after[corner as usize].position);
                turns(expected).contains(&positions)
            });
            assert!(is_shown, "{expected:?}");
        }
    }
}
