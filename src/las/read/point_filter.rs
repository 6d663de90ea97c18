//! The condition that points of the inputs fulfil to take part in a run.

use serde::{Deserialize, Serialize};

use super::polygon_filter::{PolygonFilter, is_within};
use crate::las::format::record::RecordView;

/// A condition on points; the default accepts all. Coordinates are in the CRS of the data.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct PointFilter {
    /// The classes to accept; `None` for all.
    pub(crate) keep_classes: Option<Vec<u8>>,
    /// The classes to leave out.
    pub(crate) drop_classes: Vec<u8>,
    /// Whether points that are withheld are left out.
    pub(crate) drop_withheld: bool,
    /// The west, south, east and north side of a rectangle; points on them are inside.
    pub(crate) bounds: Option<[f64; 4]>,
    /// The polygons in which points lie; points on their edges are inside.
    pub(crate) polygons: Option<PolygonFilter>,
}

impl PointFilter {
    /// Whether all points are accepted.
    pub(crate) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether the point of `record`, in the run's format, at `world` is accepted.
    pub(super) fn accepts(&self, record: &[u8], world: &[f64; 3]) -> bool {
        let record = RecordView::new(record);
        let class = record.classification();
        let accepted = self.keep_classes.as_ref();
        let has_class = accepted.is_none_or(|accepted| accepted.contains(&class))
            && !self.drop_classes.contains(&class);
        has_class
            && !(self.drop_withheld && record.is_withheld())
            && self.bounds.is_none_or(|sides| is_within(world, &sides))
            && self
                .polygons
                .as_ref()
                .is_none_or(|polygons| polygons.contains(world))
    }

    /// Whether a point in the rectangle from `min` to `max` may be accepted; `false` is
    /// certain.
    pub(super) fn may_accept(&self, min: [f64; 2], max: [f64; 2]) -> bool {
        let polygons = self.polygons.as_ref();
        let sides = [self.bounds, polygons.map(PolygonFilter::bounds)];
        sides
            .into_iter()
            .flatten()
            .all(|[west, south, east, north]| {
                min[0] <= east && max[0] >= west && min[1] <= north && max[1] >= south
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::las::format::fields::{CLASSIFICATION, FLAGS, WITHHELD};

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
        let accepts = |class, flags| filter.accepts(&record(class, flags), &[0.0; 3]);
        assert!(accepts(2, 0) && accepts(2, 1));
        assert!(!accepts(6, 0) && !accepts(3, 0) && !accepts(2, WITHHELD));
        assert!(PointFilter::default().accepts(&record(7, WITHHELD), &[1e9; 3]));
    }

    #[test]
    fn a_rectangle_beside_all_polygons_has_no_accepted_point() {
        let square = vec![vec![vec![
            (0.0, 0.0),
            (10.0, 0.0),
            (10.0, 10.0),
            (0.0, 10.0),
        ]]];
        let filter = PointFilter {
            polygons: Some(PolygonFilter::from(square)),
            ..PointFilter::default()
        };
        let accepts = |x, y| filter.accepts(&record(0, 0), &[x, y, 0.0]);
        assert!(accepts(1.0, 1.0) && accepts(0.0, 5.0) && !accepts(10.1, 5.0));
        assert!(filter.may_accept([-5.0, 1.0], [0.0, 2.0]));
        assert!(!filter.may_accept([11.0, 1.0], [12.0, 2.0]));
    }
}
