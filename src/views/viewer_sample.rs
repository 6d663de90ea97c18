//! A square cut out of scan and output, to be walked around.

use rayon::prelude::*;

use super::{ViewError, detail::CloudPair};
use crate::{
    geometry::{NeighborGrid, Rect, Stored},
    las::DisplayAttributes,
};

/// A square of the plane with what stands on it, before and after. Lengths are CRS units,
/// from the square's south-west corner and from its lowest point.
#[derive(Clone, Debug, Default)]
pub(crate) struct ViewerSample {
    /// Its side.
    pub(crate) side: f64,
    /// Its middle (world coordinates).
    pub(crate) middle: [f64; 2],
    /// Spacing of the output.
    pub(crate) spacing: f64,
    /// Length of a step of the points' coordinates.
    pub(crate) step: f64,
    /// Between these heights lie all points but strays.
    pub(crate) heights: [f64; 2],
    /// Whether points have colour.
    pub(crate) has_color: bool,
    /// Points of the input that lie here.
    pub(crate) scanned: u64,
    /// Of those all, or an even choice.
    pub(crate) before: Vec<ViewerPoint>,
    /// All points of the output.
    pub(crate) after: Vec<ViewerPoint>,
    /// West, south, east and north of the tiles that meet here.
    pub(crate) borders: Vec<[f64; 4]>,
}

/// A point as it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ViewerPoint {
    /// Where, in steps.
    pub(crate) place: [u16; 3],
    /// Red, green and blue.
    pub(crate) color: [u8; 3],
    /// Intensity, as a share of a strong one.
    pub(crate) intensity: u8,
    /// Class.
    pub(crate) class: u8,
    /// Distance to the nearest point of the output, in 1/128 of a spacing; of an input
    /// point nothing.
    pub(crate) distance: u8,
}

/// Points of the input that the square may hold, of the output, and of the input that are
/// shown at the most.
const MOST_INPUT: u64 = 1_200_000;
const MOST_OUTPUT: f64 = 150_000.0;
const MOST_SHOWN: u64 = 400_000;
/// Half of the square's side at the least and at the most, in spacings.
const HALF_SIDE: [f64; 2] = [12.0, 300.0];
/// Of the heights, the share that is left out at either end: strays.
const STRAY: f64 = 0.002;
/// How far the next point is looked for, in spacings.
const FARTHEST: f64 = 2.0;

/// A point of the lattice and what it looks like.
type Seen = (Stored, DisplayAttributes);

