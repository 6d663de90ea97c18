//! One tile, alone: from the spill to its sites, their records and figures.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    plan::JobPlan,
    transfer::{FARTHEST_MATCH_IN_SPACINGS, Transfer, TransferSites},
};
use crate::{
    config::Settings,
    geometry::{ITEMS_PER_TASK, Local, NeighborGrid, Rect, Stored},
    job::{error::JobError, resources::points_for, tile_figures::TileFigures},
    las::RecordFormat,
    lloyd::{Scan, Site, Solution, SolverOptions, TileRegion, solve_watched, uniformity},
    quality::{DistanceTally, UniformityTally},
    tile::{SolvedSite, SolvedTile, Spill, TileError},
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
            transfer: Transfer::new(scanned, settings),
            spill,
            plan,
        }
    }

    /// Reads the points of the core and the halo of `tile`.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read.
    pub(crate) fn load(&self, tile: Tile) -> Result<LoadedTile, JobError> {
        let (quantization, options) = (self.plan.quantization, &self.options);
        let known = tile.core.grown(self.plan.plan.halo);
        let limit = points_for(tile.cost);
        let points = CountedCloud::gather(&self.spill, &known, &quantization, options, limit)?;
        let unsmoothed =
            (options.smooth > 0.0).then(|| Scan::thinned(points.clone(), quantization, options));
        let scan = Scan::prepared(points, quantization, options);
        Ok(LoadedTile {
            tile,
            known,
            scan,
            unsmoothed,
        })
    }

    /// Solves a tile. Returns its result, and its figures with a time of zero. `watch` receives the
    /// share of the work that is done, and says whether it goes on.
    ///
    /// # Errors
    ///
    /// [`JobError::Tile`] if the spill cannot be read, or if `watch` stops the work.
    pub(crate) fn solve(
        &self,
        loaded: LoadedTile,
        watch: &dyn Fn(f64) -> ControlFlow<()>,
    ) -> Result<(SolvedTile, TileFigures), JobError> {
        let LoadedTile {
            tile,
            known,
            scan,
            unsmoothed,
        } = loaded;
        let options = &self.options;

        // Solve.
        let region = TileRegion {
            available: known,
            core: tile.core,
            band: scan
                .quantization()
                .units(BAND_IN_SPACINGS * options.spacing),
        };
        let solution = solve_watched(&scan, &region, options, &|share| {
            watch(SOLVER_SHARE * share)
        })
        .map_err(|_| TileError::Cancelled)?;

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
                known: &known,
                spacing: options.spacing,
            },
        )?;
        distances.into_iter().for_each(|d| figures.accuracy.push(d));
        let solved = SolvedTile {
            core: solved_sites(&own),
            band: solved_sites(&band),
            records,
            record_length: self.transfer.record().record_length(),
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
    let in_core = |site: &&Site| core.contains(site.identity);
    TileFigures {
        tile: *tile,
        seconds: 0.0,
        sites: own.len() as u64,
        fixed: own.iter().filter(|s| s.is_fixed).count() as u64,
        exact: own.iter().filter(|s| s.is_exact).count() as u64,
        input: input_distances(scan, core, options),
        seeds: uniformity(solution.seeds.iter().filter(in_core), spacing),
        uniformity: uniformity(solution.sites.iter().filter(in_core), spacing),
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
    let grid = NeighborGrid::new(&positions, SITE_SEARCH_IN_SPACINGS * spacing);
    let farthest = FARTHEST_MATCH_IN_SPACINGS * spacing;
    let points = scan.representatives();
    let to_site = |&point: &Stored| {
        let position = scan.quantization().local(point);
        let nearest = grid.nearest(position, farthest, |_| false);
        nearest.map_or(farthest, |(_, squared)| squared.sqrt())
    };
    let is_own = |point: &&Stored| core.contains(**point);
    let distances: Vec<f64> = points
        .par_iter()
        .with_max_len(ITEMS_PER_TASK)
        .filter(is_own)
        .map(to_site)
        .collect();
    // One thread sums, since a sum must not depend on the number of threads.
    let mut tally = DistanceTally::new(spacing);
    distances.into_iter().for_each(|d| tally.push(d));
    tally
}
