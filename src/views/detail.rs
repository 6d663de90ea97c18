//! One place before and after, to be looked at.

use super::ViewError;
use crate::{
    geometry::{Quantization, Rect, Stored},
    tile::{Plan, SettledTiles, Spill},
};

/// A square of the plane with what lies in it, from above. Lengths are in
/// spacings, from the square's south-west corner and from its lowest point.
#[derive(Clone, Debug, Default)]
pub(crate) struct DetailView {
    /// Its side.
    pub(crate) side: f64,
    /// Points of the input, or an even choice of them.
    pub(crate) before: Vec<[f64; 3]>,
    /// Share of the input's points that are shown.
    pub(crate) shown: f64,
    /// Points of the output.
    pub(crate) after: Vec<[f64; 3]>,
}

/// Side of the square, in spacings.
const SIDE: f64 = 24.0;
/// Points of the input that are shown, about.
const SHOWN: u64 = 2500;

/// What a place is looked at in.
pub(crate) struct CloudPair<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) spill: &'a Spill,
    /// Where the sites are settled.
    pub(crate) settled: &'a SettledTiles,
    pub(crate) record_length: usize,
    /// Whether records have colour.
    pub(crate) has_color: bool,
    /// Sites to a point of the input.
    pub(crate) sites_per_point: f64,
    pub(crate) quantization: &'a Quantization,
    pub(crate) spacing: f64,
}

impl CloudPair<'_> {
    fn sites(&self, tile: u32) -> Result<Vec<Stored>, ViewError> {
        let records = self.settled.records(tile)?;
        let records = records.chunks_exact(self.record_length);
        Ok(records.map(Stored::of_record).collect())
    }

    /// Calls `visit` with the record of every site.
    pub(crate) fn visit(&self, visit: &mut dyn FnMut(&[u8])) -> Result<(), ViewError> {
        for tile in &self.plan.tiles {
            let records = self.settled.records(tile.id)?;
            records
                .chunks_exact(self.record_length)
                .for_each(&mut *visit);
        }
        Ok(())
    }

    /// The middle of `tile`; nothing if it has no site.
    pub(crate) fn at_middle(&self, tile: u32) -> Result<DetailView, ViewError> {
        match self.site_near(tile, None)? {
            Some(middle) => self.around(middle),
            None => Ok(DetailView::default()),
        }
    }

    /// The site of `tile` that is nearest to `place`, or else to the mean of all.
    pub(crate) fn site_near(
        &self,
        tile: u32,
        place: Option<[i64; 2]>,
    ) -> Result<Option<[i64; 2]>, ViewError> {
        let sites = self.sites(tile)?;
        Ok(place.or_else(|| mean(&sites)).and_then(|[x, y]| {
            sites
                .iter()
                .map(|s| [i64::from(s.x), i64::from(s.y)])
                .min_by_key(|&[a, b]| (i128::from(a - x).pow(2) + i128::from(b - y).pow(2), a, b))
        }))
    }

    /// The square around `middle` (stored units).
    pub(crate) fn around(&self, middle: [i64; 2]) -> Result<DetailView, ViewError> {
        let Self {
            plan,
            spill,
            quantization,
            spacing,
            ..
        } = *self;
        let square = Rect {
            min: middle.map(|c| c - quantization.units(0.5 * SIDE * spacing)),
            max: middle.map(|c| c + quantization.units(0.5 * SIDE * spacing)),
        };
        let mut count = 0;
        spill.gather(&square, |_| count += 1)?;
        let shown = (SHOWN as f64 / f64::from(count)).min(1.0);
        let threshold = (shown * u64::MAX as f64) as u64;
        let mut before = Vec::new();
        spill.gather(&square, |record| {
            let point = Stored::of_record(record);
            if point.tie_break_hash() <= threshold {
                before.push(point);
            }
        })?;
        let mut after = Vec::new();
        let near = square.grown(quantization.units(SIDE * spacing));
        for tile in plan.tiles.iter().filter(|t| t.core.intersects(&near)) {
            after.extend(
                self.sites(tile.id)?
                    .into_iter()
                    .filter(|&p| square.contains(p)),
            );
        }
        let lowest = before.iter().chain(&after).map(|p| p.z).min().unwrap_or(0);
        let places = |mut points: Vec<Stored>| -> Vec<[f64; 3]> {
            // The highest last, so that it is drawn above the others.
            points.sort_unstable_by_key(|p| (p.z, p.x, p.y));
            points
                .into_iter()
                .map(|p| {
                    let from_corner = [
                        i64::from(p.x) - square.min[0],
                        i64::from(p.y) - square.min[1],
                        i64::from(p.z) - i64::from(lowest),
                    ];
                    from_corner.map(|c| c as f64 * quantization.scale / spacing)
                })
                .collect()
        };
        Ok(DetailView {
            side: SIDE,
            before: places(before),
            shown,
            after: places(after),
        })
    }
}

/// The mean of all sites.
fn mean(sites: &[Stored]) -> Option<[i64; 2]> {
    let count = i64::try_from(sites.len()).ok().filter(|&n| n > 0)?;
    let mean = |of: fn(&Stored) -> i32| sites.iter().map(|s| i64::from(of(s))).sum::<i64>() / count;
    Some([mean(|s| s.x), mean(|s| s.y)])
}
