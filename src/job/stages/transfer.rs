//! What an output point takes over from the scan, and what is added to it.
//!
//! Its *cell* are the input points within a spacing of it that are nearer to it than to
//! any other output point.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use crate::job::{JobError, solving::FARTHEST};
use crate::{
    config::{ClassRule, ColorRule, Computed, Settings},
    geometry::{AT_ONCE, Local, NeighborGrid, Rect, Stored},
    las::{AveragedField, RealAttribute, RecordFormat, RecordView},
    lloyd::{Scan, Site},
    tile::Spill,
};

/// How records of the output come about.
#[derive(Clone, Debug)]
pub(crate) struct Transfer {
    color: ColorRule,
    class: ClassRule,
    /// What is added, and where in the record each of its numbers goes.
    computed: Vec<(Computed, Vec<RealAttribute>)>,
    record: RecordFormat,
    /// Length of a scanned record before the bytes that nothing describes: what is added
    /// stands before those.
    described_length: usize,
}

/// What the input points of a cell have in common.
#[derive(Clone, Debug, Default)]
struct Cell {
    points: u64,
    sums: [u64; AveragedField::ALL.len()],
    /// How many points there are of each class.
    classes: Vec<(u8, u64)>,
}

/// What is known of a part of the scan.
#[derive(Default)]
struct Found {
    /// Of the input points that are wanted, their records.
    records: HashMap<Stored, Vec<u8>>,
    /// By the number of the site.
    cells: HashMap<u32, Cell>,
}

impl Transfer {
    /// The transfer from records like `scanned`, as `settings` have it.
    pub(crate) fn new(scanned: &RecordFormat, settings: &Settings) -> Self {
        let mut record = scanned.clone();
        let computed = settings
            .with
            .iter()
            .map(|&computed| {
                let places = names(computed)
                    .iter()
                    .map(|(name, description)| record.add_real(name, description))
                    .collect();
                (computed, places)
            })
            .collect();
        Self {
            color: settings.color,
            class: settings.class,
            computed,
            record,
            described_length: scanned.described_length(),
        }
    }

    /// The format of the output's records.
    pub(crate) fn record(&self) -> &RecordFormat {
        &self.record
    }

    fn needs_cells(&self) -> bool {
        let needs = |(computed, _): &(Computed, Vec<RealAttribute>)| *computed == Computed::Density;
        self.color == ColorRule::Mean
            || self.class == ClassRule::Majority
            || self.computed.iter().any(needs)
    }

    /// The records of `own`, some of `sites`, and how far each lies from the scan, within
    /// reach; `known` is the part of the scan that is looked at.
    ///
    /// Of points at one place the one with the smallest record stands for all, whatever
    /// the order in which they were read.
    pub(crate) fn records(
        &self,
        spill: &Spill,
        scan: &Scan,
        sites: &[Site],
        own: &[Site],
        known: &Rect,
        spacing: f64,
    ) -> Result<(Vec<u8>, Vec<f64>), JobError> {
        let quantization = scan.quantization();
        // What is written is what is measured.
        let place_of = |site: &Site| {
            quantization
                .stored(site.position)
                .map_or(site.position, |stored| quantization.local(stored))
        };
        let nearest_of = |site: &Site| {
            scan.nearest(place_of(site), FARTHEST * spacing)
                .unwrap_or((site.identity, FARTHEST * spacing))
        };
        let nearest: Vec<(Stored, f64)> = own
            .par_iter()
            .with_max_len(AT_ONCE)
            .map(nearest_of)
            .collect();
        let wanted: HashSet<Stored> = nearest.iter().map(|&(point, _)| point).collect();
        let cells_of = self.needs_cells().then(|| {
            let places: Vec<Local> = sites.iter().map(place_of).collect();
            NeighborGrid::new(&places, spacing)
        });
        let mut all = Found::default();
        spill.gather_each(
            known,
            |found: &mut Found, record| {
                let point = Stored::of_record(record);
                if wanted.contains(&point) {
                    keep_smallest(&mut found.records, point, record);
                }
                if let Some(sites) = &cells_of
                    && let Some((site, _)) =
                        sites.nearest(quantization.local(point), spacing, |_| false)
                {
                    let cell = found.cells.entry(site).or_default();
                    cell.add(record, self.record.averaged_fields());
                }
            },
            |part| {
                for (point, record) in part.records {
                    keep_smallest(&mut all.records, point, &record);
                }
                for (site, cell) in part.cells {
                    all.cells.entry(site).or_default().merge(&cell);
                }
            },
        )?;

        let length = self.record.record_length();
        let mut records = vec![0; own.len() * length];
        let number_of: HashMap<Stored, u32> = match all.cells.is_empty() {
            true => HashMap::new(),
            false => sites.iter().map(|s| s.identity).zip(0..).collect(),
        };
        for ((record, site), &(point, distance)) in
            records.chunks_exact_mut(length).zip(own).zip(&nearest)
        {
            if let Some(found) = all.records.get(&point) {
                let (described, rest) = found.split_at(self.described_length);
                record[..described.len()].copy_from_slice(described);
                record[length - rest.len()..].copy_from_slice(rest);
            }
            let cell = number_of
                .get(&site.identity)
                .and_then(|number| all.cells.get(number));
            self.complete(record, site, cell, distance);
        }
        Ok((records, nearest.into_iter().map(|(_, d)| d).collect()))
    }

