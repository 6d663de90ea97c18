//! Rounds: iterations that all tiles do before any tile does the next.
//!
//! A tile sees as far around its core as influence travels until it is done. Twenty iterations
//! after an election are 43 spacings; where a tile has room for little more, nearly all its work
//! is that of its neighbours. In two rounds it is 25: first the election and a few iterations,
//! then, with the sites as the neighbours have left them, the rest.
//!
//! ```text
//!   one round    ├─ election ─┼──────────── 20 iterations ────────────┤ core
//!   two rounds               ├─ election ─┼─ 5 iterations ─┤ core
//!                            ├─ fit ─┼──── 15 iterations ──┤ core
//! ```
//!
//! A site continues from its [state](super::site_state), which is all that the next iteration
//! knows of the last. So the bits are the same, in one round or two.

use std::ops::Range;

use super::options::SolverOptions;

/// Iterations that all tiles do before any tile does the next.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Round {
    /// The iterations.
    pub(crate) iterations: Range<u32>,
    /// Depth (CRS units) inside the rectangle of available points from which on every tile
    /// begins the round with the same sites, on the same samples.
    pub(crate) margin: f64,
}

/// How far a site is from its identity between two rounds, at most, and the rim of what a tile
/// knows in which a voxel may have lost a part of its points.
const STATE_MARGIN_IN_SPACINGS: f64 = 3.0;

impl Round {
    /// Width of the halo (CRS units) with which tiles agree on the sites that they share at the
    /// end of the round.
    pub(crate) fn halo(&self, options: &SolverOptions) -> f64 {
        let iterations = f64::from(self.iterations.end - self.iterations.start);
        // When all are done sites may be moved to facets, by where their neighbours are.
        let is_last = self.iterations.end == options.iterations;
        let settling = f64::from(u8::from(is_last && options.edge_capture.is_some()));
        let steps = iterations + settling;
        let of_sites = steps * options.reach_of_an_iteration() + self.margin;
        match self.iterations.start {
            // Isolated returns are counted, whatever becomes of them.
            0 => of_sites.max(options.isolation_margin()),
            _ => of_sites,
        }
    }
}

impl SolverOptions {
    /// All iterations as one round.
    pub(super) fn only_round(&self) -> Round {
        Round {
            iterations: 0..self.iterations,
            margin: self.seed_margin(),
        }
    }

    /// Width of the halo (CRS units) with which tiles agree on the sites that they share: the
    /// reach of all iterations, and that of election and fit.
    pub fn halo(&self) -> f64 {
        self.only_round().halo(self)
    }

    /// The election and the iterations as two rounds that need halos of nearly the same width.
    pub(crate) fn two_rounds(&self) -> [Round; 2] {
        let [first, last] = [self.seed_margin(), self.state_margin()];
        let reach = self.reach_of_an_iteration();
        let even = 0.5 * (f64::from(self.iterations) - (first - last) / reach);
        // A state is what an iteration leaves.
        let between = (even.round().max(1.0) as u32).min(self.iterations);
        [(0..between, first), (between..self.iterations, last)]
            .map(|(iterations, margin)| Round { iterations, margin })
    }

