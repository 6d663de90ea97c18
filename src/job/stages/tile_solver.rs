//! One tile, alone: from the spill to its sites, their records and figures.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    plan::JobPlan,
    transfer::{FARTHEST_MATCH_IN_SPACINGS, Transfer, TransferSites},
};
use crate::{
    config::Settings,
    geometry::{ITEMS_PER_TASK, Local, Quantization, Rect, Stored},
    job::{
        directory::{StartedTile, StartedTiles},
        error::JobError,
        resources::points_for,
        tile_figures::TileFigures,
    },
    las::RecordFormat,
    lloyd::{
        CountCorrection, FirstRound, Scan, Site, Solution, SolverOptions, ThinnedPoints,
        TileRegion, WantedCount, solve_first_round, solve_last_round, solve_watched,
        uniformity_by_surface,
    },
    quality::{DistanceTally, UniformityTally},
    tile::{SolvedCore, SolvedSite, SolvedTile, Spill, TileError},
    tiling::{CountedCloud, Tile},
};

/// Width of the band in which neighbouring tiles are compared and blended, in spacings.
pub(super) const BAND_IN_SPACINGS: f64 = 4.0;

/// Approximate share of the solver in the time of a tile.
const SOLVER_SHARE: f64 = 0.83;

/// Edge of the cells in which sites are sought from input points, in spacings: hardly any point is
/// farther from a site.
const SITE_SEARCH_IN_SPACINGS: f64 = 0.7;

/// Everything from which the tiles of a job are solved.
pub(crate) struct TileSolver {
    /// The points of all inputs.
    pub(crate) spill: Spill,
    /// The tiles, the halo, and the quantization.
    pub(crate) plan: JobPlan,
    /// The options of the solver.
    pub(crate) options: SolverOptions,
    /// The number of sites that all tiles together are to have, if one was asked for.
    pub(crate) wanted: Option<WantedCount>,
    /// The rules by which records are made.
    pub(crate) transfer: Transfer,
}

/// A tile whose points are in memory.
pub(crate) struct LoadedTile {
    /// The tile.
    pub(crate) tile: Tile,
    /// Its core and halo.
    known: Rect,
    /// The scan that is solved; smoothed if the options say so.
    scan: Scan,
    /// The scan as it was measured, if the other one is smoothed.
    unsmoothed: Option<Scan>,
}

impl TileSolver {
    /// The solver of the tiles of `plan`, whose points are records of the format `scanned`.
    pub(crate) fn new(
        spill: Spill,
        plan: JobPlan,
        scanned: &RecordFormat,
        settings: &Settings,
    ) -> Self {
        Self {
            options: plan.options(settings),
            wanted: settings.wanted_count(plan.points_out),
            transfer: Transfer::new(scanned, settings),
            spill,
            plan,
        }
    }

    /// Reads the points of the core and the halo of `tile`, for the first round.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read.
    pub(crate) fn load(&self, tile: Tile) -> Result<LoadedTile, JobError> {
        self.load_with(tile, Scan::prepared)
    }

    /// Reads the points of the core and the halo of `tile`, for the round after that of `started`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill or a started tile cannot be read.
    pub(crate) fn load_again(
        &self,
        tile: Tile,
        started: &StartedTiles,
    ) -> Result<LoadedTile, JobError> {
        let filling = started.filling_in(&self.known(&tile), &self.plan.plan.tiles)?;
        self.load_with(tile, |points, quantization, options| {
            Scan::filled_with(filling, points, quantization, options)
        })
    }

    /// Edge (stored units) of the pieces in which the sites of tiles are kept between rounds.
    pub(crate) fn edge_of_pieces(&self) -> i64 {
        (self.plan.plan.halo / 2).max(1)
    }

    /// What `tile` knows: its core and its halo.
    fn known(&self, tile: &Tile) -> Rect {
        tile.core.grown(self.plan.plan.halo)
    }

