//! Transfer of attributes: the record of an output point, from the scan around it.
//!
//! A record is that of the nearest input point. Colour, intensity and class may be replaced by those
//! of all input points in the cell of the output point ([`CellAttributes`]), and computed attributes
//! may be added. Of several input points at one position the one with the smallest record
//! counts, in whatever order they were read.

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use super::cell_attributes::CellAttributes;
use crate::{
    config::{ClassRule, ColorRule, Computed, Settings},
    geometry::{ITEMS_PER_TASK, Local, Quantization, Rect, Stored},
    job::error::JobError,
    las::{RealAttribute, RecordFormat, RecordView},
    lloyd::{IsolatedRule, Scan, Site},
    tile::{Spill, Spilled},
};

/// Largest distance at which an input point is matched with an output point, or an output point with
/// an input point, in spacings.
pub(crate) const FARTHEST_MATCH_IN_SPACINGS: f64 = 8.0;

/// The class of noise (LAS 1.4, table 17: low point; in records of the older formats, too).
const NOISE: u8 = 7;

/// The rules by which records of the output are made.
#[derive(Clone, Debug)]
pub(crate) struct Transfer {
    color: ColorRule,
    class: ClassRule,
    /// Whether the points of isolated seeds get a class of their own.
    marks_isolated: bool,
    /// Whether the spacing varies.
    is_graded: bool,
    /// The attributes that are added, each with its components in the record.
    computed: Vec<(Computed, Vec<RealAttribute>)>,
    record: RecordFormat,
    /// Length of a scanned record without the bytes that nothing describes. Added attributes stand
    /// before these bytes.
    described_length: usize,
}

/// The sites of a tile, and the scan that their records come from.
pub(super) struct TransferSites<'a> {
    /// The scan as it was measured, without smoothing.
    pub(super) scan: &'a Scan,
    /// All sites of the tile.
    pub(super) sites: &'a [Site],
    /// The sites at home in the core of the tile: these get records.
    pub(super) own: &'a [Site],
    /// The identities of the isolated sites among these, in order.
    pub(super) isolated: &'a [Stored],
    /// The rectangle of the scan that the tile contains.
    pub(super) known: &'a Rect,
    /// The spacing (CRS units).
    pub(super) spacing: f64,
}

/// The part of the scan that the records of a tile are made from.
#[derive(Default)]
struct Gathered {
    /// Records of the nearest input points.
    records: HashMap<Stored, Vec<u8>>,
    /// Attributes of the cells, by the index of the site.
    cells: HashMap<u32, CellAttributes>,
}

impl TransferSites<'_> {
    /// The position of `site` as it is written; measured figures refer to it.
    fn written_position(&self, site: &Site) -> Local {
        let quantization = self.scan.quantization();
        quantization
            .stored(site.position)
            .map_or(site.position, |stored| quantization.local(stored))
    }

    /// For every own site the nearest input point and its distance, or the site's seed and the
    /// largest distance of a match.
    fn nearest_points(&self) -> Vec<(Stored, f64)> {
        let farthest = FARTHEST_MATCH_IN_SPACINGS * self.spacing;
        let nearest_of = |site: &Site| {
            self.scan
                .nearest(self.written_position(site), farthest)
                .unwrap_or((site.identity, farthest))
        };
        self.own
            .par_iter()
            .with_max_len(ITEMS_PER_TASK)
            .map(nearest_of)
            .collect()
    }
}

impl Transfer {
    /// The transfer from records of the format `scanned`, by `settings`.
    pub(crate) fn new(scanned: &RecordFormat, settings: &Settings) -> Self {
        let mut record = scanned.clone();
        let is_graded = settings.solver.grading.is_some();
        let mut with = settings.attributes.with.clone();
        // Figures of points whose spacing varies need it.
        if is_graded && !with.contains(&Computed::Spacing) {
            with.push(Computed::Spacing);
        }
        let computed: Vec<_> = with
            .into_iter()
            .map(|computed| {
                let components = names(computed)
                    .iter()
                    .map(|(name, description)| record.add_real(name, description))
                    .collect();
                (computed, components)
            })
            .collect();
        Self {
            color: settings.attributes.color,
            class: settings.attributes.class,
            marks_isolated: settings.solver.isolated == IsolatedRule::Mark,
            is_graded,
            computed,
            record,
            described_length: scanned.described_length(),
        }
    }

    /// The format of the output's records.
    pub(crate) fn record(&self) -> &RecordFormat {
        &self.record
    }

    /// The components of the normal, if it is one of the added attributes.
    pub(super) fn normal(&self) -> Option<[RealAttribute; 3]> {
        let is_normal =
            |(computed, _): &&(Computed, Vec<RealAttribute>)| *computed == Computed::Normals;
        let (_, components) = self.computed.iter().find(is_normal)?;
        components.as_slice().try_into().ok()
    }

