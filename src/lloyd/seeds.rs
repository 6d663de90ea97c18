//! Where the sites start: seeds elected from the scan by a local rule.
//!
//! Every seed has an *identity* that does not depend on tiles: coordinates as
//! stored, unique, of the point it was elected at. Two tiles that see a place
//! elect the same seeds there, with the same identities; the stitcher joins
//! tiles by them.
//!
//! * [`SeedRule::Hexagonal`]: the nodes of hexagonal lattices on the surfaces
//!   (see `nodes.rs`), then points of the scan that are not too near to a seed,
//!   until every point is covered by one.
//! * [`SeedRule::Poisson`]: points of the scan alone, in the order of a hash:
//!   dart throwing.
//! * [`SeedRule::Area`]: the paper's section IV-A: random seeds, then as many
//!   in each one's cell as its area owes.
//! * [`SeedRule::Random`]: the paper's baseline.

use rayon::prelude::*;

use super::{
    Scan, SolverOptions,
    around::Scratch,
    neighborhoods::{bounds, neighbor},
    nodes::Nodes,
    scan::priority,
};
use crate::geometry::{
    AT_ONCE, BOUNDING_SIDES, Local, Neighbor, NeighborGrid, Rect, Stored, cell_of, spread,
};

/// Radius of the Poisson-disk election, in spacings.
///
/// Random sequential addition of discs of diameter `r` jams at a covered share
/// of 0.547 (Feder, *Random sequential adsorption*, 1980), which is 0.697 / r²
/// seeds to the unit of area; the hexagonal lattice of spacing h has
/// 2 / (√3 h²). They would agree at r = 0.777 h; a scan of some thirty points
/// to the seed has no point in the last gaps, and agrees at 0.745 h (measured
/// on a sheet, see the test `the_election_meets_the_density`).
pub(crate) const ELECTION_RADIUS: f64 = 0.745;

/// The same for points that lie on no surface: leaves, wires, strays. Their seeds
/// stay where they are elected; at the radius above they would be nearer to each
/// other than the sites of a surface are once they are even. In a forest of
/// 0.9 M points (to 1 %) δ is 0.049 with 0.8, 0.053 with 0.85, 0.063 with 0.9;
/// on a street with trees 0.181, 0.178 and 0.179.
const LOOSE_RADIUS: f64 = 0.85;

/// Distance from all other seeds, in spacings, at which a front may start.
const NUCLEI: f64 = 2.5;

/// Edge of the cells, in spacings, whose points look for seeds together.
const BRICK: f64 = 4.0 / 3.0;

/// How far beyond the radius the steps of a front look, in spacings.
const FRONTS: [f64; 6] = [0.1, 0.1, 0.1, 0.2, 0.2, 0.2];

/// Distance between the rows of a hexagonal lattice, in spacings: √3/2.
pub(super) const ROW: f64 = 0.866_025_403_784_438_6;

/// Area that one seed owes, in squared spacings: the hexagon's.
pub const AREA_PER_SEED: f64 = ROW;

/// How seeds are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SeedRule {
    /// Nodes of hexagonal lattices on the surfaces, then points of the scan.
    #[default]
    Hexagonal,
    /// Poisson-disk election.
    Poisson,
    /// Area-weighted, after random ones (paper, section IV-A).
    Area,
    /// Points of the scan at random.
    Random,
}

/// Seeds, sorted by identity.
#[derive(Clone, Debug, Default)]
pub struct Seeds {
    /// Who they are.
    pub identities: Vec<Stored>,
    /// Where they start.
    pub positions: Vec<Local>,
}

/// Chooses seeds for `scan` by the rule of `options`.
pub fn elect(scan: &Scan, options: &SolverOptions) -> Seeds {
    match options.seeds {
        SeedRule::Hexagonal | SeedRule::Poisson => from_points(scan, elected(scan, options)),
        SeedRule::Random => from_points(scan, random(scan, options)),
        SeedRule::Area => area_weighted(scan, options),
    }
}

