//! Algorithm 1 of the paper, over the sites that matter to one tile.

use rayon::prelude::*;

use super::{
    Acceleration, Restriction, Scan, SeedRule,
    acceleration::{Accelerator, Iterate, LINKS, NO_LINK},
    elect,
    step::{DOMAIN_RADIUS, Fit, Neighborhoods, local_patch, restricted_cell},
};
use crate::geometry::{Cell, Lattice, Local, PatchKind, Rect, Stored};

/// What is asked of the solver. Lengths are CRS units.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Options {
    /// The edge of the hexagonal lattice with as many sites to the area.
    pub spacing: f64,
    /// Reach of a patch: the scale of the details kept, and of the noise
    /// smoothed away.
    pub fit_radius: f64,
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
pub const FIT_RADIUS: f64 = 1.2;

impl Options {
    /// The defaults, at `spacing` (CRS units).
    pub fn new(spacing: f64) -> Self {
        Self {
            spacing,
            fit_radius: FIT_RADIUS * spacing,
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
    fn reach_of_an_iteration(&self) -> f64 {
        1.25 * self.spacing
    }

    /// The halo (CRS units) with which tiles agree on what they share: so many
    /// iterations' reach, and what the election and the fit see.
    pub fn halo(&self) -> f64 {
        f64::from(self.iterations) * self.reach_of_an_iteration()
            + self.fit_radius
            + SEED_MARGIN * self.spacing
    }
}

/// The election's chains are shorter than this, in spacings: seeds this deep
/// inside what is known are taken to be elected everywhere alike.
const SEED_MARGIN: f64 = 6.0;

/// What part of the plane is known, and what part is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Domain {
    /// Every point of the input in here is in the scan.
    pub known: Rect,
    /// Sites elected in here are wanted …
    pub core: Rect,
    /// … and those this far around it (stored units), to compare with
    /// neighbours.
    pub band: i64,
}

impl Domain {
    /// The whole of a cloud, without tiles.
    pub fn everything() -> Self {
        const FAR: i64 = 1 << 40;
        let all = Rect {
            min: [-FAR; 2],
            max: [FAR; 2],
        };
        Self {
            known: all,
            core: all,
            band: 0,
        }
    }
}

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
    /// Whether it was left where it was elected, for want of a patch to trust.
    pub is_held: bool,
    /// Whether neighbours bound its cell all around.
    pub is_closed: bool,
    /// Number of neighbours whose cells touch its own.
    pub neighbors: u8,
    /// Area of its cell; 0 where there is none.
    pub area: f64,
    /// Energy of its cell (paper, equation 2).
    pub energy: f64,
}

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
    /// Adds one distance.
    pub fn push(&mut self, distance: f64) {
        self.count += 1;
        self.sum += distance;
        self.squares += distance * distance;
    }

    /// Adds those of another part.
    pub fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// δ, or NaN of nothing.
    pub fn delta(&self) -> f64 {
        let ratio = self.count as f64 * self.squares / (self.sum * self.sum);
        (ratio - 1.0).max(0.0).sqrt()
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

/// State of one site.
#[derive(Clone, Copy)]
struct State {
    fit: Option<Fit>,
    is_exact: bool,
}

/// What one Lloyd step finds for one site.
struct Step {
    state: State,
    target: Local,
    links: [u32; LINKS],
    nearest: Option<f64>,
}

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `domain`.
pub fn solve(scan: &Scan, domain: &Domain, options: &Options) -> Solution {
    let lattice = *scan.lattice();
    let all = elect(scan, options);
    let cone = Cone::new(domain, options, &lattice);
    // Sites beyond the widest ring can matter to nobody here.
    let (identities, mut positions): (Vec<Stored>, Vec<Local>) = all
        .identities
        .into_iter()
        .zip(all.positions)
        .filter(|&(identity, _)| cone.matters(identity, 0))
        .unzip();
    let mut states: Vec<State> = identities
        .iter()
        .map(|&identity| State {
            fit: None,
            is_exact: domain.known.depth(identity) >= cone.seed_margin,
        })
        .collect();
    let is_core: Vec<bool> = identities
        .iter()
        .map(|&identity| domain.core.contains(identity))
        .collect();
    let mut convergence = Vec::new();

    let seeds = describe(scan, domain, options, &identities, &positions, &mut states);
    let mut accelerator = Accelerator::new(
        options.acceleration,
        &identities,
        lattice.scale,
        options.spacing,
    );
    for iteration in 0..options.iterations {
        let neighborhoods = Neighborhoods::new(&positions, options.spacing);
        let steps: Vec<Step> = (0..identities.len())
            .into_par_iter()
            .map_init(Scratch::new, |scratch, site| {
                if cone.matters(identities[site], iteration) {
                    lloyd_step(
                        scan,
                        options,
                        &neighborhoods,
                        &positions,
                        &states,
                        site,
                        &cone,
                        scratch,
                    )
                } else {
                    frozen(states[site], positions[site])
                }
            })
            .collect();
        convergence.push(sums(&is_core, &steps));

        let targets: Vec<Local> = steps.iter().map(|step| step.target).collect();
        let links: Vec<[u32; LINKS]> = steps.iter().map(|step| step.links).collect();
        let iterate = Iterate {
            sites: &positions,
            targets: &targets,
            links: &links,
            spacing: options.spacing,
        };
        let project = |site: usize, place: Local| {
            steps[site]
                .state
                .fit
                .map_or(targets[site], |fit| fit.patch.foot_point(place))
        };
        let next = accelerator.next(&iterate, &project);
        positions = next
            .into_par_iter()
            .enumerate()
            .map(|(site, place)| {
                if place == targets[site] {
                    return place;
                }
                let Some(fit) = &steps[site].state.fit else {
                    return targets[site];
                };
                let place = fit.patch.foot_point(place);
                if is_allowed(scan, fit, place, options) {
                    place
                } else {
                    targets[site]
                }
            })
            .collect();
        states = steps.into_iter().map(|step| step.state).collect();
    }

    let sites = describe(scan, domain, options, &identities, &positions, &mut states);
    convergence.push(final_sums(domain, &sites, &positions, options));
    Solution {
        sites,
        seeds,
        convergence,
    }
}

/// The points of `scan` themselves as sites, with the cells they have on
/// patches through their neighbours: for the figures of a finished cloud.
pub fn describe_points(scan: &Scan, domain: &Domain, options: &Options) -> Vec<Site> {
    let mut identities = scan.points().to_vec();
    identities.sort_unstable();
    identities.dedup();
    let positions: Vec<Local> = identities
        .iter()
        .map(|&identity| scan.lattice().local(identity))
        .collect();
    let unknown = State {
        fit: None,
        is_exact: false,
    };
    let mut states = vec![unknown; identities.len()];
    describe(scan, domain, options, &identities, &positions, &mut states)
}

/// Which sites can still reach the core: all at first, fewer with every
/// iteration.
struct Cone<'a> {
    domain: &'a Domain,
    iterations: u32,
    reach: f64,
    seed_margin: i64,
}

