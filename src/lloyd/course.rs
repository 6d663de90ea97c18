//! The course of the sites of one tile through the iterations of a round.

use std::ops::ControlFlow;

use super::{
    acceleration::{Accelerator, Iterate},
    count::{Candidates, CountCorrection, WantedCount},
    isolated::are_isolated,
    options::SolverOptions,
    region::{DependencyCone, TileRegion},
    resumed_sites::ResumedSites,
    round::Round,
    seeds::elect,
    site::Site,
    site_state::SiteState,
    sites::Sites,
    surface::Surface,
    tally::uniformity,
};
use crate::{
    geometry::{Local, Stored},
    quality::{SumsBySurroundings, UniformityTally},
};

/// Receives the share of the work that is done, between 0 and 1, from time to time, and says
/// whether the solver goes on.
pub(crate) type Monitor<'a> = &'a dyn Fn(f64) -> ControlFlow<()>;

/// The solver was stopped by its [`Monitor`] before it had a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cancelled;

/// Approximate share of the time of all iterations that has passed when the seeds are elected.
const ELECTED_SHARE: f64 = 0.36;

/// Approximate share of the time of all iterations that has passed when the seeds are elected and
/// described.
const DESCRIBED_SHARE: f64 = 0.48;

/// The sites of one tile on their way through the iterations of a round.
pub(super) struct Course<'a> {
    pub(super) options: &'a SolverOptions,
    region: &'a TileRegion,
    round: Round,
    cone: DependencyCone<'a>,
    /// The next iteration.
    next: u32,
    pub(super) sites: Sites<'a>,
    accelerator: Accelerator,
    /// The figures of the core's sites before the first iteration of all.
    pub(super) seeds: UniformityTally,
    /// The distances from the core's sites to their nearest neighbours before the first iteration of all.
    seed_distances: SumsBySurroundings,
    /// The identities of the core's seeds that are isolated, in order; left out of the sites if the options say so.
    pub(super) isolated: Vec<Stored>,
    /// The distances from the core's sites to their nearest neighbours, at the start of every
    /// iteration of the round; where the spacing varies, as if it were the coarsest everywhere.
    pub(super) convergence: Vec<SumsBySurroundings>,
}

impl<'a> Course<'a> {
    /// Elects the seeds of `surface` for a course through `round`, the first one. `monitor` is
    /// consulted before and after the election.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] if `monitor` stops the solver.
    pub(super) fn begin(
        surface: Surface<'a>,
        region: &'a TileRegion,
        round: Round,
        monitor: Monitor<'_>,
    ) -> Result<Self, Cancelled> {
        let (options, quantization) = (surface.options, surface.quantization());
        let consult = |share: f64| consult(monitor, options, &round, share);

        // Seeds are elected in the whole scan; those that can influence no wanted site are
        // dropped.
        consult(0.0)?;
        let all = elect(surface.scan, options);
        consult(ELECTED_SHARE)?;
        let cone = DependencyCone::new(region, &round, options, quantization);
        let is_isolated = are_isolated(surface, &all.positions, |seed| {
            let identity = all.identities[seed];
            match options.drops_isolated {
                true => cone.matters(identity, 0),
                false => region.core.contains(identity),
            }
        });
        let (mut isolated, mut identities, mut positions) = (Vec::new(), Vec::new(), Vec::new());
        let seeds = all.identities.into_iter().zip(all.positions);
        for ((identity, position), is_isolated) in seeds.zip(is_isolated) {
            if is_isolated && region.core.contains(identity) {
                isolated.push(identity);
            }
            if cone.matters(identity, 0) && !(is_isolated && options.drops_isolated) {
                identities.push(identity);
                positions.push(position);
            }
        }

        // The first Lloyd step shares its cells with the figures of the seeds.
        let mut sites = Sites::new(surface, region, identities, positions);
        sites.mark_exact_seeds(&cone);
        let seeds = sites.first_step(&cone);
        let in_core = |seed: &&Site| region.core.contains(seed.identity);
        let accelerator = Accelerator::new(
            options.acceleration,
            &sites.identities,
            quantization.scale,
            options.spacing,
        );
        Ok(Self {
            options,
            region,
            next: round.iterations.start,
            round,
            cone,
            sites,
            accelerator,
            seeds: uniformity(seeds.iter().filter(in_core), options.spacing),
            seed_distances: nearest_distances(region, &seeds, options.spacing),
            isolated,
            convergence: Vec::new(),
        })
    }

    /// Continues a course through `round`, one that is not the first, with `resumed` sites.
    pub(super) fn resume(
        surface: Surface<'a>,
        region: &'a TileRegion,
        round: Round,
        resumed: ResumedSites<'_>,
    ) -> Self {
        let (options, quantization) = (surface.options, surface.quantization());
        let cone = DependencyCone::new(region, &round, options, quantization);
        let (sites, memories) = Sites::resume(surface, region, resumed);
        Self {
            options,
            region,
            cone,
            next: round.iterations.start,
            round,
            sites,
            accelerator: Accelerator::resume(options.acceleration, memories),
            seeds: UniformityTally::new(options.spacing),
            seed_distances: SumsBySurroundings::default(),
            isolated: Vec::new(),
            convergence: Vec::new(),
        }
    }