impl CloudPair<'_> {
    /// A square around a place where tiles meet, if any do, near the corner of `tile`;
    /// nothing if it has no site.
    pub(crate) fn viewer_sample(&self, tile: u32) -> Result<ViewerSample, ViewError> {
        let Some(middle) = self.at_corner(tile)? else {
            return Ok(ViewerSample::default());
        };
        let half = self.half_side(middle);
        let square = Rect {
            min: middle.map(|c| c - half),
            max: middle.map(|c| c + half),
        };
        let (scanned, before) = self.scanned(&square)?;
        let wide = square.grown(self.quantization.units(FARTHEST * self.spacing));
        let around = self.written(&wide)?;
        let distances = self.nearest(&around);
        let (after, distances): (Vec<Seen>, Vec<u8>) = around
            .into_iter()
            .zip(distances)
            .filter(|((point, _), _)| square.contains(*point))
            .unzip();
        Ok(self.shown(&square, scanned, before, after, &distances))
    }

    /// The site of `tile` that is nearest to where most tiles meet it, or to its middle
    /// if it is alone.
    fn at_corner(&self, tile: u32) -> Result<Option<[i64; 2]>, ViewError> {
        let tiles = &self.plan.tiles;
        let Some(own) = tiles.iter().find(|known| known.id == tile) else {
            return Ok(None);
        };
        let Rect { min, max } = own.core;
        let meeting = |corner: [i64; 2]| {
            let at = Rect {
                min: corner.map(|c| c - 1),
                max: corner.map(|c| c + 1),
            };
            let others = tiles.iter().filter(|other| other.id != tile);
            others.filter(|other| other.core.intersects(&at)).count()
        };
        let corners = [min, [max[0], min[1]], [min[0], max[1]], max];
        let most = corners.into_iter().max_by_key(|&corner| meeting(corner));
        let near = most.filter(|&corner| meeting(corner) > 0);
        self.site_near(tile, near)
    }

    /// Half of the side of the largest square around `middle` (stored units) that does not
    /// hold too many points, by the counts of the spill.
    fn half_side(&self, middle: [i64; 2]) -> i64 {
        let [least, most] = HALF_SIDE.map(|half| self.quantization.units(half * self.spacing));
        let grid = self.spill.grid();
        let mut squares: Vec<(i64, u64)> = self
            .spill
            .squares()
            .map(|(place, points)| {
                let Rect { min, max } = grid.rect_of_square(place);
                let beyond = |axis: usize| (max[axis] - middle[axis]).max(middle[axis] - min[axis]);
                (beyond(0).max(beyond(1)), points)
            })
            .filter(|&(half, _)| half <= most)
            .collect();
        squares.sort_unstable();
        let (mut points, mut largest) = (0, least);
        for (half, more) in squares {
            points += more;
            if points > MOST_INPUT || points as f64 * self.sites_per_point > MOST_OUTPUT {
                break;
            }
            largest = largest.max(half);
        }
        largest
    }

    /// How many points of the input lie in `square`, and those of them that are shown.
    fn scanned(&self, square: &Rect) -> Result<(u64, Vec<Seen>), ViewError> {
        let mut scanned = 0;
        self.spill.gather(square, |_| scanned += 1)?;
        let threshold = (u64::MAX / scanned.max(1)).saturating_mul(MOST_SHOWN);
        let mut seen = Vec::new();
        self.spill.gather(square, |record| {
            let point = Stored::of_record(record);
            if point.tie_break_hash() <= threshold {
                seen.push((point, DisplayAttributes::of_record(record, self.has_color)));
            }
        })?;
        Ok((scanned, seen))
    }

    /// The points of the output in `square`.
    fn written(&self, square: &Rect) -> Result<Vec<Seen>, ViewError> {
        let mut seen = Vec::new();
        // A site ends near its tile, not always in it.
        let near = square.grown(self.quantization.units(FARTHEST * self.spacing));
        for tile in self.plan.tiles.iter().filter(|t| t.core.intersects(&near)) {
            let records = self.settled.records(tile.id)?;
            for record in records.chunks_exact(self.record_length) {
                let point = Stored::of_record(record);
                if square.contains(point) {
                    seen.push((point, DisplayAttributes::of_record(record, self.has_color)));
                }
            }
        }
        Ok(seen)
    }

    /// Distance of each point to the nearest other one, as it is shown.
    fn nearest(&self, points: &[Seen]) -> Vec<u8> {
        let places: Vec<_> = points
            .iter()
            .map(|(p, _)| self.quantization.local(*p))
            .collect();
        let grid = NeighborGrid::new(&places, self.spacing);
        (0..places.len())
            .into_par_iter()
            .map(|index| {
                let is_own = |other: u32| other as usize == index;
                let near = grid.nearest(places[index], FARTHEST * self.spacing, is_own);
                let squared = near.map_or(f64::INFINITY, |(_, squared)| squared);
                // `as` saturates.
                (128.0 * squared.sqrt() / self.spacing) as u8
            })
            .collect()
    }

    fn shown(
        &self,
        square: &Rect,
        scanned: u64,
        before: Vec<Seen>,
        after: Vec<Seen>,
        distances: &[u8],
    ) -> ViewerSample {
        let scale = self.quantization.scale;
        let all = || before.iter().chain(&after);
        let mut heights: Vec<i32> = all().map(|(point, _)| point.z).collect();
        heights.par_sort_unstable();
        let [Some(&lowest), Some(&highest)] = [heights.first(), heights.last()] else {
            return ViewerSample::default();
        };
        let stray = (STRAY * heights.len() as f64) as usize;
        let usual = [heights[stray], heights[heights.len() - 1 - stray]];
        let above = |height: i32| i64::from(height) - i64::from(lowest);
        let side = square.max[0] - square.min[0];
        let step = side.max(above(highest)) as f64 / f64::from(u16::MAX);
        let mut intensities: Vec<u16> = all().map(|(_, looks)| looks.intensity).collect();
        let high = intensities.len() * 99 / 100;
        let strong = f64::from((*intensities.select_nth_unstable(high).1).max(1));
        let brightest = all()
            .map(|(_, looks)| looks.brightness())
            .max()
            .unwrap_or(0);
        let show = |(point, looks): &Seen, distance: u8| ViewerPoint {
            place: [
                i64::from(point.x) - square.min[0],
                i64::from(point.y) - square.min[1],
                above(point.z),
            ]
            .map(|c| (c as f64 / step).round() as u16),
            color: looks.color_in_bytes(brightest),
            intensity: (255.0 * f64::from(looks.intensity) / strong) as u8,
            class: looks.class,
            distance,
        };
        let sorted = |mut points: Vec<ViewerPoint>| {
            // Neighbours together: what is alike is packed well.
            points.par_sort_unstable_by_key(|shown| {
                let [x, y, z] = shown.place;
                (x >> 10, y >> 10, z >> 7, x, y, z)
            });
            points
        };
        let world = |axis: usize, c: i64| self.quantization.offset[axis] + c as f64 * scale;
        let inside = |axis: usize, c: i64| (c - square.min[axis]).clamp(0, side) as f64 * scale;
        let meet = self.plan.tiles.iter().filter(|t| t.core.intersects(square));
        ViewerSample {
            side: side as f64 * scale,
            middle: [0, 1].map(|axis| world(axis, square.min[axis] + side / 2)),
            spacing: self.spacing,
            step: step * scale,
            heights: usual.map(|height| above(height) as f64 * scale),
            has_color: brightest > 0,
            scanned,
            before: sorted(before.iter().map(|seen| show(seen, 0)).collect()),
            after: sorted(
                (after.iter().zip(distances))
                    .map(|(seen, &distance)| show(seen, distance))
                    .collect(),
            ),
            borders: meet
                .map(|tile| {
                    let Rect { min, max } = tile.core;
                    [
                        inside(0, min[0]),
                        inside(1, min[1]),
                        inside(0, max[0]),
                        inside(1, max[1]),
                    ]
                })
                .collect(),
        }
    }
}
