//! One tile, alone: from the spill to a solved tile and its figures.

use std::ops::ControlFlow;

use rayon::prelude::*;

use crate::job::{
    JobError, TileFigures, gathering::gather_points, resources::points_for, transfer::Transfer,
};
use crate::{
    geometry::{AT_ONCE, Local, NeighborGrid, Quantization, Rect, Stored},
    lloyd::{Scan, Site, SolverOptions, TileRegion, solve_watched, uniformity},
    quality::{DistanceTally, UniformityTally},
    tile::{Plan, SolvedSite, SolvedTile, Spill, Tile},
};

/// Width of the band in which neighbouring tiles are compared and blended, in
/// spacings.
pub(crate) const BAND: f64 = 4.0;

/// How far an input point is looked for around an output point, and the other
/// way round, in spacings.
pub(crate) const FARTHEST: f64 = 8.0;

/// A tile that has been read.
pub(crate) struct Loaded {
    pub(crate) tile: Tile,
    known: Rect,
    /// What is solved …
    scan: Scan,
    /// … and what was scanned, where that is not the same.
    scanned: Option<Scan>,
}

/// Reads the points that `tile` sees.
pub(crate) fn load(
    spill: &Spill,
    plan: &Plan,
    tile: Tile,
    quantization: Quantization,
    options: &SolverOptions,
) -> Result<Loaded, JobError> {
    let known = tile.core.grown(plan.halo);
    let crowd = points_for(tile.cost);
    let points = gather_points(spill, &known, &quantization, options, crowd)?;
    let scanned = (options.smooth > 0.0).then(|| {
        let kept = Scan::thinned(points.clone(), &quantization, options);
        Scan::as_scanned(kept, quantization, options)
    });
    let scan = Scan::new(points, quantization, options);
    Ok(Loaded {
        tile,
        known,
        scan,
        scanned,
    })
}

/// Of the time that a tile takes, what the solver takes, about.
const SOLVER_SHARE: f64 = 0.83;

/// Solves a tile: its result, and its figures but for the time. `watch` is told what share
/// of the work is done.
pub(crate) fn solve_tile(
    spill: &Spill,
    loaded: Loaded,
    options: &SolverOptions,
    transfer: &Transfer,
    watch: &dyn Fn(f64),
) -> Result<(SolvedTile, TileFigures), JobError> {
    let Loaded {
        tile,
        known,
        scan,
        scanned,
    } = loaded;
    watch(0.0);
    let quantization = *scan.quantization();
    let core = tile.core;
    let domain = TileRegion {
        known,
        core,
        band: quantization.units(BAND * options.spacing),
    };
    let solution = solve_watched(&scan, &domain, options, &|share| {
        watch(SOLVER_SHARE * share);
        ControlFlow::Continue(())
    })
    .expect("nothing stops the solver");
    // What follows is said of what was scanned.
    let scan = scanned.unwrap_or(scan);
    let (own, band): (Vec<Site>, Vec<Site>) = solution
        .sites
        .iter()
        .partition(|site| core.contains(site.identity));

    let in_core = |site: &&Site| core.contains(site.identity);
    let mut figures = TileFigures {
        tile,
        seconds: 0.0,
        sites: own.len() as u64,
        fixed: own.iter().filter(|s| s.is_fixed).count() as u64,
        exact: own.iter().filter(|s| s.is_exact).count() as u64,
        input: input_distances(&scan, &core, options),
        seeds: uniformity(solution.seeds.iter().filter(in_core), options.spacing),
        uniformity: uniformity(solution.sites.iter().filter(in_core), options.spacing),
        accuracy: DistanceTally::new(options.spacing),
        coverage: coverage(&scan, &solution.sites, &core, options.spacing),
        convergence: solution.convergence,
    };
    let (records, distances) =
        transfer.records(spill, &scan, &solution.sites, &own, &known, options.spacing)?;
    distances.into_iter().for_each(|d| figures.accuracy.push(d));
    let brief = |sites: Vec<Site>| -> Vec<SolvedSite> {
        sites
            .into_iter()
            .map(|site| SolvedSite {
                identity: site.identity,
                position: site.position,
                is_exact: site.is_exact,
            })
            .collect()
    };
    let solved = SolvedTile {
        core: brief(own),
        band: brief(band),
        records,
        record_length: transfer.record().record_length(),
    };
    Ok((solved, figures))
}

fn input_distances(scan: &Scan, core: &Rect, options: &SolverOptions) -> UniformityTally {
    let mut tally = UniformityTally::new(options.spacing);
    let farthest = BAND * options.spacing;
    let distances = scan.sampled_distances(options.seeds_per_point, farthest, |p| core.contains(p));
    for distance in distances {
        tally.push_distance(distance);
    }
    tally
}

/// From an even choice of the input's points in the core to the nearest site.
fn coverage(scan: &Scan, sites: &[Site], core: &Rect, spacing: f64) -> DistanceTally {
    let positions: Vec<Local> = sites.iter().map(|site| site.position).collect();
    // Hardly any point is farther from a site.
    let grid = NeighborGrid::new(&positions, 0.7 * spacing);
    let mut tally = DistanceTally::new(spacing);
    let points = scan.representatives();
    let to_site = |&point: &Stored| {
        let place = scan.quantization().local(point);
        let nearest = grid.nearest(place, FARTHEST * spacing, |_| false);
        nearest.map_or(FARTHEST * spacing, |(_, squared)| squared.sqrt())
    };
    let is_own = |point: &&Stored| core.contains(**point);
    let distances: Vec<f64> = points
        .par_iter()
        .with_max_len(AT_ONCE)
        .filter(is_own)
        .map(to_site)
        .collect();
    // One after the other: a sum must not depend on the threads.
    distances.into_iter().for_each(|d| tally.push(d));
    tally
}