    /// Reads the points of `tile`, of which `prepare` makes the scan.
    fn load_with(
        &self,
        tile: Tile,
        prepare: impl FnOnce(ThinnedPoints, Quantization, &SolverOptions) -> Scan,
    ) -> Result<LoadedTile, JobError> {
        let (quantization, options) = (self.plan.quantization, &self.options);
        let known = self.known(&tile);
        let limit = points_for(tile.cost);
        let spill = &self.spill;
        let mut points = CountedCloud::gather(spill, &known, &quantization, options, limit)?;
        spill.complete(&mut points, &quantization, options);
        let unsmoothed =
            (options.smooth > 0.0).then(|| Scan::thinned(points.clone(), quantization, options));
        let scan = prepare(points, quantization, options);
        Ok(LoadedTile {
            tile,
            known,
            scan,
            unsmoothed,
        })
    }

    /// Does the first of two rounds for a tile. Returns what it leaves, with a time of zero. `watch` receives the share of the work that is done,
    /// and says whether it goes on.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if `watch` stops the work.
    pub(crate) fn start(
        &self,
        loaded: LoadedTile,
        watch: &dyn Fn(f64) -> ControlFlow<()>,
    ) -> Result<(StartedTile, FirstRound), JobError> {
        let (region, scan) = (self.region(&loaded), loaded.scan);
        let has_count = self.wanted.is_some();
        let round = solve_first_round(&scan, &region, &self.options, has_count, watch);
        let mut round = round.map_err(|_| TileError::Cancelled)?;
        let filling = scan.filling().iter().copied();
        let started = StartedTile::new(
            round.seeds.clone(),
            std::mem::take(&mut round.convergence),
            filling.filter(|&p| region.core.contains(p)).collect(),
            std::mem::take(&mut round.isolated),
        );
        Ok((started, round))
    }

    /// Solves a tile in one round. Returns its result, and its figures with a time of zero. `watch`
    /// receives the share of the work that is done, and says whether it goes on.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read, or if `watch` stops the work.
    pub(crate) fn solve(
        &self,
        loaded: LoadedTile,
        watch: &dyn Fn(f64) -> ControlFlow<()>,
    ) -> Result<(SolvedTile, TileFigures), JobError> {
        let region = self.region(&loaded);
        // Between rounds alone, several tiles can leave each other sites.
        let wanted = self.wanted.filter(|_| self.plan.plan.tiles.len() == 1);
        let solution = solve_watched(&loaded.scan, &region, &self.options, wanted, &|share| {
            watch(SOLVER_SHARE * share)
        });
        let solution = solution.map_err(|_| TileError::Cancelled)?;
        self.complete(loaded, solution)
    }

    /// Solves a tile that has done the first round, with its neighbours, in `started`, after `correction`. Returns its
    /// result and its figures. `watch` receives the share of the work that is done, and says
    /// whether it goes on.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill or a started tile cannot be read, or if `watch` stops the
    /// work.
    pub(crate) fn finish(
        &self,
        loaded: LoadedTile,
        started: &StartedTiles,
        correction: &CountCorrection,
        watch: &dyn Fn(f64) -> ControlFlow<()>,
    ) -> Result<(SolvedTile, TileFigures), JobError> {
        let region = self.region(&loaded);
        let (tiles, field) = (&self.plan.plan.tiles, loaded.scan.field());
        let resumed = started.sites_in(&region.available, tiles, field, correction)?;
        let solution = solve_last_round(&loaded.scan, &region, &self.options, resumed, &|share| {
            watch(SOLVER_SHARE * share)
        });
        let mut solution = solution.map_err(|_| TileError::Cancelled)?;
        let before = started.started(loaded.tile.id)?;
        solution.seeds = before.seeds;
        solution.convergence.splice(..0, before.convergence);
        solution.isolated = before.isolated;
        let (solved, mut figures) = self.complete(loaded, solution)?;
        figures.seconds = before.seconds;
        Ok((solved, figures))
    }

    /// The region of a tile whose points are in memory.
    fn region(&self, loaded: &LoadedTile) -> TileRegion {
        let band = BAND_IN_SPACINGS * self.options.spacing;
        TileRegion {
            available: loaded.known,
            core: loaded.tile.core,
            band: self.plan.quantization.units(band),
        }
    }