    /// Depth (CRS units) inside the rectangle of available points from which on every tile knows
    /// the same states and samples.
    fn state_margin(&self) -> f64 {
        let seen = self.wide_radius();
        let known = STATE_MARGIN_IN_SPACINGS * self.spacing + seen + 2.0 * self.smooth;
        known + self.reach_of_grading()
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::{
        geometry::{Local, Quantization, Rect, Stored, spread},
        lloyd::{
            Acceleration, Candidates, CountCorrection, ResumedSites, Scan, Site, SiteState,
            TileRegion, WantedCount, candidate_band, elect, solve_first_round, solve_last_round,
            solve_watched,
        },
    };

    #[test]
    fn two_rounds_do_all_iterations_with_halos_of_like_width() {
        for iterations in [0, 1, 5, 8, 20, 100] {
            let options = SolverOptions {
                iterations,
                ..SolverOptions::new(0.1)
            };
            let [first, last] = options.two_rounds();
            assert_eq!(first.iterations.start, 0);
            assert_eq!(first.iterations.end, last.iterations.start);
            assert_eq!(last.iterations.end, iterations);
            let halos = [&first, &last].map(|round| round.halo(&options));
            if iterations >= 20 {
                assert!((halos[0] - halos[1]).abs() <= options.reach_of_an_iteration());
                assert!(halos[0] < 0.6 * options.halo());
            }
        }
    }

    const QUANTIZATION: Quantization = Quantization {
        scale: 1e-4,
        offset: [0.0; 3],
    };

    /// Points of a wavy floor with a gap and a wall, of leaves over it, and of rain, on 6 × 2.
    fn points() -> Vec<Stored> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let point = |k: u64| {
            let [x, y, z] = [0, 1, 2].map(|axis| unit(3 * k + axis));
            let (x, y) = (6.0 * x, 2.0 * y);
            match k % 10 {
                0 if k.is_multiple_of(200) => Local::new(x, y, 1.0 + 3.0 * z),
                0..6 => Local::new(x, y, 0.1 * (2.0 * x).sin() + 0.002 * z),
                6..8 => Local::new(x, 1.0 + 0.002 * y, z),
                _ => Local::new(x, 0.5 * y, 0.5 + 0.5 * z),
            }
        };
        let is_scanned = |p: &Local| (p.x - 2.0).abs() > 0.1 || p.z > 0.3;
        let points = (0..60_000).map(point).filter(is_scanned);
        points.filter_map(|p| QUANTIZATION.stored(p)).collect()
    }

    fn region(from: i64, to: i64, halo: f64) -> TileRegion {
        let core = Rect {
            min: [from, -10_000],
            max: [to, 30_000],
        };
        TileRegion {
            core,
            available: core.grown(QUANTIZATION.units(halo)),
            band: QUANTIZATION.units(0.2),
        }
    }

    /// The scan of the `points` that are available.
    fn scan_of(points: &[Stored], available: &Rect, options: &SolverOptions) -> Scan {
        let points = points.iter().copied().filter(|&p| available.contains(p));
        Scan::new(points.collect(), QUANTIZATION, options)
    }

