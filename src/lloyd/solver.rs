//! Algorithm 1 of the paper, over the sites that matter to one tile.

use rayon::prelude::*;

use super::{
    Acceleration, Restriction, Scan, SeedRule, TileRegion,
    acceleration::{Accelerator, Iterate},
    around::{Around, Scratch, clearance},
    domain::DependencyCone,
    elect,
    fit::is_allowed,
    neighborhoods::{BLOCK, BLOCKS_AT_ONCE, Neighborhoods},
    step::Step,
};
use crate::geometry::{AT_ONCE, Cell, Local, Moments, OccupiedCells, PatchKind, Stored, cell_of};

/// What is asked of the solver. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SolverOptions {
    /// The edge of the hexagonal lattice with as many sites to the area.
    pub spacing: f64,
    /// Reach of a patch: the scale of the details kept.
    pub fit_radius: f64,
    /// Reach of the noise to smooth away before anything else; 0 for none.
    pub smooth: f64,
    /// The widest hole to close; 0 for none.
    pub fill: f64,
    /// The paper's K: 20.
    pub iterations: u32,
    /// Where sites start.
    pub seeds: SeedRule,
    /// Share of the scan's points that random seeds are.
    pub seeds_per_point: f64,
    /// What is done with the centroids.
    pub acceleration: Acceleration,
    /// What is fitted.
    pub patch: PatchKind,
    /// How far from the scan a site may go.
    pub restriction: Restriction,
    /// Seed of every hash.
    pub seed: u64,
}

/// Reach of a patch, in spacings, unless told otherwise.
pub(crate) const FIT_RADIUS: f64 = 1.2;

/// The widest hole that is closed, in spacings, unless told otherwise.
pub(crate) const FILL: f64 = 4.0;

impl SolverOptions {
    /// The defaults, at `spacing` (CRS units).
    pub fn new(spacing: f64) -> Self {
        Self {
            spacing,
            fit_radius: FIT_RADIUS * spacing,
            smooth: 0.0,
            fill: FILL * spacing,
            iterations: 20,
            seeds: SeedRule::default(),
            seeds_per_point: 0.0,
            acceleration: Acceleration::default(),
            patch: PatchKind::default(),
            restriction: Restriction::Local,
            seed: 0,
        }
    }

    /// How far influence is taken to travel in one iteration (CRS units): the
    /// diameter of a large cell. Measured on a simulated street, 97 tiles: with
    /// 1.4 spacings all tiles agreed to the bit, with 0.9 to 10⁻⁹ spacings.
    pub(super) fn reach_of_an_iteration(&self) -> f64 {
        1.25 * self.spacing
    }

    /// Seeds this deep inside what is known (CRS units) are taken to be elected
    /// everywhere alike.
    pub(super) fn seed_margin(&self) -> f64 {
        SEED_MARGIN * self.spacing + self.fit_radius + 2.0 * (self.fill + self.smooth)
    }

    /// Farthest from a point of the scan that a seed may stand (CRS units): in
    /// the middle of what is filled, and a little beyond.
    pub(crate) fn farthest_seed(&self) -> f64 {
        2.5 * self.spacing + 0.5 * self.fill + self.smooth
    }

    /// The halo (CRS units) with which tiles agree on what they share: so many
    /// iterations' reach, and what the election and the fit see.
    pub fn halo(&self) -> f64 {
        f64::from(self.iterations) * self.reach_of_an_iteration() + self.seed_margin()
    }
}

/// The election's chains, and what the normals of its lattices look at, are
/// shorter than this, in spacings.
const SEED_MARGIN: f64 = 8.0;

/// A site at the end. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// The seed it grew from; decides which tile it is at home in.
    pub identity: Stored,
    /// Where it ended.
    pub position: Local,
    /// Whether everything that it depends on was known here: every tile for
    /// which this holds has the same bits.
    pub is_exact: bool,
    /// Whether it was left where it was elected, for want of a patch to trust: it has no cell.
    pub is_fixed: bool,
    /// Whether neighbours bound its cell all around.
    pub is_closed: bool,
    /// Number of neighbours whose cells touch its own.
    pub neighbors: u8,
    /// Normal of its patch, upwards; `None` without a patch to trust.
    pub normal: Option<Local>,
    /// Mean curvature of its patch (1 / CRS unit), positive where the surface bends
    /// towards the normal; NaN without a patch to trust.
    pub curvature: f64,
    /// Area of its cell; 0 where there is none.
    pub area: f64,
    /// Energy of its cell (paper, equation 2).
    pub energy: f64,
    /// Distance to the nearest other site, infinite beyond [`FARTHEST_NEIGHBOR`]
    /// spacings.
    pub nearest: f64,
}

