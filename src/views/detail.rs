//! A detail view: one square of the plane from above, before and after.

use super::{cloud_pair::CloudPair, error::ViewError};
use crate::geometry::{Rect, Stored};

/// A square of the plane from above, with the points of input and output in it. Lengths are in
/// spacings; coordinates are counted from the south-west corner of the square and from the lowest
/// point.
#[derive(Clone, Debug, Default)]
pub(crate) struct DetailView {
    /// The side of the square.
    pub(crate) side: f64,
    /// The points of the input, or a random sample of them.
    pub(crate) before: Vec<[f64; 3]>,
    /// The share of the input's points that `before` contains.
    pub(crate) shown_share: f64,
    /// The points of the output.
    pub(crate) after: Vec<[f64; 3]>,
}

/// The side of the square, in spacings.
const DETAIL_SIDE_IN_SPACINGS: f64 = 24.0;
/// The expected number of input points in a sample.
const DETAIL_INPUT_POINTS: u64 = 2500;

impl CloudPair<'_> {
    /// Makes the detail view around the site in the middle of `tile`; it is empty if the tile has
    /// no site.
    ///
    /// # Errors
    ///
    /// [`ViewError::Tile`] if a temporary file cannot be read.
    pub(crate) fn detail_in_middle_of(&self, tile: u32) -> Result<DetailView, ViewError> {
        match self.site_near(tile, None)? {
            Some(middle) => self.detail_around(middle),
            None => Ok(DetailView::default()),
        }
    }

    /// Makes the detail view around `middle` (stored units).
    ///
    /// # Errors
    ///
    /// [`ViewError::Tile`] if a temporary file cannot be read.
    pub(crate) fn detail_around(&self, middle: [i64; 2]) -> Result<DetailView, ViewError> {
        let side = DETAIL_SIDE_IN_SPACINGS * self.spacing;
        let half = self.quantization.units(0.5 * side);
        let square = Rect {
            min: middle.map(|c| c - half),
            max: middle.map(|c| c + half),
        };
        let (before, shown_share) = self.sampled_input(&square)?;
        let mut after = Vec::new();
        let margin = self.quantization.units(side);
        self.gather_output(&square, margin, |point, _| after.push(point))?;
        let lowest = before.iter().chain(&after).map(|p| p.z).min().unwrap_or(0);
        let corner = [square.min[0], square.min[1], lowest.into()];
        Ok(DetailView {
            side: DETAIL_SIDE_IN_SPACINGS,
            before: self.in_spacings(before, corner),
            shown_share,
            after: self.in_spacings(after, corner),
        })
    }

    /// Returns the points of the input in `square`, or a sample of them with equal inclusion
    /// probabilities, and that probability.
    fn sampled_input(&self, square: &Rect) -> Result<(Vec<Stored>, f64), ViewError> {
        let mut count = 0;
        self.spill.gather(square, |_| count += 1)?;
        let share = (DETAIL_INPUT_POINTS as f64 / f64::from(count)).min(1.0);
        let threshold = (share * u64::MAX as f64) as u64;
        let mut points = Vec::new();
        self.spill.gather(square, |record| {
            let point = Stored::of_record(record);
            if point.tie_break_hash() <= threshold {
                points.push(point);
            }
        })?;
        Ok((points, share))
    }

    /// Converts `points` to spacings from `corner`. They are sorted by height, so that the highest
    /// point is drawn last.
    fn in_spacings(&self, mut points: Vec<Stored>, corner: [i64; 3]) -> Vec<[f64; 3]> {
        points.sort_unstable_by_key(|p| (p.z, p.x, p.y));
        points
            .into_iter()
            .map(|p| {
                let from_corner = [
                    i64::from(p.x) - corner[0],
                    i64::from(p.y) - corner[1],
                    i64::from(p.z) - corner[2],
                ];
                from_corner.map(|c| c as f64 * self.quantization.scale / self.spacing)
            })
            .collect()
    }
}
