//! The sites of a cloud on their way from seeds to the solution.

use rayon::prelude::*;

use super::{
    acceleration::Memory,
    blocks::in_blocks,
    count::SiteWithCorner,
    region::{DependencyCone, TileRegion},
    resumed_sites::ResumedSites,
    rings::{Edges, GAP, Rings},
    site::{FARTHEST_NEIGHBOR_IN_SPACINGS, Site},
    site_state::SiteState,
    step::{BLOCKS_PER_TASK, Iteration, Neighborhoods, Scratch, Step, Vicinity, clearance},
    surface::Surface,
};
use crate::{
    geometry::{Cell, ITEMS_PER_TASK, Local, Moments, Stored},
    quality::SumsBySurroundings,
};

/// The sites of a cloud on their way, in the order of their blocks, and of their identities
/// within a block.
pub(super) struct Sites<'a> {
    pub(super) surface: Surface<'a>,
    region: &'a TileRegion,
    pub(super) identities: Vec<Stored>,
    pub(super) neighborhoods: Neighborhoods,
    pub(super) steps: Vec<Step>,
}

impl<'a> Sites<'a> {
    /// Sites that start at `positions`; `identities` must be sorted.
    pub(super) fn new(
        surface: Surface<'a>,
        region: &'a TileRegion,
        identities: Vec<Stored>,
        positions: Vec<Local>,
    ) -> Self {
        let (blocks, order) = in_blocks(&positions, surface.field());
        let positions: Vec<Local> = order.iter().map(|&i| positions[i as usize]).collect();
        Self {
            surface,
            region,
            identities: order.iter().map(|&i| identities[i as usize]).collect(),
            steps: positions.par_iter().map(|&p| Step::new(p)).collect(),
            neighborhoods: Neighborhoods::new(positions, blocks, surface.field()),
        }
    }

    /// Sites that continue as they were `resumed`, and what over-relaxation remembers of them.
    pub(super) fn resume(
        surface: Surface<'a>,
        region: &'a TileRegion,
        resumed: ResumedSites<'_>,
    ) -> (Self, Vec<Option<Memory>>) {
        let ResumedSites {
            blocks,
            identities,
            positions,
            steps,
            moves,
            memories,
            ..
        } = resumed;
        let neighborhoods = Neighborhoods::new(positions, blocks, surface.field());
        let sites = Self {
            surface,
            region,
            identities,
            steps,
            neighborhoods: neighborhoods.after(moves),
        };
        (sites, memories)
    }

    /// The states of the wanted sites; `memories` are those of over-relaxation for all sites.
    pub(super) fn into_states(self, memories: Option<Vec<Memory>>) -> Vec<SiteState> {
        let Self {
            region,
            identities,
            neighborhoods,
            steps,
            ..
        } = self;
        // States are as large as all that is known of who is near whom, and take its place.
        let (positions, moves) = neighborhoods.into_positions_and_moves();
        let is_wanted = |&site: &usize| region.wants(identities[site]);
        let state = |site: usize, step: Step| SiteState {
            identity: identities[site],
            position: positions[site],
            last_move: moves[site],
            links: step
                .links
                .sites()
                .map(|link| identities[link as usize])
                .collect(),
            memory: memories.as_ref().map(|memories| memories[site]),
            step: step.kept(),
        };
        // States are large: a vector of them that grows would take much of a tile's memory.
        let count = (0..steps.len()).filter(is_wanted).count();
        let mut states = Vec::with_capacity(count);
        let steps = steps.into_iter().enumerate();
        let wanted = steps.filter(|(site, _)| is_wanted(site));
        states.extend(wanted.map(|(site, step)| state(site, step)));
        states
    }

    /// Marks the sites whose seeds every tile elects as exact.
    pub(super) fn mark_exact_seeds(&mut self, cone: &DependencyCone<'_>) {
        for (step, &identity) in self.steps.iter_mut().zip(&self.identities) {
            step.is_exact = cone.is_right_seed(identity);
        }
    }