    /// The result of a tile by its `solution`, and its figures with a time of zero.
    fn complete(
        &self,
        loaded: LoadedTile,
        solution: Solution,
    ) -> Result<(SolvedTile, TileFigures), JobError> {
        let LoadedTile {
            tile,
            known,
            scan,
            unsmoothed,
        } = loaded;
        let options = &self.options;

        // Measure, by the scan as it was measured.
        let scan = unsmoothed.unwrap_or(scan);
        let (own, band): (Vec<Site>, Vec<Site>) = solution
            .sites
            .iter()
            .partition(|site| tile.core.contains(site.identity));
        let mut figures = figures(&tile, &scan, &solution, &own, options);

        // Transfer attributes from the scan to the sites of the core.
        let (records, distances) = self.transfer.records(
            &self.spill,
            &TransferSites {
                scan: &scan,
                sites: &solution.sites,
                own: &own,
                isolated: &solution.isolated,
                known: &known,
                spacing: options.spacing,
            },
        )?;
        distances.into_iter().for_each(|d| figures.accuracy.push(d));
        let solved = SolvedTile {
            core: SolvedCore {
                sites: solved_sites(&own),
                records,
                record_length: self.transfer.record().record_length(),
            },
            band: solved_sites(&band),
        };
        Ok((solved, figures))
    }
}

/// The figures of a tile with `own` sites, without its time and its accuracy.
fn figures(
    tile: &Tile,
    scan: &Scan,
    solution: &Solution,
    own: &[Site],
    options: &SolverOptions,
) -> TileFigures {
    let (core, spacing) = (&tile.core, options.spacing);
    let [on_surfaces, elsewhere] = uniformity_by_surface(own, spacing);
    TileFigures {
        tile: *tile,
        seconds: 0.0,
        sites: own.len() as u64,
        fixed: own.iter().filter(|s| s.is_fixed).count() as u64,
        exact: own.iter().filter(|s| s.is_exact).count() as u64,
        isolated: solution.isolated.clone(),
        input: input_distances(scan, core, options),
        seeds: solution.seeds.clone(),
        on_surfaces,
        elsewhere,
        accuracy: DistanceTally::new(spacing),
        coverage: coverage(scan, &solution.sites, core, spacing),
        convergence: solution.convergence.clone(),
    }
}

fn solved_sites(sites: &[Site]) -> Vec<SolvedSite> {
    sites
        .iter()
        .map(|site| SolvedSite {
            identity: site.identity,
            position: site.position,
            is_exact: site.is_exact,
        })
        .collect()
}

/// Nearest distances among input points in the core.
fn input_distances(scan: &Scan, core: &Rect, options: &SolverOptions) -> UniformityTally {
    let mut tally = UniformityTally::new(options.spacing);
    let farthest = BAND_IN_SPACINGS * options.spacing;
    let distances = scan.sampled_distances(options.seeds_per_point, farthest, |p| core.contains(p));
    for distance in distances {
        tally.push_distance(distance);
    }
    tally
}

/// Distances from representative input points in the core to their nearest sites.
fn coverage(scan: &Scan, sites: &[Site], core: &Rect, spacing: f64) -> DistanceTally {
    let positions: Vec<Local> = sites.iter().map(|site| site.position).collect();
    let grid = scan.field().grid(&positions, SITE_SEARCH_IN_SPACINGS);
    let farthest = FARTHEST_MATCH_IN_SPACINGS * spacing;
    let points = scan.representatives();
    let to_site = |&point: &Stored| {
        let position = scan.quantization().local(point);
        let nearest = grid.nearest(position, farthest, |_| false);
        let distance = nearest.map_or(farthest, |(_, squared)| squared.sqrt());
        (distance, scan.field().at(position))
    };
    let is_own = |point: &&Stored| core.contains(**point);
    let distances: Vec<(f64, f64)> = points
        .par_iter()
        .with_max_len(ITEMS_PER_TASK)
        .filter(is_own)
        .map(to_site)
        .collect();
    // One thread sums, since a sum must not depend on the number of threads.
    let mut tally = DistanceTally::new(spacing);
    let pairs = distances.into_iter();
    pairs.for_each(|(distance, spacing)| tally.push_at(distance, spacing));
    tally
}