/// The seeds of an election, in no order.
fn elected(scan: &Scan, options: &SolverOptions) -> Vec<Stored> {
    let mut election = Election {
        scan,
        options,
        seeds: Vec::new(),
    };
    if options.seeds == SeedRule::Poisson {
        election.elect_in_order(equal(scan.points().iter().copied()));
        return election.seeds;
    }
    let nodes = Nodes::new(scan, options);
    // Nearer to each other than seeds may be are nodes where one lattice ends
    // and the next begins.
    election.elect_in_order(nodes.places(scan, options));
    // One point to a voxel says where a surface is. Elsewhere every point counts:
    // what no seed covers there is not covered later.
    let is_on_surface = |voxel: &&[Stored]| nodes.have(scan.quantization().local(voxel[0]));
    let (surfaces, loose): (Vec<&[Stored]>, Vec<&[Stored]>) =
        scan.points_by_voxel().partition(is_on_surface);
    let surfaces = surfaces.into_par_iter();
    let surfaces: Vec<Stored> = surfaces.filter_map(|v| scan.representative(v)).collect();
    election.elect_in_order(equal(surfaces.into_iter()));
    election.elect_loose(&loose.concat());
    election.elect_in_order(equal(scan.filling().iter().copied()));
    election.seeds
}

/// Candidates of one rank.
fn equal(places: impl Iterator<Item = Stored>) -> Vec<(u32, Stored)> {
    places.map(|place| (0, place)).collect()
}

struct Election<'a> {
    scan: &'a Scan,
    options: &'a SolverOptions,
    seeds: Vec<Stored>,
}

impl Election<'_> {
    fn place_of(&self, point: Stored) -> Local {
        self.scan.quantization().local(point)
    }

    fn priority(&self, point: Stored) -> u64 {
        priority(point, self.options.seed)
    }

    /// The seeds that there are, to be looked up.
    fn grid(&self) -> NeighborGrid {
        let places: Vec<Local> = self.seeds.iter().map(|&seed| self.place_of(seed)).collect();
        NeighborGrid::new(&places, self.options.spacing)
    }

    /// Makes a seed of the candidate of the lowest rank, of equal ones of that of
    /// the highest priority; then of the next of those that are not too near to a
    /// seed, and so on.
    fn elect_in_order(&mut self, mut candidates: Vec<(u32, Stored)>) {
        let radius = ELECTION_RADIUS * self.options.spacing;
        let known = self.grid();
        // Most are covered by what there is already.
        candidates = candidates
            .into_par_iter()
            .with_max_len(AT_ONCE)
            .filter(|&(_, point)| !known.any_within(self.place_of(point), radius))
            .collect();
        candidates.par_sort_unstable_by_key(|&(rank, point)| (rank, self.priority(point), point));
        let places: Vec<Local> = candidates.iter().map(|&(_, p)| self.place_of(p)).collect();
        let grid = NeighborGrid::new(&places, radius);
        let mut is_covered = vec![false; candidates.len()];
        for (number, &(_, candidate)) in candidates.iter().enumerate() {
            if is_covered[number] {
                continue;
            }
            self.seeds.push(candidate);
            let center = places[number];
            grid.visit_around(center, radius, |other, place| {
                is_covered[other as usize] |= (place - center).norm_squared() <= radius * radius;
            });
        }
    }

    /// Where there is no surface the seeds stay, so how even they are is settled
    /// here. They are elected by *fronts*: next to the seeds that there are, from
    /// the `points` just beyond the radius. So most stand at the same distance from
    /// each other. Fronts start from the surfaces and from some points far from
    /// them, and go so many steps at most, so that none comes from far away.
    fn elect_loose(&mut self, points: &[Stored]) {
        let spacing = self.options.spacing;
        let [farthest, covered] = [NUCLEI, LOOSE_RADIUS].map(|r| (r * spacing).powi(2));
        // Squared distance of each point to the nearest seed, as far as it is
        // needed.
        let known = self.grid();
        let brick_of = |&point: &Stored| cell_of(self.place_of(point), BRICK * spacing);
        let mut left: Vec<(u64, Stored, f64)> = points
            .par_chunk_by(|a, b| brick_of(a) == brick_of(b))
            .map_init(Vec::new, |seeds, points| {
                let [low, high] = bounds(points.iter().map(|&point| self.place_of(point)));
                let reach = Local::repeat(NUCLEI * spacing);
                seeds.clear();
                known.visit_box(low - reach, high + reach, |_, seed| seeds.push(seed));
                let with_distance = |&point: &Stored| {
                    let place = self.place_of(point);
                    let squares = seeds.iter().map(|seed| (seed - place).norm_squared());
                    let nearest = squares.fold(f64::INFINITY, f64::min);
                    (self.priority(point), point, nearest)
                };
                let uncovered = points.iter().map(with_distance);
                uncovered
                    .filter(|&(.., squared)| squared >= covered)
                    .collect::<Vec<_>>()
            })
            .flatten_iter()
            .collect();
        left.par_sort_unstable_by_key(|&(priority, point, _)| (priority, point));

        let places: Vec<Local> = left.iter().map(|&(_, p, _)| self.place_of(p)).collect();
        let grid = NeighborGrid::new(&places, spacing);
        let mut nearest: Vec<f64> = left.iter().map(|&(.., squared)| squared).collect();
        let mut admit = |place: usize, nearest: &mut [f64], reach: f64| {
            self.seeds.push(left[place].1);
            let center = places[place];
            grid.visit_around(center, reach * spacing, |other, position| {
                let known = &mut nearest[other as usize];
                *known = known.min((position - center).norm_squared());
            });
        };
        for place in 0..left.len() {
            if nearest[place] >= farthest {
                admit(place, &mut nearest, NUCLEI);
            }
        }
        // From here on nobody asks for what is farther than the widest step.
        let widest = LOOSE_RADIUS + FRONTS.into_iter().fold(0.0, f64::max);
        let mut open: Vec<usize> = (0..left.len()).collect();
        for width in FRONTS.into_iter().chain(std::iter::repeat(f64::INFINITY)) {
            open.retain(|&place| nearest[place] >= covered);
            if open.is_empty() {
                return;
            }
            let limit = ((LOOSE_RADIUS + width) * spacing).powi(2);
            let is_next = |&place: &usize| nearest[place] <= limit;
            let front: Vec<usize> = open.iter().copied().filter(is_next).collect();
            for place in front {
                if nearest[place] >= covered {
                    admit(place, &mut nearest, widest);
                }
            }
        }
    }
}