    /// Computes the first Lloyd step of all sites, and gives the wanted sites with the figures
    /// of their cells before it, as [`describe`](Self::describe) does.
    pub(super) fn first_step(&mut self, cone: &DependencyCone<'_>) -> Vec<Site> {
        let surface = self.surface;
        let was_exact = self.are_exact();
        let iteration = Iteration::new(surface, cone, &was_exact, 0);
        let sites = self.of_wanted(|step, identity, wanted, surface, mut vicinity| {
            let moments = step.clip(surface, &mut vicinity);
            if let Some(wanted) = wanted {
                *wanted = Some(site(identity, step, moments, &mut vicinity));
            }
            step.step_to_centroid(moments, iteration.on(surface), &mut vicinity);
        });
        by_identity(sites, |site| site.identity)
    }

    /// Computes the Lloyd step of every site that still matters. Gives the distances from the
    /// core's sites to their nearest neighbours before the step; where the spacing varies, as if it were the coarsest
    /// everywhere.
    pub(super) fn lloyd_step(
        &mut self,
        cone: &DependencyCone<'_>,
        iteration: u32,
    ) -> SumsBySurroundings {
        let (surface, region, identities) = (self.surface, self.region, &self.identities);
        let matters = |site: usize| cone.matters(identities[site], iteration);
        let was_exact = self.are_exact();
        self.steps
            .par_iter_mut()
            .zip(self.neighborhoods.positions())
            .enumerate()
            .filter(|&(site, _)| !matters(site))
            .for_each(|(_, (step, &position))| step.retire(position));
        let iteration = Iteration::new(surface, cone, &was_exact, iteration);
        let in_core = |identity: &&Stored| region.core.contains(**identity);
        let spacing = surface.spacing();
        let mut nearest = vec![None; identities.iter().filter(in_core).count()];
        by_block(
            &mut self.steps,
            &mut nearest,
            |site| region.core.contains(identities[site]),
            &self.neighborhoods,
            surface,
            |step, nearest, surface, vicinity| {
                if matters(vicinity.site) {
                    let scale = spacing / vicinity.spacing;
                    step.advance(iteration.on(surface), vicinity);
                    if let Some(nearest) = nearest {
                        *nearest = step
                            .nearest
                            .map(|distance| (step.surroundings(), scale * distance));
                    }
                }
            },
        );
        SumsBySurroundings::of(nearest.into_iter().flatten())
    }

    /// Moves the sites to the positions `next`, projected and restricted; where that is not
    /// allowed, to the targets of their Lloyd steps.
    pub(super) fn move_to(&mut self, mut next: Vec<Local>) {
        let (surface, spacings) = (self.surface, self.neighborhoods.spacings());
        next.par_iter_mut()
            .zip(&mut self.steps)
            .zip(self.neighborhoods.positions())
            .enumerate()
            .with_max_len(ITEMS_PER_TASK)
            .for_each(|(site, ((position, step), before))| {
                let target = step.target;
                if *position == target {
                    return;
                }
                *position = match &mut step.fit {
                    Some(fit) => {
                        let foot = fit.foot_point(*position);
                        let is_clear = (foot - before).norm() <= step.free;
                        let mut place = None;
                        let here = surface.at(spacings.of(site), &mut place);
                        let is_allowed = is_clear && fit.allows(foot, here);
                        if is_allowed { foot } else { target }
                    }
                    None => target,
                };
            });
        self.neighborhoods.move_to(next, surface.field());
    }

    /// Moves the sites that still matter after `iterations`, which are all, to where they end.
    pub(super) fn settle(&mut self, cone: &DependencyCone<'_>, iterations: u32) {
        let (surface, identities) = (self.surface, &self.identities);
        let was_exact = self.are_exact();
        let iteration = Iteration::new(surface, cone, &was_exact, iterations);
        let mut positions = self.neighborhoods.positions().to_vec();
        by_block(
            &mut self.steps,
            &mut positions,
            |_| true,
            &self.neighborhoods,
            surface,
            |step, position, surface, mut vicinity| {
                let matters = cone.matters(identities[vicinity.site], iterations);
                if let Some(position) = position.filter(|_| matters) {
                    *position = step.settle(iteration.on(surface), &mut vicinity);
                }
            },
        );
        self.neighborhoods.move_to(positions, surface.field());
    }

