//! Algorithm 1 of the paper, over the sites that matter to one tile.

use std::ops::ControlFlow;

use super::{
    count::{Candidates, WantedCount, candidate_band},
    course::{Cancelled, Course, Monitor, nearest_distances},
    options::SolverOptions,
    region::TileRegion,
    resumed_sites::ResumedSites,
    rings::Rings,
    scan::Scan,
    site::Site,
    site_state::SiteState,
    sites::Sites,
    surface::Surface,
};
use crate::{
    geometry::{Local, Stored},
    quality::{SumsBySurroundings, UniformityTally},
};

/// The result of [`solve`].
#[derive(Clone, Debug)]
pub struct Solution {
    /// The sites of core and band, in the order of their identities.
    pub sites: Vec<Site>,
    /// The figures of the core's sites before the first iteration.
    pub seeds: UniformityTally,
    /// The distances from the core's sites to their nearest neighbours, at the start of every
    /// iteration and after the last.
    pub(crate) convergence: Vec<SumsBySurroundings>,
    /// The identities of the core's seeds that are isolated, in order.
    pub(crate) isolated: Vec<Stored>,
}

impl Solution {
    /// δ of the core's sites at the start of every iteration and after the last.
    pub fn delta_by_iteration(&self) -> Vec<f64> {
        let all = self.convergence.iter().map(|sums| sums.all().delta());
        all.collect()
    }
}

/// What the first of two rounds leaves of a tile.
pub(crate) struct FirstRound {
    /// The states of the sites of the core.
    pub(crate) states: Vec<SiteState>,
    /// The figures of the core's sites before the first iteration.
    pub(crate) seeds: UniformityTally,
    /// The distances from the core's sites to their nearest neighbours, at the start of every
    /// iteration of the round.
    pub(crate) convergence: Vec<SumsBySurroundings>,
    /// The identities of the core's seeds that are isolated, in order.
    pub(crate) isolated: Vec<Stored>,
    /// The sites of the core that may leave, and the places there where sites may come.
    pub(crate) candidates: Candidates,
}

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `region`.
///
/// # Panics
///
/// Never: its monitor does not stop the solver.
pub fn solve(scan: &Scan, region: &TileRegion, options: &SolverOptions) -> Solution {
    solve_watched(scan, region, options, None, &|_| ControlFlow::Continue(()))
        .expect("the monitor never stops the solver")
}

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `region`; for as many as are `wanted`, if the
/// region is that of a whole cloud. `monitor` is consulted before and after the election of the seeds and before every
/// iteration.
///
/// # Errors
///
/// [`Cancelled`] if `monitor` stops the solver.
pub(crate) fn solve_watched(
    scan: &Scan,
    region: &TileRegion,
    options: &SolverOptions,
    wanted: Option<WantedCount>,
    monitor: Monitor<'_>,
) -> Result<Solution, Cancelled> {
    let describe = |sites: &mut Sites<'_>| (sites.describe(), ());
    let surface = Surface::new(scan, options);
    run(surface, region, wanted, monitor, describe).map(|(solution, ())| solution)
}

/// Runs the paper's Algorithm 1 on `scan`, for the sites of `region`, and gives the ring of
/// neighbours of every site beside it. There are as many sites as are `wanted`, if the region is that of a whole cloud.
/// `monitor` is consulted before and after the election of the seeds and before every iteration.
///
/// # Errors
///
/// [`Cancelled`] if `monitor` stops the solver.
pub(crate) fn solve_with_rings(
    scan: &Scan,
    region: &TileRegion,
    options: &SolverOptions,
    wanted: Option<WantedCount>,
    monitor: Monitor<'_>,
) -> Result<(Solution, Rings), Cancelled> {
    run(
        Surface::new(scan, options),
        region,
        wanted,
        monitor,
        |sites| sites.describe_with_rings(),
    )
}