    /// The component with the wanted spacing at a point of the output, if it varies.
    pub(super) fn spacing(&self) -> Option<RealAttribute> {
        let is_spacing =
            |(computed, _): &&(Computed, Vec<RealAttribute>)| *computed == Computed::Spacing;
        let (_, components) = self.computed.iter().find(is_spacing)?;
        components.first().copied().filter(|_| self.is_graded)
    }

    /// Whether records depend on all points in a cell, not only on the nearest one.
    pub(super) fn needs_cells(&self) -> bool {
        let needs = |(computed, _): &(Computed, Vec<RealAttribute>)| *computed == Computed::Density;
        self.color == ColorRule::Mean
            || self.class == ClassRule::Majority
            || self.computed.iter().any(needs)
    }

    /// Makes the records of the own sites of `tile`, one after the other, and the distances of
    /// these sites to their nearest input points.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if points cannot be read from the spill.
    pub(super) fn records(
        &self,
        spill: &Spill,
        tile: &TransferSites<'_>,
    ) -> Result<(Vec<u8>, Vec<f64>), JobError> {
        // Find the nearest input point of every site, then its record and the points of its cell.
        let nearest = tile.nearest_points();
        let gathered = self.gather(spill, tile, &nearest)?;

        // Number the sites, if there are cells.
        let index_of: HashMap<Stored, u32> = match gathered.cells.is_empty() {
            true => HashMap::new(),
            false => tile.sites.iter().map(|s| s.identity).zip(0..).collect(),
        };

        // Copy the nearest records, around the added attributes, and complete them.
        let length = self.record.record_length();
        let mut records = vec![0; tile.own.len() * length];
        let sites = tile.own.iter().zip(&nearest);
        for (record, (site, &(point, distance))) in records.chunks_exact_mut(length).zip(sites) {
            if let Some(found) = gathered.records.get(&point) {
                let (described, rest) = found.split_at(self.described_length);
                record[..described.len()].copy_from_slice(described);
                record[length - rest.len()..].copy_from_slice(rest);
            }
            let cell = index_of
                .get(&site.identity)
                .and_then(|index| gathered.cells.get(index));
            self.complete(record, site, cell, distance);
            if self.marks_isolated && tile.isolated.binary_search(&site.identity).is_ok() {
                RecordView::new(record).set_classification(NOISE);
            }
        }
        Ok((records, nearest.into_iter().map(|(_, d)| d).collect()))
    }

    /// Reads the records of the `nearest` points from the spill, and the attributes of the cells if
    /// records need them.
    fn gather(
        &self,
        spill: &Spill,
        tile: &TransferSites<'_>,
        nearest: &[(Stored, f64)],
    ) -> Result<Gathered, JobError> {
        let quantization: &Quantization = tile.scan.quantization();
        let wanted: HashSet<Stored> = nearest.iter().map(|&(point, _)| point).collect();
        let cells_of = self.needs_cells().then(|| {
            let positions = tile.sites.iter().map(|site| tile.written_position(site));
            let field = tile.scan.field();
            field.grid(&positions.collect::<Vec<Local>>(), 1.0)
        });
        let mut all = Gathered::default();
        spill.gather_each(
            tile.known,
            |part: &mut Gathered, spilled| {
                let Spilled::Record(record) = spilled else {
                    return;
                };
                let point = Stored::of_record(record);
                if wanted.contains(&point) {
                    keep_smallest(&mut part.records, point, record);
                }
                if let Some(sites) = &cells_of
                    && let Some((site, _)) =
                        sites.nearest(quantization.local(point), tile.spacing, |_| false)
                {
                    let cell = part.cells.entry(site).or_default();
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
        Ok(all)
    }

    /// Writes to a copied `record` the attributes that do not come from the nearest point.
    fn complete(
        &self,
        record: &mut [u8],
        site: &Site,
        cell: Option<&CellAttributes>,
        distance: f64,
    ) {
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
        for (computed, components) in &self.computed {
            let values = match computed {
                Computed::Normals => site
                    .normal
                    .map_or([f64::NAN; 3], |normal| normal.into())
                    .to_vec(),
                Computed::Curvature => vec![site.curvature],
                Computed::Area => vec![area],
                Computed::Density => vec![cell.map_or(0, CellAttributes::points) as f64 / area],
                Computed::Distance => vec![distance],
                Computed::Spacing => vec![site.spacing],
            };
            for (value, &component) in values.into_iter().zip(components) {
                RecordView::new(&mut *record).set_real(component, value);
            }
        }
    }
}

/// Names and descriptions of the components of an added attribute; LAS limits each to 32 bytes.
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
        Computed::Spacing => &[("Spacing", "wanted spacing")],
    }
}

/// Keeps `record` as the record of `point` unless a smaller one is known.
fn keep_smallest(records: &mut HashMap<Stored, Vec<u8>>, point: Stored, record: &[u8]) {
    records
        .entry(point)
        .and_modify(|known| {
            if record < known.as_slice() {
                known.copy_from_slice(record);
            }
        })
        .or_insert_with(|| record.to_vec());
}