impl<'a> Cone<'a> {
    fn new(domain: &'a Domain, options: &Options, lattice: &Lattice) -> Self {
        Self {
            domain,
            iterations: options.iterations,
            // Half as much again as influence is taken to travel: what is
            // exact must not be lost to the cone.
            reach: 1.6 * options.reach_of_an_iteration() / lattice.scale,
            seed_margin: lattice.units(SEED_MARGIN * options.spacing + options.fit_radius),
        }
    }

    fn matters(&self, identity: Stored, iteration: u32) -> bool {
        let rings = f64::from(self.iterations - iteration + 2);
        let away = -self.domain.core.depth(identity) - self.domain.band;
        away as f64 <= rings * self.reach
    }
}

/// What a thread reuses from site to site.
struct Scratch {
    cell: Cell,
    neighbors: Vec<crate::geometry::Neighbor>,
    samples: Vec<Local>,
}

impl Scratch {
    fn new() -> Self {
        Self {
            cell: Cell::new(),
            neighbors: Vec::new(),
            samples: Vec::new(),
        }
    }
}

/// A site that stays where it is because it no longer matters.
fn frozen(state: State, position: Local) -> Step {
    Step {
        state: State {
            is_exact: false,
            ..state
        },
        target: position,
        links: [NO_LINK; LINKS],
        nearest: None,
    }
}