/// Does the first of two rounds on `scan`, for the sites of the core of `region`. If the cloud `has_count`, the core's
/// candidates for leaving and coming are found. `monitor` is consulted before and after the election of the seeds and before every iteration.
///
/// # Errors
///
/// [`Cancelled`] if `monitor` stops the solver.
pub(crate) fn solve_first_round(
    scan: &Scan,
    region: &TileRegion,
    options: &SolverOptions,
    has_count: bool,
    monitor: Monitor<'_>,
) -> Result<FirstRound, Cancelled> {
    // Bands are compared at the end; here they serve the candidates.
    let band = match has_count {
        true => scan.quantization().units(candidate_band(options)),
        false => 0,
    };
    let region = TileRegion { band, ..*region };
    let [round, _] = options.two_rounds();
    let mut course = Course::begin(Surface::new(scan, options), &region, round, monitor)?;
    course.iterate(monitor)?;
    let candidates = match has_count {
        true => course.candidates(),
        false => Candidates::default(),
    };
    let seeds = course.seeds.clone();
    let convergence = std::mem::take(&mut course.convergence);
    let isolated = std::mem::take(&mut course.isolated);
    let mut states = course.into_states();
    states.retain(|state| region.core.contains(state.identity));
    Ok(FirstRound {
        states,
        seeds,
        convergence,
        isolated,
        candidates,
    })
}

/// Does the last of two rounds on `scan`, for the sites of `region`, with all sites that are known
/// there, `resumed` as the first round left them. The figures of the seeds, the convergence of the first round and the isolated
/// seeds are missing from the solution. `monitor` is consulted before every iteration.
///
/// # Errors
///
/// [`Cancelled`] if `monitor` stops the solver.
pub(crate) fn solve_last_round(
    scan: &Scan,
    region: &TileRegion,
    options: &SolverOptions,
    resumed: ResumedSites<'_>,
    monitor: Monitor<'_>,
) -> Result<Solution, Cancelled> {
    let [_, round] = options.two_rounds();
    let mut course = Course::resume(Surface::new(scan, options), region, round, resumed);
    course.iterate(monitor)?;
    course.settle();
    let ended = course.sites.describe();
    Ok(solution(course, region, ended))
}

