//! Sets of points of which each contains the one before and is elected from the one after: the levels of an octree, and the
//! ranks of a file of which every beginning is an even cloud.
//!
//! ```text
//!   all points ⊃ elected of them, radius r ⊃ elected of these, q r ⊃ elected of these, q² r ⊃ …
//! ```
//!
//! The radius of the finest election is 1.45 or 1.35 spacings, between those of the first two shells of neighbours of a
//! hexagonal lattice, 1 and √3 spacings: even points stand nearly so, and a radius near a shell would exclude some
//! neighbours of it and not others.

use super::{
    cloud::Workspace,
    election::Election,
    nearest_figures::{NearestFigures, nearest_figures},
    point_set::{ElectedSet, PointSet},
    radius_search::elect_number,
    store::{SortedRecords, StoreError},
};
use crate::geometry::{Rect, Stored, spread};

/// Nested sets of points; the last contains all of them.
pub(super) struct NestedSets<'a> {
    /// The elected sets, the smallest first.
    elected: Vec<ElectedSet>,
    all: &'a dyn SortedRecords,
}

impl<'a> NestedSets<'a> {
    /// Elects a set for each radius in `radii` (stored units), which ascend, from the one before; the first is elected from `all`.
    /// Ends with a set of no more than `fewest` points.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read or written.
    pub(super) fn elect(
        all: &'a dyn SortedRecords,
        radii: impl IntoIterator<Item = f64>,
        fewest: u64,
        workspace: &Workspace<'_>,
    ) -> Result<Self, StoreError> {
        let mut radii = radii.into_iter();
        Self::nest(all, fewest, |from, _, number| match radii.next() {
            None => Ok(None),
            Some(radius) => {
                let elected = from.elect(&Election::new(radius), workspace, number)?;
                Ok(Some((elected, radius)))
            }
        })
    }

    /// Elects a set of about each of these `shares` of all points, which descend, from the one before; the first is elected from `all`,
    /// first with `radius` (stored units). A set has no fewer points than its share if possible. Ends with a set of no more than
    /// `fewest` points.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read or written.
    pub(super) fn elect_shares(
        all: &'a dyn SortedRecords,
        shares: impl IntoIterator<Item = f64>,
        radius: f64,
        fewest: u64,
        workspace: &Workspace<'_>,
    ) -> Result<Self, StoreError> {
        let mut shares = shares.into_iter();
        Self::nest(all, fewest, |from, last_radius, number| {
            let Some(share) = shares.next() else {
                return Ok(None);
            };
            let wanted = share * all.points() as f64;
            // Of a hexagonal lattice with edges *h* a third is a lattice with edges √3 *h*.
            let radius = last_radius.map_or(radius, |last| 3_f64.sqrt() * last);
            elect_number(from, wanted, radius, workspace, number).map(Some)
        })
    }

    /// Elects set after set by `next`, which gets the last set (at first all points), the radius of its election, and the number of
    /// the set to elect, until it finds none or a set has no more than `fewest` points.
    fn nest(
        all: &'a dyn SortedRecords,
        fewest: u64,
        mut next: impl FnMut(
            &PointSet<'_>,
            Option<f64>,
            usize,
        ) -> Result<Option<ElectedSet>, StoreError>,
    ) -> Result<Self, StoreError> {
        let mut elected: Vec<ElectedSet> = Vec::new();
        loop {
            let found = match elected.last() {
                Some((from, radius)) => next(from, Some(*radius), elected.len())?,
                None => next(&PointSet::Records(all), None, 0)?,
            };
            let Some(found) = found else { break };
            let is_last = found.0.len() <= fewest;
            elected.push(found);
            if is_last {
                break;
            }
        }
        elected.reverse();
        Ok(Self { elected, all })
    }

    /// The number of the last set, which contains all points.
    pub(super) fn last(&self) -> u8 {
        // The levels of an octree and the ranks of a file are some dozens.
        self.elected.len() as u8
    }

    /// The number of points of the set with this number.
    pub(super) fn len(&self, set: u8) -> u64 {
        match self.elected.get(usize::from(set)) {
            Some((elected, _)) => elected.len(),
            None => self.all.points(),
        }
    }

