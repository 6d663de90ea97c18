//! The attributes that the input points in the cell of an output point have in common.
//!
//! The cell of an output point contains the input points within a spacing of it that are nearer to it
//! than to any other output point.

use crate::las::{AveragedField, RecordView};

/// Sums over the input points in one cell. They are integers, so that the order of the points does
/// not matter.
#[derive(Clone, Debug, Default)]
pub(super) struct CellAttributes {
    points: u64,
    sums: [u64; AveragedField::ALL.len()],
    /// Numbers of points by class.
    classes: Vec<(u8, u64)>,
}

impl CellAttributes {
    /// Number of points in the cell.
    pub(super) fn points(&self) -> u64 {
        self.points
    }

    /// Adds the point with this `record`, and its values of the `averaged` fields.
    pub(super) fn add(&mut self, record: &[u8], averaged: &[AveragedField]) {
        let record = RecordView::new(record);
        self.points += 1;
        for (sum, &field) in self.sums.iter_mut().zip(averaged) {
            *sum += u64::from(record.averaged(field));
        }
        self.count(record.classification(), 1);
    }

    fn count(&mut self, class: u8, points: u64) {
        match self.classes.iter_mut().find(|(known, _)| *known == class) {
            Some((_, count)) => *count += points,
            None => self.classes.push((class, points)),
        }
    }

    /// Adds the points of another part of the cell.
    pub(super) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for (sum, more) in self.sums.iter_mut().zip(other.sums) {
            *sum += more;
        }
        for &(class, points) in &other.classes {
            self.count(class, points);
        }
    }

    /// The means of the averaged fields; halves are rounded up.
    pub(super) fn means(&self) -> impl Iterator<Item = u16> + '_ {
        let points = self.points.max(1);
        let mean = move |sum: &u64| ((2 * sum + points) / (2 * points)) as u16;
        self.sums.iter().map(mean)
    }

    /// The class of most points. Among classes of equally many points it is the class of the
    /// `nearest` point, or else the smallest.
    pub(super) fn majority(&self, nearest: u8) -> u8 {
        let rank =
            |&(class, count): &(u8, u64)| (count, class == nearest, std::cmp::Reverse(class));
        let most = self.classes.iter().max_by_key(|counted| rank(counted));
        most.map_or(nearest, |&(class, _)| class)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(intensity: u16, red: u16, class: u8) -> Vec<u8> {
        let mut record = RecordView::new(vec![0; 36]);
        record.set_intensity(intensity);
        record.set_color([red, 0, 0]);
        record.set_classification(class);
        record.into_bytes()
    }

    #[test]
    fn a_cell_is_the_same_whatever_the_order_of_its_points() {
        let points = [(1, 65_535, 2), (2, 65_535, 6), (2, 65_534, 6), (9, 0, 2)];
        let mut forth = CellAttributes::default();
        let mut halves = [CellAttributes::default(), CellAttributes::default()];
        for (at, &(intensity, red, class)) in points.iter().enumerate() {
            forth.add(&record(intensity, red, class), AveragedField::of_format(7));
            halves[at % 2].add(&record(intensity, red, class), AveragedField::of_format(7));
        }
        let [mut back, other] = halves;
        back.merge(&other);
        // 14 / 4 is 3.5; 196 604 / 4 is 49 151.
        for cell in [&forth, &back] {
            assert_eq!(cell.means().collect::<Vec<_>>(), [4, 49_151, 0, 0, 0]);
            assert_eq!(cell.majority(6), 6);
            assert_eq!(cell.majority(2), 2);
            assert_eq!(cell.majority(9), 2);
        }
    }
}