/// Runs Algorithm 1, for as many sites as are `wanted`. `describe` gives the sites after the last iteration, and what the
/// caller wants beside them.
fn run<T>(
    surface: Surface<'_>,
    region: &TileRegion,
    wanted: Option<WantedCount>,
    monitor: Monitor<'_>,
    describe: impl FnOnce(&mut Sites<'_>) -> (Vec<Site>, T),
) -> Result<(Solution, T), Cancelled> {
    let round = surface.options.only_round();
    let mut course = Course::begin(surface, region, round, monitor)?;
    let is_missed = |wanted: &WantedCount| wanted.is_missed_by(course.sites.steps.len());
    if let Some(wanted) = wanted.filter(is_missed) {
        course = course.corrected(wanted, monitor)?;
    }
    course.iterate(monitor)?;
    course.settle();
    let (ended, beside) = describe(&mut course.sites);
    Ok((solution(course, region, ended), beside))
}

/// The solution of a course with the sites as they `ended`.
fn solution(course: Course<'_>, region: &TileRegion, ended: Vec<Site>) -> Solution {
    let Course {
        options,
        seeds,
        mut convergence,
        isolated,
        ..
    } = course;
    convergence.push(nearest_distances(region, &ended, options.spacing));
    Solution {
        sites: ended,
        seeds,
        convergence,
        isolated,
    }
}

/// The points of `scan` themselves as sites, with the cells they have on patches through
/// their neighbours: for the figures of a finished cloud.
pub(crate) fn describe_points(
    scan: &Scan,
    region: &TileRegion,
    options: &SolverOptions,
) -> Vec<Site> {
    let quantization = scan.quantization();
    let positions: Vec<Local> = scan
        .points()
        .iter()
        .map(|&p| quantization.local(p))
        .collect();
    describe_positions(scan, region, options, &positions)
}

/// Sites at `positions`, with the cells they have on the patches of `scan`: for the figures of
/// what another method made of the scan. Their identities are the stored positions; of
/// several with one identity one is described, and positions that cannot be stored are left
/// out.
pub fn describe_positions(
    scan: &Scan,
    region: &TileRegion,
    options: &SolverOptions,
    positions: &[Local],
) -> Vec<Site> {
    let stored = |&position: &Local| Some((scan.quantization().stored(position)?, position));
    let mut known: Vec<(Stored, Local)> = positions.iter().filter_map(stored).collect();
    known.sort_unstable_by_key(|&(identity, _)| identity);
    known.dedup_by_key(|&mut (identity, _)| identity);
    let (identities, positions): (Vec<_>, Vec<_>) = known.into_iter().unzip();
    Sites::new(Surface::new(scan, options), region, identities, positions).describe()
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
        solve_with_rings(&scan, &TileRegion::everything(), options, None, &go_on).unwrap()
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
        // The rows of the scan run as those of the seeds do.
        for [u, v] in [[Local::x(), Local::y()], [Local::z(), Local::y()]] {
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
        let (with, _) = solve_with_rings(&scan, &region, &options, None, &go_on).unwrap();
        assert_eq!(with.sites, solve(&scan, &region, &options).sites);
    }

    /// A bush on a lawn: points even in a ball, above points even in a square.
    fn bush() -> Vec<Local> {
        let unit = |k: u64| spread(k) as f64 / u64::MAX as f64;
        let cube = |k: u64| Local::new(unit(3 * k), unit(3 * k + 1), unit(3 * k + 2));
        let lawn = (0..40_000).map(|k| cube(k).component_mul(&Local::new(3.0, 3.0, 0.002)));
        let leaves = (40_000..60_000).map(|k| cube(k) * 2.0 - Local::repeat(1.0));
        let ball = leaves.filter(|p| p.norm() < 1.0);
        lawn.chain(ball.map(|p| p + Local::new(1.5, 1.5, 1.0)))
            .collect()
    }

    #[test]
    fn in_leaves_distances_do_not_become_less_even_again() {
        let (options, points) = (SolverOptions::new(0.1), bush());
        let (solution, _) = with_rings(&points, &options);
        let fixed = solution.sites.iter().filter(|site| site.is_fixed).count();
        assert!(fixed > 300 && fixed < solution.sites.len() - 300, "{fixed}");
        // All sites count in all iterations.
        let count = solution.convergence[0].all().count;
        assert!(
            solution
                .convergence
                .iter()
                .all(|sums| sums.all().count == count)
        );
        let delta = solution.delta_by_iteration();
        let least = delta.iter().copied().fold(f64::INFINITY, f64::min);
        // Of so few sites the figure wavers; with the clearance of a surface it rises by 11 %.
        assert!(delta[delta.len() - 1] <= 1.05 * least, "{delta:?}");
    }

    #[test]
    fn a_closed_cell_reaches_no_farther_than_neighbors_are_found() {
        let (options, points) = (SolverOptions::new(0.1), bush());
        let (solution, _) = with_rings(&points, &options);
        let closed = || solution.sites.iter().filter(|site| site.is_closed);
        assert!(closed().count() > 300);
        let farthest = 1.25 * options.spacing;
        for site in closed() {
            let mean_square = site.energy / site.area;
            assert!(mean_square <= farthest * farthest, "{site:?}");
        }
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
            let result = solve_watched(&scan, &TileRegion::everything(), &options, None, &monitor);
            (result.is_ok(), calls.get())
        };
        // Before and after the election, and before each of four iterations.
        for last in 1..=6 {
            assert_eq!(solve_until(last), (false, last));
        }
        assert_eq!(solve_until(7), (true, 6));
    }
}