    /// The elected positions in `rect` in ascending order, each with the number of the first set that contains it.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn first_sets(&self, rect: &Rect) -> Result<Vec<(Stored, u8)>, StoreError> {
        let mut found = Vec::new();
        for (number, (set, _)) in (0..).zip(&self.elected) {
            found.extend(set.read(rect)?.into_iter().map(|point| (point, number)));
        }
        found.sort_unstable();
        found.dedup_by_key(|(point, _)| *point);
        Ok(found)
    }

    /// The figures of each set but the last. Lengths are stored units.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn figures(
        &self,
        workspace: &Workspace<'_>,
    ) -> Result<Vec<NearestFigures>, StoreError> {
        let figures = self
            .elected
            .iter()
            .enumerate()
            .map(|(number, (set, radius))| {
                let name = format!("figures-{number}");
                nearest_figures(set, *radius, &|found, _| Ok(found), &name, workspace)
            });
        figures.collect()
    }

    /// The figures of the first `share` of the points in the order of [`order_key`], and the number of these points, which
    /// is that share within the fluctuations of a hash.
    ///
    /// # Errors
    ///
    /// If temporary files cannot be read.
    pub(super) fn figures_of_share(
        &self,
        share: f64,
        workspace: &Workspace<'_>,
    ) -> Result<NearestFigures, StoreError> {
        let wanted = share * self.all.points() as f64;
        let set = (0..self.last())
            .find(|&set| self.len(set) as f64 >= wanted)
            .unwrap_or(self.last());
        let before = set.checked_sub(1).map_or(0, |before| self.len(before));
        let new = (self.len(set) - before).max(1);
        let limit = ((wanted - before as f64) / new as f64 * u64::MAX as f64) as u64;
        let (all, elected) = (
            PointSet::Records(self.all),
            self.elected.get(usize::from(set)),
        );
        // The distances of a part of all points are some spacings; of an elected set, some radii.
        let (from, radius) = match elected {
            Some((elected, radius)) => (elected, *radius),
            None => (&all, self.elected.last().map_or(1.0, |(_, radius)| *radius)),
        };
        let earlier = (usize::from(set).checked_sub(1)).map(|before| &self.elected[before].0);
        let chosen = |mut found: Vec<Stored>, rect: &Rect| {
            let mut before = match earlier {
                Some(earlier) => earlier.read(rect)?,
                None => Vec::new(),
            };
            before.sort_unstable();
            found.retain(|p| order_key(*p) <= limit || before.binary_search(p).is_ok());
            Ok(found)
        };
        let figures = nearest_figures(from, radius, &chosen, "figures", workspace)?;
        Ok(NearestFigures {
            spacing: f64::NAN,
            ..figures
        })
    }

    /// Removes the temporary files.
    pub(super) fn remove(self) {
        self.elected.into_iter().for_each(|(set, _)| set.remove());
    }
}

/// The key by which points of a set that no earlier set contains are put in order: a hash, independent of the one that breaks
/// ties in elections.
pub(super) fn order_key(point: Stored) -> u64 {
    spread(point.tie_break_hash() ^ 0x6c6c_6f79_6461_7221)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        las::write::{
            store::SortingSpace,
            stored_in_memory::{MemorySpace, workspace},
        },
        tiling::CellGrid,
    };

    /// A sheet of 100 × 80 points a hundred units apart, moved a little, and every tenth twice, as records of 20 bytes.
    fn records() -> Vec<[u8; 20]> {
        let mut records = Vec::new();
        for i in 0..8000_u64 {
            let moved = |c: u64, k: u64| 100 * c as i32 + (spread(3 * i + k) % 20) as i32 - 3000;
            let place = [moved(i % 100, 0), moved(i / 100, 1), moved(i % 7, 2) / 8];
            for copy in 0..=u8::from(i % 10 == 0) {
                let mut record = [copy; 20];
                for (bytes, c) in record.chunks_exact_mut(4).zip(place) {
                    bytes.copy_from_slice(&c.to_le_bytes());
                }
                records.push(record);
            }
        }
        records
    }

    fn sorted(records: &[[u8; 20]]) -> Box<dyn SortedRecords> {
        let mut sorter = MemorySpace.begin("", CellGrid::new(800), 20).unwrap();
        records
            .iter()
            .for_each(|record| sorter.push(record).unwrap());
        sorter.finish().unwrap()
    }

    #[test]
    fn sets_are_nested_and_the_same_in_little_memory_and_for_any_order_of_points() {
        let mut records = records();
        let of = |records: &[[u8; 20]], bytes: usize| {
            let (all, workspace) = (sorted(records), workspace(1.0, bytes));
            let radii = [145.0, 290.0, 580.0];
            let sets = NestedSets::elect(&*all, radii, 0, &workspace).unwrap();
            let figures = sets.figures(&workspace).unwrap();
            let share = sets.figures_of_share(0.2, &workspace).unwrap();
            (sets.first_sets(&Rect::EVERYWHERE).unwrap(), figures, share)
        };
        let (sets, figures, share) = of(&records, 1 << 30);
        records.reverse();
        let (again, small, small_share) = of(&records, 200 * 1500);
        assert!(sets == again);
        assert!(figures.len() == 3 && sets.len() as u64 == figures[2].points);
        assert!(share.points == small_share.points && share.points.abs_diff(1760) < 150);
        for (number, (figures, small)) in figures.iter().zip(&small).enumerate() {
            let radius = [580.0, 290.0, 145.0][number];
            assert!(figures.least >= radius && figures.least == small.least);
            assert!(figures.points == small.points && (figures.cv - small.cv).abs() < 1e-9);
            let down_to = sets.iter().filter(|(_, set)| usize::from(*set) <= number);
            assert_eq!(down_to.count() as u64, figures.points);
            assert!(figures.cv < 0.16, "{figures:?}");
        }
    }
}