    /// The wanted sites with the figures of their cells, in the order of their identities.
    pub(super) fn describe(&mut self) -> Vec<Site> {
        let sites = self.of_wanted(|step, identity, wanted, surface, mut vicinity| {
            if let Some(wanted) = wanted {
                let moments = step.clip(surface, &mut vicinity);
                *wanted = Some(site(identity, step, moments, &mut vicinity));
            }
        });
        by_identity(sites, |site| site.identity)
    }

    /// The wanted sites as [`describe`](Self::describe) gives them, each with the farthest corner of its cell, if
    /// neighbours bound it all around.
    pub(super) fn describe_with_corners(&mut self) -> Vec<SiteWithCorner> {
        let found = self.of_wanted(|step, identity, wanted, surface, mut vicinity| {
            if let Some(wanted) = wanted {
                let moments = step.clip(surface, &mut vicinity);
                let site = site(identity, step, moments, &mut vicinity);
                let fit = step.fit.as_ref().filter(|_| site.bounded_area().is_some());
                let cell = &vicinity.scratch.cell;
                let corner = fit.and_then(|fit| cell.farthest_corner(&fit.patch, site.position));
                *wanted = Some((site, corner));
            }
        });
        by_identity(found, |(site, _)| site.identity)
    }

    /// The wanted sites as [`describe`](Self::describe) gives them, and the rings of their
    /// neighbours.
    pub(super) fn describe_with_rings(&mut self) -> (Vec<Site>, Rings) {
        let count = self.steps.len();
        let found = self.of_wanted(|step, identity, wanted, surface, mut vicinity| {
            if let Some(wanted) = wanted {
                let moments = step.clip(surface, &mut vicinity);
                let site = site(identity, step, moments, &mut vicinity);
                *wanted = Some((site, edges(step, moments, &vicinity)));
            }
        });
        let found = by_identity(found, |(site, _)| site.identity);
        let (sites, edges): (Vec<Site>, Vec<Edges>) = found.into_iter().unzip();
        (sites, Rings::new(&edges, count))
    }

    /// Does `work` on all sites; far neighbours may close their cells. Gives what it finds for the
    /// wanted ones, in the order of the blocks: for each of them it receives a place to put it in, and the surface by the
    /// options where it is.
    fn of_wanted<T: Clone + Send>(
        &mut self,
        work: impl Fn(&mut Step, Stored, Option<&mut Option<T>>, Surface<'_>, Vicinity<'_>) + Sync,
    ) -> Vec<T> {
        let (identities, region) = (&self.identities, self.region);
        let is_wanted = |site: usize| region.wants(identities[site]);
        let count = (0..identities.len())
            .filter(|&site| is_wanted(site))
            .count();
        let mut found = vec![None; count];
        by_block(
            &mut self.steps,
            &mut found,
            is_wanted,
            &self.neighborhoods,
            self.surface,
            |step, found, surface, mut vicinity| {
                vicinity.may_close_far = true;
                work(step, identities[vicinity.site], found, surface, vicinity);
            },
        );
        // All sites together take a good part of the memory: so this is done in place, which flattening is not.
        let found = found.into_iter();
        found
            .map(|found| found.expect("work is done on every wanted site"))
            .collect()
    }

    /// Whether each site is exact.
    fn are_exact(&self) -> Vec<bool> {
        self.steps.par_iter().map(|step| step.is_exact).collect()
    }
}

/// Sorts `found` by the identities of the sites, which are unique.
fn by_identity<T: Send>(mut found: Vec<T>, identity: impl Fn(&T) -> Stored + Sync) -> Vec<T> {
    found.par_sort_unstable_by_key(identity);
    found
}