    /// Gives a record what is not the nearest point's.
    fn complete(&self, record: &mut [u8], site: &Site, cell: Option<&Cell>, distance: f64) {
        if let Some(cell) = cell {
            if self.color == ColorRule::Mean {
                for (mean, &field) in cell.means().zip(self.record.averaged_fields()) {
                    RecordView::new(&mut *record).set_averaged(field, mean);
                }
            }
            if self.class == ClassRule::Majority {
                let mut record = RecordView::new(&mut *record);
                record.set_classification(cell.majority(record.classification()));
            }
        }
        let area = site.bounded_area().unwrap_or(f64::NAN);
        for (computed, places) in &self.computed {
            let values = match computed {
                Computed::Normals => site
                    .normal
                    .map_or([f64::NAN; 3], |normal| normal.into())
                    .to_vec(),
                Computed::Curvature => vec![site.curvature],
                Computed::Area => vec![area],
                Computed::Density => vec![cell.map_or(0, |cell| cell.points) as f64 / area],
                Computed::Distance => vec![distance],
            };
            for (value, &at) in values.into_iter().zip(places) {
                RecordView::new(&mut *record).set_real(at, value);
            }
        }
    }
}

/// Names and descriptions of what is added, which are at most 32 letters long.
fn names(computed: Computed) -> &'static [(&'static str, &'static str)] {
    match computed {
        Computed::Normals => &[
            ("NormalX", "of the surface, upwards"),
            ("NormalY", "of the surface, upwards"),
            ("NormalZ", "of the surface, upwards"),
        ],
        Computed::Curvature => &[("Curvature", "mean, + where bent upwards")],
        Computed::Area => &[("CellArea", "of the Voronoi cell")],
        Computed::Density => &[("InputDensity", "input points to the unit of area")],
        Computed::Distance => &[("InputDistance", "to the nearest input point")],
    }
}

impl Cell {
    fn add(&mut self, record: &[u8], averaged_fields: &[AveragedField]) {
        let record = RecordView::new(record);
        self.points += 1;
        for (sum, &field) in self.sums.iter_mut().zip(averaged_fields) {
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

    fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for (sum, more) in self.sums.iter_mut().zip(other.sums) {
            *sum += more;
        }
        for &(class, points) in &other.classes {
            self.count(class, points);
        }
    }

    /// Mean values, halves up.
    fn means(&self) -> impl Iterator<Item = u16> + '_ {
        let points = self.points.max(1);
        let mean = move |sum: &u64| ((2 * sum + points) / (2 * points)) as u16;
        self.sums.iter().map(mean)
    }

    /// The class of most points; of equally many `nearest` if it is among them, else the
    /// least.
    fn majority(&self, nearest: u8) -> u8 {
        let rank =
            |&(class, count): &(u8, u64)| (count, class == nearest, std::cmp::Reverse(class));
        let most = self.classes.iter().max_by_key(|counted| rank(counted));
        most.map_or(nearest, |&(class, _)| class)
    }
}

/// Of the records of one point the smallest is kept.
fn keep_smallest(of_point: &mut HashMap<Stored, Vec<u8>>, point: Stored, record: &[u8]) {
    of_point
        .entry(point)
        .and_modify(|known| {
            if record < known.as_slice() {
                known.copy_from_slice(record);
            }
        })
        .or_insert_with(|| record.to_vec());
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
        let mut forth = Cell::default();
        let mut halves = [Cell::default(), Cell::default()];
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