/// How far the nearest other site is looked for, in spacings.
pub(crate) const FARTHEST_NEIGHBOR: f64 = 4.0;

/// Sums of the distances to the nearest neighbours, for δ (paper, equation 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct DistanceSums {
    /// Number of sites.
    pub count: u64,
    /// Sum of the distances.
    pub sum: f64,
    /// Sum of their squares.
    pub squares: f64,
}

impl DistanceSums {
    /// Those of `distances`.
    fn of(distances: impl Iterator<Item = f64>) -> Self {
        let mut sums = Self::default();
        distances.for_each(|distance| sums.push(distance));
        sums
    }

    /// Adds one distance.
    pub(crate) fn push(&mut self, distance: f64) {
        self.count += 1;
        self.sum += distance;
        self.squares += distance * distance;
    }

    /// Adds those of another part.
    pub(crate) fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// δ, or NaN of nothing.
    pub fn delta(&self) -> f64 {
        let ratio = self.count as f64 * self.squares / (self.sum * self.sum);
        (ratio - 1.0).clamp(0.0, f64::INFINITY).sqrt()
    }
}

/// What [`solve`] returns.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The sites of core and band, in the order of their identities.
    pub sites: Vec<Site>,
    /// The same before the first iteration, for comparison.
    pub seeds: Vec<Site>,
    /// Distances of the core's sites at the start of every iteration and at
    /// the end.
    pub convergence: Vec<DistanceSums>,
}

/// The sites of a cloud on their way, in the order of their blocks, and of
/// their identities within a block.
struct Sites<'a> {
    scan: &'a Scan,
    domain: &'a TileRegion,
    options: &'a SolverOptions,
    identities: Vec<Stored>,
    neighborhoods: Neighborhoods,
    steps: Vec<Step>,
}

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `domain`.
pub fn solve(scan: &Scan, domain: &TileRegion, options: &SolverOptions) -> Solution {
    solve_watched(scan, domain, options, &|_| {})
}

/// Of the time that [`solve`] takes, what passes until the seeds are elected and described,
/// about.
const ELECTION_SHARE: f64 = 0.48;

/// As [`solve`]; `watch` is told now and then what share of the work is done, about.
pub(crate) fn solve_watched(
    scan: &Scan,
    domain: &TileRegion,
    options: &SolverOptions,
    watch: &dyn Fn(f64),
) -> Solution {
    let all = elect(scan, options);
    let cone = DependencyCone::new(domain, options, scan.quantization());
    // Sites beyond the widest ring can matter to nobody here.
    let (identities, positions): (Vec<Stored>, Vec<Local>) = all
        .identities
        .into_iter()
        .zip(all.positions)
        .filter(|&(identity, _)| cone.matters(identity, 0))
        .unzip();
    let mut sites = Sites::new(scan, domain, options, &identities, &positions);
    for (step, &identity) in sites.steps.iter_mut().zip(&sites.identities) {
        step.is_exact = cone.knows_seed(identity);
    }
    let seeds = sites.first_step(&cone);
    let mut accelerator = Accelerator::new(
        options.acceleration,
        &sites.identities,
        scan.quantization().scale,
        options.spacing,
    );
    let mut convergence = Vec::new();
    for iteration in 0..options.iterations {
        // The first ones take longer: more sites move, and more patches are fitted.
        let share = (f64::from(iteration) / f64::from(options.iterations)).powf(0.85);
        watch(ELECTION_SHARE + (1.0 - ELECTION_SHARE) * share);
        convergence.push(match iteration {
            0 => sums(domain, &seeds),
            _ => sites.lloyd_step(&cone, iteration),
        });
        let next = accelerator.next(&Iterate {
            sites: sites.neighborhoods.places(),
            steps: &sites.steps,
            spacing: options.spacing,
        });
        sites.go(next);
    }
    let ended = sites.describe();
    convergence.push(sums(domain, &ended));
    Solution {
        sites: ended,
        seeds,
        convergence,
    }
}

