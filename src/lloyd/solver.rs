//! Algorithm 1 of the paper, over the sites that matter to one tile.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::{
    Acceleration, Restriction, Scan, SeedRule, TileRegion,
    acceleration::{Accelerator, Iterate},
    around::{Around, Scratch, clearance},
    domain::DependencyCone,
    elect,
    fit::is_allowed,
    neighborhoods::{BLOCK, BLOCKS_AT_ONCE, Neighborhoods},
    rings::{Edges, GAP, Rings},
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

impl Site {
    /// The area of the cell, if the input describes a surface there and neighbours bound the cell all around.
    pub(crate) fn bounded_area(&self) -> Option<f64> {
        let is_bounded = self.is_closed && !self.is_fixed && self.area > 0.0;
        is_bounded.then_some(self.area)
    }
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

/// Receives the share of the work that is done, between 0 and 1, from time to time, and says
/// whether the solver goes on.
pub(crate) type Monitor<'a> = &'a dyn Fn(f64) -> ControlFlow<()>;

/// The solver was stopped by its [`Monitor`] before it had a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cancelled;

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `domain`.
pub fn solve(scan: &Scan, domain: &TileRegion, options: &SolverOptions) -> Solution {
    solve_watched(scan, domain, options, &|_| ControlFlow::Continue(()))
        .expect("nothing stops the solver")
}

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `domain`, and gives the ring of
/// neighbours of every site beside it. `monitor` is consulted before and after the election
/// of the seeds and before every iteration.
///
/// # Errors
///
/// [`Cancelled`] if `monitor` stops the solver.
pub(crate) fn solve_with_rings(
    scan: &Scan,
    domain: &TileRegion,
    options: &SolverOptions,
    monitor: Monitor<'_>,
) -> Result<(Solution, Rings), Cancelled> {
    run(scan, domain, options, monitor, |sites| {
        sites.describe_with_rings()
    })
}

/// Of the time that [`solve`] takes, what passes until the seeds are elected and described,
/// about.
const ELECTION_SHARE: f64 = 0.48;

/// Of the time that [`solve`] takes, the share that has passed when the seeds are elected.
const SEEDS_SHARE: f64 = 0.36;

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `domain`. `monitor` is consulted
/// before and after the election of the seeds and before every iteration.
///
/// # Errors
///
/// [`Cancelled`] if `monitor` stops the solver.
pub(crate) fn solve_watched(
    scan: &Scan,
    domain: &TileRegion,
    options: &SolverOptions,
    monitor: Monitor<'_>,
) -> Result<Solution, Cancelled> {
    let describe = |sites: &mut Sites<'_>| (sites.describe(), ());
    run(scan, domain, options, monitor, describe).map(|(solution, ())| solution)
}

/// Runs Algorithm 1; `describe` gives the sites at the end, and what is wanted beside them.
fn run<T>(
    scan: &Scan,
    domain: &TileRegion,
    options: &SolverOptions,
    monitor: Monitor<'_>,
    describe: impl FnOnce(&mut Sites<'_>) -> (Vec<Site>, T),
) -> Result<(Solution, T), Cancelled> {
    let consult = |share: f64| match monitor(share) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    };
    consult(0.0)?;
    let all = elect(scan, options);
    consult(SEEDS_SHARE)?;
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
        consult(ELECTION_SHARE + (1.0 - ELECTION_SHARE) * share)?;
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
    let (ended, beside) = describe(&mut sites);
    convergence.push(sums(domain, &ended));
    let solution = Solution {
        sites: ended,
        seeds,
        convergence,
    };
    Ok((solution, beside))
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

    /// The sites of core and band as [`describe`](Self::describe) gives them, and the rings
    /// of their neighbours.
    fn describe_with_rings(&mut self) -> (Vec<Site>, Rings) {
        let (scan, options, domain) = (self.scan, self.options, self.domain);
        let count = self.steps.len();
        let mut found = self.of_all(|step, identity, mut around| {
            domain.wants(identity).then(|| {
                let moments = step.clip(scan, options, &mut around);
                let site = site(identity, step, moments, &mut around);
                (site, edges(step, moments, &around))
            })
        });
        found.par_sort_unstable_by_key(|(site, _)| site.identity);
        let (sites, edges): (Vec<Site>, Vec<Edges>) = found.into_iter().unzip();
        (sites, Rings::new(&edges, count))
    }

    /// The results of `figure` for the sites, in the order of their identities.
    fn figures(
        &mut self,
        figure: impl Fn(&mut Step, Stored, Around<'_>) -> Option<Site> + Sync,
    ) -> Vec<Site> {
        let mut sites = self.of_all(figure);
        sites.par_sort_unstable_by_key(|site| site.identity);
        sites
    }

    /// The results of `figure` for the sites, in the order of the sites; far neighbours may
    /// close their cells.
    fn of_all<T: Clone + Send>(
        &mut self,
        figure: impl Fn(&mut Step, Stored, Around<'_>) -> Option<T> + Sync,
    ) -> Vec<T> {
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
        found.into_par_iter().flatten().collect()
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

/// The edges of the cell that was clipped last for the site of `step`, if it has `moments`.
fn edges(step: &mut Step, moments: Option<Moments>, around: &Around<'_>) -> Edges {
    let patch = step.trusted().map(|fit| fit.patch);
    let known = patch.filter(|_| moments.is_some()).map(|patch| {
        let cell = &around.scratch.cell;
        let edges = cell.edge_neighbors().map(|edge| edge.unwrap_or(GAP));
        // The order of the cell is that of the patch's frame, whose axis may point downwards.
        let (normal, _) = patch.upwards();
        match normal.dot(&patch.axes[2]) < 0.0 {
            true => edges.rev().collect(),
            false => edges.collect(),
        }
    });
    Edges {
        site: around.site as u32,
        around: known.unwrap_or_default(),
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

#[cfg(test)]
mod tests {
    use std::cell::Cell as Counter;

    use super::*;
    use crate::geometry::{Quantization, spread};

    const QUANTIZATION: Quantization = Quantization {
        scale: 1e-5,
        offset: [0.0; 3],
    };

    fn go_on(_: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn with_rings(places: &[Local], options: &SolverOptions) -> (Solution, Rings) {
        let points = places.iter().filter_map(|&p| QUANTIZATION.stored(p));
        let scan = Scan::new(points.collect(), QUANTIZATION, options);
        solve_with_rings(&scan, &TileRegion::everything(), options, &go_on).unwrap()
    }

    /// The nodes of a hexagonal lattice of edge `edge` within 1 of the origin, in the plane
    /// spanned by `u` and `v`.
    fn lattice(edge: f64, u: Local, v: Local) -> Vec<Local> {
        let node = |i: i32, j: i32| {
            let [i, j] = [i, j].map(f64::from);
            (u * (i + 0.5 * j) + v * (j * 0.75_f64.sqrt())) * edge
        };
        (-60..=60)
            .flat_map(|i| (-60..=60).map(move |j| node(i, j)))
            .filter(|p| p.norm() < 1.0)
            .collect()
    }

    /// Even points of the unit sphere.
    fn sphere(count: u64) -> Vec<Local> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        (0..count)
            .map(|k| {
                let (z, turn) = (
                    2.0 * unit(2 * k) - 1.0,
                    std::f64::consts::TAU * unit(2 * k + 1),
                );
                let wide = (1.0 - z * z).sqrt();
                Local::new(wide * turn.cos(), wide * turn.sin(), z)
            })
            .collect()
    }

    /// Whether `ring` runs counter-clockwise around `site` as seen from the tip of its normal:
    /// every turn from one neighbour to the next is to the left, and all of them make one.
    fn is_counter_clockwise(site: &Site, sites: &[Site], ring: &[u32]) -> bool {
        let normal = site.normal.unwrap();
        let towards = |k: usize| sites[ring[k % ring.len()] as usize].position - site.position;
        let turn = |k: usize| {
            let (here, next) = (towards(k), towards(k + 1));
            normal.dot(&here.cross(&next)).atan2(here.dot(&next))
        };
        let turns: Vec<f64> = (0..ring.len()).map(turn).collect();
        let whole = turns.iter().sum::<f64>();
        turns.iter().all(|&turn| turn > 0.0) && (whole - std::f64::consts::TAU).abs() < 0.5
    }

    #[test]
    fn a_site_inside_a_hexagonal_lattice_has_a_ring_of_six() {
        let edge = 0.05;
        let options = SolverOptions {
            fit_radius: 2.2 * edge,
            iterations: 3,
            ..SolverOptions::new(edge)
        };
        for [u, v] in [[Local::x(), Local::y()], [Local::y(), Local::z()]] {
            let (solution, rings) = with_rings(&lattice(edge, u, v), &options);
            let (mut inner, mut open) = (0, 0);
            for (k, site) in solution.sites.iter().enumerate() {
                let ring = rings.of(k);
                assert_eq!(ring.neighbors.len(), usize::from(site.neighbors));
                assert_eq!(ring.is_closed, site.is_closed);
                open += usize::from(!ring.is_closed);
                if site.position.norm() < 0.6 {
                    inner += 1;
                    assert!(ring.is_closed && ring.neighbors.len() == 6, "{ring:?}");
                    assert!(is_counter_clockwise(site, &solution.sites, ring.neighbors));
                    let step = |&n: &u32| solution.sites[n as usize].position - site.position;
                    let is_near = |n| (step(n).norm() / edge - 1.0).abs() < 0.01;
                    assert!(ring.neighbors.iter().all(is_near));
                }
            }
            assert!(inner > 450 && open > 40, "{inner} {open}");
        }
    }

    #[test]
    fn on_a_sphere_all_rings_are_closed_and_neighbors_know_each_other() {
        let (solution, rings) = with_rings(&sphere(40_000), &SolverOptions::new(0.1));
        let (mut all, mut mutual) = (0, 0);
        for (k, site) in (0..).zip(&solution.sites) {
            let ring = rings.of(k as usize);
            assert!(ring.is_closed);
            assert_eq!(ring.neighbors.len(), usize::from(site.neighbors));
            assert!(is_counter_clockwise(site, &solution.sites, ring.neighbors));
            for &other in ring.neighbors {
                all += 1;
                mutual += usize::from(rings.of(other as usize).neighbors.contains(&k));
            }
        }
        let few = solution.sites.len();
        assert!(
            few > 1000 && all > 5 * few && all - mutual < all / 100,
            "{mutual} of {all}"
        );
    }

    #[test]
    fn rings_do_not_change_the_solution() {
        let options = SolverOptions::new(0.15);
        let points: Vec<Stored> = sphere(20_000)
            .iter()
            .filter_map(|&p| QUANTIZATION.stored(p))
            .collect();
        let scan = Scan::new(points, QUANTIZATION, &options);
        let region = TileRegion::everything();
        let (with, _) = solve_with_rings(&scan, &region, &options, &go_on).unwrap();
        assert_eq!(with.sites, solve(&scan, &region, &options).sites);
    }

    #[test]
    fn the_solver_stops_at_any_consultation() {
        let options = SolverOptions {
            iterations: 4,
            ..SolverOptions::new(0.2)
        };
        let points = sphere(5_000);
        let points = points.iter().filter_map(|&p| QUANTIZATION.stored(p));
        let scan = Scan::new(points.collect(), QUANTIZATION, &options);
        let solve_until = |last: usize| {
            let (calls, share) = (Counter::new(0), Counter::new(-1.0));
            let monitor = |now: f64| {
                assert!(now > share.replace(now) && now < 1.0);
                calls.set(calls.get() + 1);
                match calls.get() < last {
                    true => ControlFlow::Continue(()),
                    false => ControlFlow::Break(()),
                }
            };
            let result = solve_watched(&scan, &TileRegion::everything(), &options, &monitor);
            (result.is_ok(), calls.get())
        };
        // Before and after the election, and before each of four iterations.
        for last in 1..=6 {
            assert_eq!(solve_until(last), (false, last));
        }
        assert_eq!(solve_until(7), (true, 6));
    }
}