    /// Does the iterations of the round that come before `end`. `monitor` is consulted before each.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] if `monitor` stops the solver.
    pub(super) fn iterate_until(
        &mut self,
        end: u32,
        monitor: Monitor<'_>,
    ) -> Result<(), Cancelled> {
        for iteration in self.next..end {
            let share = share_before(iteration, self.options);
            consult(monitor, self.options, &self.round, share)?;
            self.convergence.push(match iteration {
                0 => self.seed_distances,
                _ => self.sites.lloyd_step(&self.cone, iteration),
            });
            let next = self.accelerator.next(&Iterate {
                sites: self.sites.neighborhoods.positions(),
                steps: &self.sites.steps,
                spacings: self.sites.neighborhoods.spacings(),
                spacing: self.options.spacing,
            });
            self.sites.move_to(next);
        }
        self.next = end;
        Ok(())
    }

    /// Does the iterations of the round. `monitor` is consulted before each.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] if `monitor` stops the solver.
    pub(super) fn iterate(&mut self, monitor: Monitor<'_>) -> Result<(), Cancelled> {
        self.iterate_until(self.round.iterations.end, monitor)
    }

    /// Moves the sites to where they end: on patches that more of the scan is behind, and near edges on the facets that meet there, if the
    /// options want that. All iterations are done.
    pub(super) fn settle(&mut self) {
        self.sites.settle(&self.cone, self.next);
    }

    /// The sites of the core that may leave, and the places there where sites may come.
    pub(super) fn candidates(&mut self) -> Candidates {
        let sites = self.sites.describe_with_corners();
        Candidates::of(&sites, &self.region.core, self.sites.surface)
    }

    /// The course of as many sites as are `wanted`, in a cloud of which all sites are known. It goes on from the states
    /// that two rounds have between them.
    ///
    /// # Errors
    ///
    /// [`Cancelled`] if `monitor` stops the solver.
    pub(super) fn corrected(
        mut self,
        wanted: WantedCount,
        monitor: Monitor<'_>,
    ) -> Result<Self, Cancelled> {
        let [first, _] = self.options.two_rounds();
        self.iterate_until(first.iterations.end, monitor)?;
        let candidates = self.candidates();
        let all = candidates.sites;
        let parts = std::iter::once(Ok(candidates));
        let correction = CountCorrection::choose(wanted, all, parts, self.options)?;
        let surface = self.sites.surface;
        let states = self.sites.into_states(self.accelerator.into_memories());
        let place = |state: &SiteState| (state.identity, state.position);
        let mut known: Vec<(Stored, Local)> = states.iter().map(place).collect();
        known.extend(correction.coming());
        let mut resumed = ResumedSites::new(known, surface.field(), &correction);
        resumed.add(states);
        let (sites, memories) = Sites::resume(surface, self.region, resumed);
        Ok(Self {
            sites,
            accelerator: Accelerator::resume(self.options.acceleration, memories),
            ..self
        })
    }

    /// The states of the wanted sites.
    pub(super) fn into_states(self) -> Vec<SiteState> {
        self.sites.into_states(self.accelerator.into_memories())
    }
}

/// Approximate share of the time of all iterations that has passed before `iteration`. The first
/// ones take longer: more sites move, and more patches are fitted.
fn share_before(iteration: u32, options: &SolverOptions) -> f64 {
    let share = (f64::from(iteration) / f64::from(options.iterations)).powf(0.85);
    DESCRIBED_SHARE + (1.0 - DESCRIBED_SHARE) * share
}

/// Reports that `share` of the time of all iterations has passed, as a share of that of `round`.
fn consult(
    monitor: Monitor<'_>,
    options: &SolverOptions,
    round: &Round,
    share: f64,
) -> Result<(), Cancelled> {
    let start = match round.iterations.start {
        0 => 0.0,
        start => share_before(start, options),
    };
    let end = match round.iterations.end {
        end if end == options.iterations => 1.0,
        end => share_before(end, options),
    };
    match monitor((share - start) / (end - start)) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Cancelled),
    }
}

/// The distances from the core's `sites` to their nearest neighbours, as if all spacings were `spacing` (CRS units).
pub(super) fn nearest_distances(
    region: &TileRegion,
    sites: &[Site],
    spacing: f64,
) -> SumsBySurroundings {
    let counts = |site: &&Site| site.nearest.is_finite() && region.core.contains(site.identity);
    let distances = sites.iter().filter(counts);
    let scaled = |site: &Site| spacing / site.spacing * site.nearest;
    SumsBySurroundings::of(distances.map(|site| (site.surroundings(), scaled(site))))
}