    fn go_on(_: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// The sites of three tiles that do the first round, and then each the last by what its neighbours have left; and
    /// the isolated seeds of all.
    fn sites_of_three_tiles(
        points: &[Stored],
        options: &SolverOptions,
        wanted: Option<WantedCount>,
    ) -> (Vec<Site>, Vec<Stored>) {
        let [first, last] = options.two_rounds();
        let halo = first.halo(options) + candidate_band(options);
        let halo = halo.max(last.halo(options));
        let cuts = [-10_000, 17_000, 41_000, 70_000];
        let regions: Vec<TileRegion> = cuts
            .windows(2)
            .map(|cut| region(cut[0], cut[1], halo))
            .collect();
        let (mut states, mut filling, mut isolated) = (Vec::new(), Vec::new(), Vec::new());
        let mut candidates: Vec<Candidates> = Vec::new();
        for region in &regions {
            let scan = scan_of(points, &region.available, options);
            let has_count = wanted.is_some();
            let started = solve_first_round(&scan, region, options, has_count, &go_on);
            let started = started.unwrap();
            states.extend(started.states);
            candidates.push(started.candidates);
            isolated.extend(started.isolated);
            let own = scan.filling().iter().filter(|&&p| region.core.contains(p));
            filling.extend(own);
        }
        let correction = wanted.map_or_else(CountCorrection::default, |wanted| {
            let sites = candidates.iter().map(|of_tile| of_tile.sites).sum();
            let parts = candidates.iter().cloned().map(Ok::<_, ()>);
            CountCorrection::choose(wanted, sites, parts, options).unwrap()
        });
        // What is not written is made again.
        let states = postcard::to_stdvec(&states).unwrap();
        let mut sites = Vec::new();
        for region in &regions {
            let mut known: Vec<SiteState> = postcard::from_bytes(&states).unwrap();
            known.retain(|state| region.available.contains(state.identity));
            let places = known.iter().map(|state| (state.identity, state.position));
            let coming = correction.coming().iter().copied();
            let coming = coming.filter(|(place, _)| region.available.contains(*place));
            let places = places.chain(coming).collect();
            let in_reach = |p: &Stored| region.available.contains(*p);
            let scan = Scan::filled_with(
                filling.iter().copied().filter(in_reach).collect(),
                points
                    .iter()
                    .copied()
                    .filter(in_reach)
                    .collect::<Vec<_>>()
                    .into(),
                QUANTIZATION,
                options,
            );
            let mut resumed = ResumedSites::new(places, scan.field(), &correction);
            resumed.add(known);
            let solution = solve_last_round(&scan, region, options, resumed, &go_on).unwrap();
            let own = solution.sites.into_iter();
            sites.extend(own.filter(|site| region.core.contains(site.identity)));
        }
        sites.sort_unstable_by_key(|site| site.identity);
        isolated.sort_unstable();
        (sites, isolated)
    }

    /// The first round on the whole cloud, and on three tiles, each of which then does the last
    /// round by what its neighbours have left.
    #[test]
    fn two_rounds_end_in_the_bits_of_one() {
        let points = points();
        let cases = [
            (Acceleration::Relaxation, 12, None, false),
            (Acceleration::Relaxation, 2, None, true),
            (Acceleration::None, 8, None, true),
            (Acceleration::None, 0, None, false),
            // More or fewer than there are seeds.
            (Acceleration::Relaxation, 12, Some(-300), false),
            (Acceleration::Relaxation, 12, Some(201), true),
            // As many: only the tiles look for candidates. In the last case no iteration is left for the last round.
            (Acceleration::Relaxation, 12, Some(0), false),
            (Acceleration::None, 20, Some(0), false),
            (Acceleration::Relaxation, 1, Some(0), false),
            (Acceleration::None, 8, Some(1), false),
            // More leave than stand apart, and more come than cells have corners for.
            (Acceleration::None, 6, Some(-1500), false),
            (Acceleration::None, 6, Some(1000), false),
        ];
        for (acceleration, iterations, more, drops_isolated) in cases {
            let options = SolverOptions {
                acceleration,
                iterations,
                drops_isolated,
                ..SolverOptions::new(0.06)
            };
            let whole = region(-10_000, 70_000, 0.0);
            let scan = scan_of(&points, &whole.available, &options);
            let wanted = more.map(|more: i64| WantedCount {
                sites: (elect(&scan, &options).identities.len() as i64 + more) as u64,
                is_exact: true,
            });
            let expected = solve_watched(&scan, &whole, &options, wanted, &go_on).unwrap();
            if let Some(wanted) = wanted {
                assert_eq!(expected.sites.len() as u64, wanted.sites);
            }
            assert!(expected.sites.iter().any(|site| site.is_fixed));
            assert!(!scan.filling().is_empty());

            let (sites, isolated) = sites_of_three_tiles(&points, &options, wanted);
            assert!(isolated.len() > 200);
            assert_eq!(isolated, expected.isolated);
            let is_there = |seed: &Stored| {
                let found = sites.binary_search_by_key(seed, |site| site.identity);
                found.is_ok()
            };
            assert!(drops_isolated != isolated.iter().any(is_there));
            assert_eq!(sites.len(), expected.sites.len());
            for (site, expected) in sites.iter().zip(&expected.sites) {
                assert_eq!(site.identity, expected.identity);
                assert_eq!(site.position, expected.position);
                assert_eq!(site.area.to_bits(), expected.area.to_bits());
                assert_eq!(site.nearest, expected.nearest);
            }
        }
    }
}