fn from_points(scan: &Scan, mut identities: Vec<Stored>) -> Seeds {
    identities.sort_unstable();
    identities.dedup();
    Seeds {
        positions: identities
            .iter()
            .map(|&identity| scan.quantization().local(identity))
            .collect(),
        identities,
    }
}

/// Number of elected seeds whose points lie in `part`.
pub(crate) fn elected_in(scan: &Scan, options: &SolverOptions, part: &Rect) -> usize {
    elected(scan, options)
        .into_iter()
        .filter(|&point| part.contains(point))
        .count()
}

/// Each point with the same probability, as many as the run's count asks for.
fn random(scan: &Scan, options: &SolverOptions) -> Vec<Stored> {
    let threshold = (options.seeds_per_point.clamp(0.0, 1.0) * u64::MAX as f64) as u64;
    scan.points()
        .iter()
        .copied()
        .filter(|&point| priority(point, options.seed) <= threshold)
        .collect()
}

/// Section IV-A, made local: each cell owes its area over the hexagon's.
fn area_weighted(scan: &Scan, options: &SolverOptions) -> Seeds {
    let first = from_points(scan, random(scan, options));
    let hexagon = AREA_PER_SEED * options.spacing * options.spacing;
    // Step 1: the cells of the random seeds. Where the scan is sparse they are
    // large: the domain must not be what bounds them.
    let radius = 4.0 * options.spacing;
    let grid = NeighborGrid::new(&first.positions, 2.0 * options.spacing);
    let mut seeds: Vec<(Stored, Local)> = first
        .identities
        .par_iter()
        .zip(&first.positions)
        .enumerate()
        .map_init(Scratch::new, |scratch, (own, (&identity, &site))| {
            let Scratch {
                cell,
                neighbors,
                samples,
                ..
            } = scratch;
            samples.look(scan, site, site, options);
            let Some(fit) = samples.fit(site, options) else {
                return vec![(identity, site)];
            };
            neighbors.clear();
            grid.visit_around(site, 2.5 * radius, |other, position| {
                if other as usize != own {
                    neighbors.push(neighbor(site, other, position));
                }
            });
            Neighbor::sort(neighbors);
            cell.clip(&fit.patch, site, &[radius; BOUNDING_SIDES], neighbors);
            let Some(moments) = cell.moments(&fit.patch, site) else {
                return Vec::new();
            };
            // Step 2: whole seeds, and one more with the odds of the rest.
            let mut dice = Dice(priority(identity, options.seed ^ 0x5eed));
            let owed = moments.area / hexagon;
            let extra = dice.roll() < owed.fract();
            // Step 3: on the patch from the start.
            (0..owed as u64 + u64::from(extra))
                .filter_map(|_| {
                    let place = cell.place(&fit.patch, site, [dice.roll(), dice.roll()])?;
                    let near = scan.has_point_within(place, options.spacing);
                    Some((scan.quantization().stored(place)?, place)).filter(|_| near)
                })
                .collect()
        })
        .flatten_iter()
        .collect();
    seeds.sort_unstable_by_key(|&(identity, _)| identity);
    seeds.dedup_by_key(|&mut (identity, _)| identity);
    let (identities, positions) = seeds.into_iter().unzip();
    Seeds {
        identities,
        positions,
    }
}