/// The points of `scan` themselves as sites, with the cells they have on
/// patches through their neighbours: for the figures of a finished cloud.
pub(crate) fn describe_points(
    scan: &Scan,
    domain: &TileRegion,
    options: &SolverOptions,
) -> Vec<Site> {
    let quantization = scan.quantization();
    let places: Vec<Local> = scan
        .points()
        .iter()
        .map(|&p| quantization.local(p))
        .collect();
    describe_places(scan, domain, options, &places)
}

/// `places` as sites, with the cells they have on the patches of `scan`: for
/// the figures of what somebody else made of the scan. Their identities are the
/// places as stored; of places stored alike one is described, and none that
/// cannot be stored.
pub fn describe_places(
    scan: &Scan,
    domain: &TileRegion,
    options: &SolverOptions,
    places: &[Local],
) -> Vec<Site> {
    let stored = |&place: &Local| Some((scan.quantization().stored(place)?, place));
    let mut known: Vec<(Stored, Local)> = places.iter().filter_map(stored).collect();
    known.sort_unstable_by_key(|&(identity, _)| identity);
    known.dedup_by_key(|&mut (identity, _)| identity);
    let (identities, positions): (Vec<_>, Vec<_>) = known.into_iter().unzip();
    Sites::new(scan, domain, options, &identities, &positions).describe()
}

impl<'a> Sites<'a> {
    /// Sites that start at `positions`; `identities` must be sorted.
    fn new(
        scan: &'a Scan,
        domain: &'a TileRegion,
        options: &'a SolverOptions,
        identities: &[Stored],
        positions: &[Local],
    ) -> Self {
        let edge = BLOCK * options.spacing;
        let (blocks, order) = OccupiedCells::sort(positions, |&p| cell_of(p, edge));
        let places: Vec<Local> = order.iter().map(|&i| positions[i as usize]).collect();
        Self {
            scan,
            domain,
            options,
            identities: order.iter().map(|&i| identities[i as usize]).collect(),
            steps: places.par_iter().map(|&place| Step::new(place)).collect(),
            neighborhoods: Neighborhoods::new(places, blocks.ranges().collect(), options.spacing),
        }
    }

    /// One Lloyd step of every site that still matters. Distances from the core's sites
    /// to the nearest others, as it met them.
    fn lloyd_step(&mut self, cone: &DependencyCone<'_>, iteration: u32) -> DistanceSums {
        let matters = |site: usize| cone.matters(self.identities[site], iteration);
        let was_exact = self.are_exact();
        self.steps
            .par_iter_mut()
            .zip(self.neighborhoods.places())
            .enumerate()
            .filter(|&(site, _)| !matters(site))
            .for_each(|(_, (step, &place))| step.leave(place));
        let (scan, options) = (self.scan, self.options);
        let mut nearest = vec![None; self.steps.len()];
        by_block(
            &mut self.steps,
            &mut nearest,
            &self.neighborhoods,
            options,
            |step, nearest, around| {
                let site = around.site;
                if matters(site) {
                    step.advance(scan, options, cone, &was_exact, around);
                    *nearest = step
                        .nearest
                        .filter(|_| self.domain.core.contains(self.identities[site]));
                }
            },
        );
        DistanceSums::of(nearest.into_iter().flatten())
    }

    /// Moves the sites to `next`, projected and restricted; where that is not
    /// allowed, to the target of their Lloyd step.
    fn go(&mut self, mut next: Vec<Local>) {
        next.par_iter_mut()
            .zip(&mut self.steps)
            .zip(self.neighborhoods.places())
            .with_max_len(AT_ONCE)
            .for_each(|((place, step), before)| {
                let target = step.target;
                if *place == target {
                    return;
                }
                *place = match &mut step.fit {
                    Some(fit) => {
                        let place = fit.patch.foot_point(*place);
                        let is_clear = (place - before).norm() <= step.free;
                        let goes = is_clear && is_allowed(self.scan, fit, place, self.options);
                        if goes { place } else { target }
                    }
                    None => target,
                };
            });
        self.neighborhoods.go(next);
    }

    /// The first Lloyd step of all sites, and the figures of their cells before it, as
    /// [`describe`](Self::describe) gives them.
    fn first_step(&mut self, cone: &DependencyCone<'_>) -> Vec<Site> {
        let (scan, options, domain) = (self.scan, self.options, self.domain);
        let was_exact = self.are_exact();
        self.figures(|step, identity, mut around| {
            let moments = step.clip(scan, options, &mut around);
            let wanted = domain.wants(identity);
            let site = wanted.then(|| site(identity, step, moments, &mut around));
            step.go(moments, scan, options, cone, &was_exact, around);
            site
        })
    }

