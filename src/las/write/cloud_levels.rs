//! What a complete cloud says of its levels: those of an octree, or the ranks of a file in progressive order.

use super::{
    nearest_figures::NearestFigures, nested_sets::NestedSets, point_order::PointOrder,
    store::StoreError,
};
use crate::geometry::{Rect, Stored};

/// The levels of a cloud, each with those before it. Lengths are CRS units.
#[derive(Clone, Debug)]
pub(crate) struct CloudLevels {
    /// What the levels are: those of an octree, or the ranks of a file in progressive order.
    pub(crate) order: PointOrder,
    /// The number of points down to each level; the last one is that of all points.
    pub(crate) points: Vec<u64>,
    /// The figures of an octree's levels but the last, or of the first 1, 3, 10 and 30 % of a file.
    pub(crate) figures: Vec<NearestFigures>,
    /// The elected positions in the rectangle that was asked for, in ascending order, each with its level. All other points
    /// belong to the last level.
    pub(crate) seen: Vec<(Stored, u8)>,
}

impl CloudLevels {
    /// The levels of `sets`, with `figures` in stored units of `scale`, and the levels of the positions in `seen`.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn new(
        order: PointOrder,
        sets: &NestedSets<'_>,
        figures: Vec<NearestFigures>,
        scale: f64,
        seen: Option<&Rect>,
    ) -> Result<Self, StoreError> {
        Ok(Self {
            order,
            points: (0..=sets.last()).map(|set| sets.len(set)).collect(),
            figures: (figures.into_iter())
                .map(|figures| figures.scaled(scale))
                .collect(),
            seen: match seen {
                Some(rect) => sets.first_sets(rect)?,
                None => Vec::new(),
            },
        })
    }

    /// The level of the point at `position`.
    pub(crate) fn level_of(&self, position: Stored) -> u8 {
        let found = self
            .seen
            .binary_search_by_key(&position, |(point, _)| *point);
        found.map_or(self.points.len() as u8 - 1, |index| self.seen[index].1)
    }
}