/// A stream of numbers in [0, 1) from one hash.
struct Dice(u64);

impl Dice {
    fn roll(&mut self) -> f64 {
        self.0 = spread(self.0);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Quantization;

    /// `n` even points of the unit square, as stored.
    fn sheet(n: u64) -> Vec<Stored> {
        let coordinate = |k: u64| (spread(k) % 1_000_000) as i32;
        (0..n)
            .map(|i| Stored {
                x: coordinate(2 * i),
                y: coordinate(2 * i + 1),
                z: 0,
            })
            .collect()
    }

    fn scan(points: Vec<Stored>, spacing: f64) -> Scan {
        let quantization = Quantization {
            scale: 1e-6,
            offset: [0.0; 3],
        };
        let options = SolverOptions {
            seed: 7,
            ..SolverOptions::new(spacing)
        };
        Scan::as_scanned(points, quantization, &options)
    }

    #[test]
    fn no_two_seeds_are_nearer_than_the_radius_and_every_point_is_covered() {
        let scan = scan(sheet(20_000), 0.03);
        let radius = ELECTION_RADIUS * 0.03;
        let options = SolverOptions {
            seeds: SeedRule::Poisson,
            ..SolverOptions::new(0.03)
        };
        let seeds = elected(&scan, &options);
        let is_near = |a: &Stored, b: &Stored| {
            let place = |s: &Stored| scan.quantization().local(*s);
            (place(a) - place(b)).norm() < radius
        };
        for (i, a) in seeds.iter().enumerate() {
            assert!(seeds[..i].iter().all(|b| !is_near(a, b)));
        }
        let is_covered = |point: &Stored| seeds.iter().any(|seed| is_near(seed, point));
        assert!(scan.points().iter().all(is_covered));
    }

    #[test]
    fn the_election_meets_the_density() {
        let spacing = 0.01;
        let wanted = 1.0 / (AREA_PER_SEED * spacing * spacing);
        let scan = scan(sheet(400_000), spacing);
        for seeds in [SeedRule::Poisson, SeedRule::Hexagonal] {
            let options = SolverOptions {
                seeds,
                ..SolverOptions::new(spacing)
            };
            let ratio = elected(&scan, &options).len() as f64 / wanted;
            assert!((0.98..1.03).contains(&ratio), "{seeds:?}: {ratio}");
        }
    }

    #[test]
    fn an_election_does_not_depend_on_points_far_away() {
        let near = |points: Vec<Stored>, seeds: SeedRule| {
            let options = SolverOptions {
                seeds,
                ..SolverOptions::new(0.02)
            };
            let elected = elected(&scan(points, 0.02), &options);
            let mut near: Vec<Stored> = elected.into_iter().filter(|s| s.x < 300_000).collect();
            near.sort_unstable();
            near
        };
        let all = sheet(50_000);
        let part: Vec<Stored> = all.iter().copied().filter(|p| p.x < 600_000).collect();
        for seeds in [SeedRule::Poisson, SeedRule::Hexagonal] {
            assert_eq!(near(all.clone(), seeds), near(part.clone(), seeds));
        }
    }
}