    /// The sites of core and band as they are, with the figures of their
    /// cells, in the order of their identities.
    fn describe(&mut self) -> Vec<Site> {
        let (scan, options, domain) = (self.scan, self.options, self.domain);
        self.figures(|step, identity, mut around| {
            domain.wants(identity).then(|| {
                let moments = step.clip(scan, options, &mut around);
                site(identity, step, moments, &mut around)
            })
        })
    }

    /// What `figure` tells of the sites, in the order of their identities.
    fn figures(
        &mut self,
        figure: impl Fn(&mut Step, Stored, Around<'_>) -> Option<Site> + Sync,
    ) -> Vec<Site> {
        let mut found = vec![None; self.steps.len()];
        by_block(
            &mut self.steps,
            &mut found,
            &self.neighborhoods,
            self.options,
            |step, found, mut around| {
                around.asks_far = true;
                *found = figure(step, self.identities[around.site], around);
            },
        );
        let mut sites: Vec<Site> = found.into_par_iter().flatten().collect();
        sites.par_sort_unstable_by_key(|site| site.identity);
        sites
    }

    /// Which sites are exact.
    fn are_exact(&self) -> Vec<bool> {
        self.steps.par_iter().map(|step| step.is_exact).collect()
    }
}

/// The site of `step`, by the `moments` of the cell that was clipped last.
fn site(
    identity: Stored,
    step: &mut Step,
    moments: Option<Moments>,
    around: &mut Around<'_>,
) -> Site {
    let nearest = around.nearest_within(FARTHEST_NEIGHBOR * around.spacing);
    let surface = step.trusted().map(|fit| fit.patch.upwards());
    let cell = moments.map(|_| &around.scratch.cell);
    let neighbors = cell.map_or(0, Cell::neighbor_count);
    Site {
        identity,
        position: around.place,
        is_exact: step.is_exact,
        is_fixed: surface.is_none(),
        normal: surface.map(|(normal, _)| normal),
        curvature: surface.map_or(f64::NAN, |(_, curvature)| curvature),
        is_closed: cell.is_some_and(Cell::is_closed),
        neighbors: u8::try_from(neighbors).unwrap_or(u8::MAX),
        area: moments.map_or(0.0, |m| m.area),
        energy: moments.map_or(0.0, |m| m.energy),
        nearest: nearest.unwrap_or(f64::INFINITY),
    }
}

/// Calls `work` for every site, with its place in `results`, in parallel by blocks.
fn by_block<T: Send>(
    steps: &mut [Step],
    results: &mut [T],
    neighborhoods: &Neighborhoods,
    options: &SolverOptions,
    work: impl Fn(&mut Step, &mut T, Around<'_>) + Sync,
) {
    let clearance = clearance(options);
    let mut rest = (steps, results);
    let mut blocks = Vec::with_capacity(neighborhoods.blocks().len());
    for block in neighborhoods.blocks() {
        let (steps, other_steps) = rest.0.split_at_mut(block.len());
        let (results, other_results) = rest.1.split_at_mut(block.len());
        blocks.push((block, steps, results));
        rest = (other_steps, other_results);
    }
    blocks
        .into_par_iter()
        .with_max_len(BLOCKS_AT_ONCE)
        .for_each_init(Scratch::new, |scratch, (block, steps, results)| {
            scratch.begin(neighborhoods, block);
            for (site, (step, result)) in block.clone().zip(steps.iter_mut().zip(results)) {
                // Nobody has looked around this site yet.
                scratch.neighbors.clear();
                let around = Around {
                    site,
                    place: neighborhoods.places()[site],
                    spacing: options.spacing,
                    clearance,
                    neighborhoods,
                    block: block.clone(),
                    links: step.links,
                    was_open: step.is_open,
                    asks_far: false,
                    scratch,
                };
                work(step, result, around);
            }
        });
}

/// Distances from the core's `sites` to the nearest others.
fn sums(domain: &TileRegion, sites: &[Site]) -> DistanceSums {
    let counts = |site: &&Site| site.nearest.is_finite() && domain.core.contains(site.identity);
    DistanceSums::of(sites.iter().filter(counts).map(|site| site.nearest))
}