#[expect(
    clippy::too_many_arguments,
    reason = "the step's inputs, named; a struct of them would have one user"
)]
fn lloyd_step(
    scan: &Scan,
    options: &Options,
    neighborhoods: &Neighborhoods,
    positions: &[Local],
    states: &[State],
    site: usize,
    cone: &Cone<'_>,
    scratch: &mut Scratch,
) -> Step {
    let position = positions[site];
    // III-B: the patch, kept while the site stays near where it was fitted.
    let kept = states[site]
        .fit
        .filter(|fit| fit.serves(position, options.spacing));
    let fit = kept.or_else(|| local_patch(scan, position, options, &mut scratch.samples));
    let mut step = Step {
        state: State {
            fit,
            is_exact: states[site].is_exact,
        },
        target: position,
        links: [NO_LINK; LINKS],
        nearest: None,
    };
    let Some(fit) = fit else {
        neighborhoods.gather(
            position,
            2.0 * DOMAIN_RADIUS * options.spacing,
            &mut scratch.neighbors,
        );
        step.nearest = nearest(&scratch.neighbors);
        return step;
    };
    // III-C: the cell.
    let moments = restricted_cell(
        &fit,
        position,
        options,
        neighborhoods,
        &mut scratch.neighbors,
        &mut scratch.cell,
    );
    step.nearest = nearest(&scratch.neighbors);
    for (link, neighbor) in step.links.iter_mut().zip(scratch.cell.neighbors()) {
        *link = neighbor;
    }
    // Exact if everything within the security radius is.
    let security = scratch.cell.security_squared();
    step.state.is_exact &= scratch
        .neighbors
        .iter()
        .take_while(|n| n.distance_squared <= security)
        .all(|n| states[n.index as usize].is_exact)
        && is_known(position, security.sqrt(), cone, scan.lattice());
    if !fit.is_trusted(options) {
        return step;
    }
    // IV-B, IV-D, IV-E: the centroid, on the patch, near the scan.
    if let Some(moments) = moments {
        let target = fit.patch.foot_point(moments.centroid);
        if is_allowed(scan, &fit, target, options) {
            step.target = target;
        }
    }
    step
}

/// Whether all seeds within `radius` of `place` are known to be right.
fn is_known(place: Local, radius: f64, cone: &Cone<'_>, lattice: &Lattice) -> bool {
    lattice.stored(place).is_some_and(|stored| {
        cone.domain.known.depth(stored) >= cone.seed_margin + lattice.units(radius)
    })
}

/// The boundary restriction (IV-E).
fn is_allowed(scan: &Scan, fit: &Fit, place: Local, options: &Options) -> bool {
    let threshold = options
        .restriction
        .threshold(fit.input_spacing, options.spacing);
    // Not a number is nowhere near the scan.
    place.iter().all(|c| c.is_finite())
        && (threshold.is_infinite() || scan.has_point_within(place, threshold))
}

fn nearest(neighbors: &[crate::geometry::Neighbor]) -> Option<f64> {
    neighbors.first().map(|n| n.distance_squared.sqrt())
}

fn sums(is_core: &[bool], steps: &[Step]) -> DistanceSums {
    let mut sums = DistanceSums::default();
    for (_, step) in is_core.iter().zip(steps).filter(|(core, _)| **core) {
        if let Some(distance) = step.nearest {
            sums.push(distance);
        }
    }
    sums
}

fn final_sums(
    domain: &Domain,
    sites: &[Site],
    positions: &[Local],
    options: &Options,
) -> DistanceSums {
    let grid = crate::geometry::NeighborGrid::new(positions, options.spacing);
    let mut sums = DistanceSums::default();
    for site in sites.iter().filter(|s| domain.core.contains(s.identity)) {
        let mut met_itself = false;
        let mut least = f64::INFINITY;
        grid.visit_around(site.position, 2.0 * options.spacing, |_, other| {
            let squared = (other - site.position).norm_squared();
            if squared == 0.0 && !met_itself {
                met_itself = true;
            } else {
                least = least.min(squared);
            }
        });
        if least <= (2.0 * options.spacing).powi(2) {
            sums.push(least.sqrt());
        }
    }
    sums
}

/// The sites of core and band as they are, with the figures of their cells.
fn describe(
    scan: &Scan,
    domain: &Domain,
    options: &Options,
    identities: &[Stored],
    positions: &[Local],
    states: &mut [State],
) -> Vec<Site> {
    let neighborhoods = Neighborhoods::new(positions, options.spacing);
    states
        .par_iter_mut()
        .enumerate()
        .map_init(Scratch::new, |scratch, (index, state)| {
            let identity = identities[index];
            if domain.core.depth(identity) <= -domain.band && !domain.core.contains(identity) {
                return None;
            }
            let position = positions[index];
            let fit = state
                .fit
                .filter(|fit| fit.serves(position, options.spacing))
                .or_else(|| local_patch(scan, position, options, &mut scratch.samples));
            state.fit = fit;
            let moments = fit.and_then(|fit| {
                restricted_cell(
                    &fit,
                    position,
                    options,
                    &neighborhoods,
                    &mut scratch.neighbors,
                    &mut scratch.cell,
                )
            });
            Some(Site {
                identity,
                position,
                is_exact: state.is_exact,
                is_held: !fit.is_some_and(|fit| fit.is_trusted(options)),
                is_closed: moments.is_some() && scratch.cell.is_closed(),
                neighbors: u8::try_from(scratch.cell.neighbor_count()).unwrap_or(u8::MAX),
                area: moments.map_or(0.0, |m| m.area),
                energy: moments.map_or(0.0, |m| m.energy),
            })
        })
        .flatten_iter()
        .collect()
}
