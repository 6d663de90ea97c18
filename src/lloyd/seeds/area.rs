//! Random seeds, and seeds weighted by area (paper, section IV-A, made local).

use rayon::prelude::*;

use super::{lattice::AREA_PER_SEED, seed_list::Seeds};
use crate::{
    geometry::{BOUNDING_SIDES, Cell, Dice, Local, Neighbor, NeighborGrid, Stored},
    lloyd::{
        step::{Fit, Samples},
        surface::Surface,
    },
};

/// Radius of the bounding polygon of the cells of random seeds. Where the scan is sparse the
/// cells are large: the polygon must not be what bounds them.
const BOUNDING_RADIUS_IN_SPACINGS: f64 = 4.0;

/// Makes the hash of the dice differ from that of the priorities.
const DICE_SALT: u64 = 0x5eed;

/// Random points of the scan, each with the inclusion probability `seeds_per_point`.
pub(super) fn random(surface: Surface<'_>) -> Vec<Stored> {
    let options = surface.options;
    let threshold = (options.seeds_per_point.clamp(0.0, 1.0) * u64::MAX as f64) as u64;
    surface
        .scan
        .points()
        .iter()
        .copied()
        .filter(|point| point.priority(options.seed) <= threshold)
        .collect()
}

/// Memory that a thread reuses from seed to seed.
#[derive(Default)]
struct Scratch {
    cell: Cell,
    neighbors: Vec<Neighbor>,
    samples: Samples,
}

/// In the cell of every random seed as many seeds as the cell owes: its area over the
/// hexagon's.
pub(super) fn area_weighted(surface: Surface<'_>) -> Seeds {
    let first = Seeds::at_points(surface.scan, random(surface));
    let grid = NeighborGrid::new(&first.positions, 2.0 * surface.spacing());
    let seeds: Vec<(Stored, Local)> = first
        .identities
        .par_iter()
        .enumerate()
        .map_init(Scratch::default, |scratch, (own, &identity)| {
            seeds_of_cell(&first, own, identity, &grid, surface, scratch)
        })
        .flatten_iter()
        .collect();
    Seeds::at_positions(seeds)
}

/// The seeds that the cell of the random seed with the index `own` owes.
fn seeds_of_cell(
    first: &Seeds,
    own: usize,
    identity: Stored,
    grid: &NeighborGrid,
    surface: Surface<'_>,
    scratch: &mut Scratch,
) -> Vec<(Stored, Local)> {
    let (options, site) = (surface.options, first.positions[own]);
    let Scratch {
        cell,
        neighbors,
        samples,
    } = scratch;
    // Step 1: the cell of the random seed.
    samples.gather_box(surface, site, site);
    let Some(fit) = Fit::new(site, samples, options) else {
        return vec![(identity, site)];
    };
    let radius = BOUNDING_RADIUS_IN_SPACINGS * options.spacing;
    neighbors.clear();
    grid.visit_around(site, 2.5 * radius, |other, position| {
        if other as usize != own {
            neighbors.push(Neighbor::new(site, other, position));
        }
    });
    Neighbor::sort(neighbors);
    cell.clip(&fit.patch, site, &[radius; BOUNDING_SIDES], neighbors);
    let Some(moments) = cell.moments(&fit.patch, site) else {
        return Vec::new();
    };
    // Step 2: whole seeds, and one more with the probability of the fraction.
    let hexagon = AREA_PER_SEED * options.spacing * options.spacing;
    let mut dice = Dice(identity.priority(options.seed ^ DICE_SALT));
    let owed = moments.area / hexagon;
    let extra = dice.roll() < owed.fract();
    // Step 3: on the patch from the start.
    (0..owed as u64 + u64::from(extra))
        .filter_map(|_| {
            let position = cell.random_point(&fit.patch, site, [dice.roll(), dice.roll()])?;
            let near = surface.scan.has_point_within(position, options.spacing);
            Some((surface.quantization().stored(position)?, position)).filter(|_| near)
        })
        .collect()
}