/// The site of `step` with the figures of the cell that was clipped last, with `moments`.
fn site(
    identity: Stored,
    step: &Step,
    moments: Option<Moments>,
    vicinity: &mut Vicinity<'_>,
) -> Site {
    let nearest = vicinity.nearest_within(FARTHEST_NEIGHBOR_IN_SPACINGS * vicinity.spacing);
    let surface = step.fit.as_ref().map(|fit| fit.upwards(vicinity.position));
    let cell = moments.map(|_| &vicinity.scratch.cell);
    let neighbors = cell.map_or(0, Cell::neighbor_count);
    Site {
        identity,
        position: vicinity.position,
        is_exact: step.is_exact,
        is_fixed: surface.is_none(),
        trust: step.fit.as_ref().map_or(0.0, |fit| fit.trust),
        normal: surface.map(|(normal, _)| normal),
        curvature: surface.map_or(f64::NAN, |(_, curvature)| curvature),
        is_closed: moments.is_some() && vicinity.has_closed_cell(),
        neighbors: u8::try_from(neighbors).unwrap_or(u8::MAX),
        spacing: vicinity.spacing,
        area: moments.map_or(0.0, |m| m.area),
        energy: moments.map_or(0.0, |m| m.energy),
        nearest: nearest.unwrap_or(f64::INFINITY),
    }
}

/// The edges of the cell that was clipped last for the site of `step`; none without `moments`.
fn edges(step: &Step, moments: Option<Moments>, vicinity: &Vicinity<'_>) -> Edges {
    let fit = step.fit.as_ref().filter(|_| moments.is_some());
    let around = fit.map(|fit| {
        let cell = &vicinity.scratch.cell;
        let edges = cell.edge_neighbors().map(|edge| edge.unwrap_or(GAP));
        // The order of the cell is that of the patch's frame, whose axis may point downwards.
        let (normal, _) = fit.upwards(vicinity.position);
        match normal.dot(&fit.patch.axes[2]) < 0.0 {
            true => edges.rev().collect(),
            false => edges.collect(),
        }
    });
    Edges {
        site: vicinity.site as u32,
        around: around.unwrap_or_default(),
    }
}

/// Calls `work` for every site, in parallel by blocks, with the surface by the options where the site is. A site that
/// `has_result` receives its entry of `results`, which has one for each of those, in their order.
fn by_block<T: Send>(
    steps: &mut [Step],
    results: &mut [T],
    has_result: impl Fn(usize) -> bool + Sync,
    neighborhoods: &Neighborhoods,
    surface: Surface<'_>,
    work: impl Fn(&mut Step, Option<&mut T>, Surface<'_>, Vicinity<'_>) + Sync,
) {
    let mut rest = (steps, results);
    let mut blocks = Vec::with_capacity(neighborhoods.blocks().len());
    for block in neighborhoods.blocks() {
        let count = block.clone().filter(|&site| has_result(site)).count();
        let (steps, other_steps) = rest.0.split_at_mut(block.len());
        let (results, other_results) = rest.1.split_at_mut(count);
        blocks.push((block, steps, results));
        rest = (other_steps, other_results);
    }
    blocks
        .into_par_iter()
        .with_max_len(BLOCKS_PER_TASK)
        .for_each_init(Scratch::new, |scratch, (block, steps, results)| {
            scratch.begin(neighborhoods, block);
            let mut results = results.iter_mut();
            for (site, step) in block.clone().zip(steps) {
                // The neighbours of the last site are not those of this one.
                scratch.neighbors.clear();
                let spacing = neighborhoods.spacings().of(site);
                let mut place = None;
                let surface = surface.at(spacing, &mut place);
                let vicinity = Vicinity {
                    site,
                    position: neighborhoods.positions()[site],
                    spacing,
                    clearance: clearance(surface.options),
                    neighborhoods,
                    block: block.clone(),
                    links: step.links,
                    was_open: step.is_open,
                    may_close_far: false,
                    scratch,
                };
                let result = has_result(site).then(|| results.next()).flatten();
                work(step, result, surface, vicinity);
            }
        });
}
