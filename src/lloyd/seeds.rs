//! Where the sites start: seeds elected from the scan by a local rule.
//!
//! Every seed has an *identity* that does not depend on tiles: coordinates as
//! stored, unique, of the point it was elected at. Two tiles that see a place
//! elect the same seeds there, with the same identities; the stitcher joins
//! tiles by them.
//!
//! * [`SeedRule::Poisson`]: a point is a seed unless one of higher priority
//!   within the radius is (dart throwing, with the darts' order a hash). Rounds
//!   over the points that no seed covers yet end with all of them covered.
//! * [`SeedRule::Area`]: the paper's section IV-A: random seeds, then as many
//!   in each one's cell as its area owes.
//! * [`SeedRule::Random`]: the paper's baseline.

use std::{
    collections::HashMap,
    hash::{BuildHasherDefault, Hasher},
};

use rayon::prelude::*;

use super::{
    Options, Scan,
    scan::priority,
    step::{Neighborhoods, local_patch},
};
use crate::geometry::{Cell, CellIndex, Local, Rect, Stored, cell_of, spread};

/// Radius of the Poisson-disk election, in spacings.
///
/// Random sequential addition of discs of diameter `r` jams at a covered share
/// of 0.547 (Feder, *Random sequential adsorption*, 1980), which is 0.697 / r²
/// seeds to the unit of area; the hexagonal lattice of spacing h has
/// 2 / (√3 h²). They would agree at r = 0.777 h; a scan of some thirty points
/// to the seed has no point in the last gaps, and agrees at 0.745 h (measured
/// on a sheet, see the test `the_election_meets_the_density`).
pub const ELECTION_RADIUS: f64 = 0.745;

/// Area that one seed owes, in squared spacings: √3/2, the hexagon's.
pub const AREA_PER_SEED: f64 = 0.866_025_403_784_438_6;

/// Rounds of the election after the first. Three leave less than one point in
/// ten thousand uncovered, which lies in a corner between voxels.
const ROUNDS: usize = 4;

/// How seeds are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SeedRule {
    /// Poisson-disk election.
    #[default]
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
pub fn elect(scan: &Scan, options: &Options) -> Seeds {
    let radius = ELECTION_RADIUS * options.spacing;
    match options.seeds {
        SeedRule::Poisson => from_points(scan, poisson(scan, radius, options.seed)),
        SeedRule::Random => from_points(scan, random(scan, options)),
        SeedRule::Area => area_weighted(scan, options),
    }
}

fn from_points(scan: &Scan, mut identities: Vec<Stored>) -> Seeds {
    identities.sort_unstable();
    identities.dedup();
    Seeds {
        positions: identities
            .iter()
            .map(|&identity| scan.lattice().local(identity))
            .collect(),
        identities,
    }
}

/// Poisson-disk election with discs of `radius` (CRS units).
fn poisson(scan: &Scan, radius: f64, seed: u64) -> Vec<Stored> {
    let mut elected = Elected::new(scan.lattice().scale, radius);
    for round in 0..=ROUNDS {
        // Candidates: of each voxel the first point that is not covered.
        let mut candidates = scan.map_voxels(|points| {
            let first = if round == 0 {
                points.first()
            } else {
                points.iter().find(|&&point| !elected.covers(point))
            };
            first.map(|&point| (priority(point, seed), point))
        });
        if candidates.is_empty() {
            break;
        }
        candidates.par_sort_unstable();
        for (_, point) in candidates {
            if !elected.covers(point) {
                elected.add(point);
            }
        }
    }
    elected.seeds
}

/// Number of Poisson-disk seeds at `spacing` (CRS units) whose points lie in
/// `part`.
pub fn elected_in(scan: &Scan, spacing: f64, seed: u64, part: &Rect) -> usize {
    poisson(scan, ELECTION_RADIUS * spacing, seed)
        .into_iter()
        .filter(|&point| part.contains(point))
        .count()
}

/// Each point with the same probability, as many as the run's count asks for.
fn random(scan: &Scan, options: &Options) -> Vec<Stored> {
    let threshold = (options.seeds_per_point.clamp(0.0, 1.0) * u64::MAX as f64) as u64;
    scan.points()
        .iter()
        .copied()
        .filter(|&point| priority(point, options.seed) <= threshold)
        .collect()
}

/// Section IV-A, made local: each cell owes its area over the hexagon's.
fn area_weighted(scan: &Scan, options: &Options) -> Seeds {
    let first = from_points(scan, random(scan, options));
    let hexagon = AREA_PER_SEED * options.spacing * options.spacing;
    // Step 1: the cells of the random seeds. Where the scan is sparse they are
    // large: the domain must not be what bounds them.
    let radius = 4.0 * options.spacing;
    let neighborhoods = Neighborhoods::new(&first.positions, options.spacing);
    let mut seeds: Vec<(Stored, Local)> = first
        .identities
        .par_iter()
        .zip(&first.positions)
        .map_init(
            || (Cell::new(), Vec::new(), Vec::new()),
            |(cell, samples, neighbors), (&identity, &site)| {
                let Some(fit) = local_patch(scan, site, options, samples) else {
                    return vec![(identity, site)];
                };
                neighborhoods.gather(site, 2.5 * radius, neighbors);
                cell.clip(&fit.patch, site, radius, neighbors);
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
                        Some((scan.lattice().stored(place)?, place)).filter(|_| near)
                    })
                    .collect()
            },
        )
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

/// The seeds so far, by cells of the election's radius.
struct Elected {
    scale: f64,
    radius: f64,
    radius_squared: f64,
    seeds: Vec<Stored>,
    places: Vec<Local>,
    /// The last seed of each cell.
    last: HashMap<CellIndex, u32, BuildHasherDefault<CellHasher>>,
    /// For each seed the one before it in its cell.
    previous: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Elected {
    fn new(scale: f64, radius: f64) -> Self {
        Self {
            scale,
            radius,
            radius_squared: radius * radius,
            seeds: Vec::new(),
            places: Vec::new(),
            last: HashMap::default(),
            previous: Vec::new(),
        }
    }

    fn place(&self, point: Stored) -> Local {
        Local::new(point.x.into(), point.y.into(), point.z.into()) * self.scale
    }

    fn covers(&self, point: Stored) -> bool {
        let place = self.place(point);
        let reach = Local::repeat(self.radius);
        let low = cell_of(place - reach, self.radius);
        let high = cell_of(place + reach, self.radius);
        (low[2]..=high[2]).any(|z| {
            (low[1]..=high[1]).any(|y| {
                (low[0]..=high[0]).any(|x| {
                    let mut seed = self.last.get(&[x, y, z]).copied().unwrap_or(NONE);
                    while seed != NONE {
                        let other = self.places[seed as usize];
                        if (other - place).norm_squared() < self.radius_squared {
                            return true;
                        }
                        seed = self.previous[seed as usize];
                    }
                    false
                })
            })
        })
    }

    fn add(&mut self, point: Stored) {
        let place = self.place(point);
        let index = u32::try_from(self.seeds.len()).expect("fewer seeds than points");
        let before = self.last.insert(cell_of(place, self.radius), index);
        self.previous.push(before.unwrap_or(NONE));
        self.seeds.push(point);
        self.places.push(place);
    }
}

/// The default hasher guards against attackers, at three times the cost of the
/// election; cells of a scan are no attack that [`spread`] would not survive.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.0 = spread(self.0 ^ u64::from_le_bytes(word));
        }
    }
    fn write_usize(&mut self, _: usize) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Lattice;

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
        let lattice = Lattice {
            scale: 1e-6,
            offset: [0.0; 3],
        };
        Scan::new(points, lattice, spacing, 1.2 * spacing, 7)
    }

    #[test]
    fn no_two_seeds_are_nearer_than_the_radius_and_every_point_is_covered() {
        let scan = scan(sheet(60_000), 0.02);
        let radius = ELECTION_RADIUS * 0.02;
        let seeds = poisson(&scan, radius, 7);
        let mut elected = Elected::new(1e-6, radius);
        for &seed in &seeds {
            assert!(!elected.covers(seed));
            elected.add(seed);
        }
        let uncovered = scan.points().iter().filter(|&&p| !elected.covers(p));
        assert!(uncovered.count() <= 6);
    }

    #[test]
    fn the_election_meets_the_density() {
        let spacing = 0.01;
        let seeds = poisson(&scan(sheet(400_000), spacing), ELECTION_RADIUS * spacing, 7);
        let wanted = 1.0 / (AREA_PER_SEED * spacing * spacing);
        let ratio = seeds.len() as f64 / wanted;
        assert!((0.98..1.02).contains(&ratio), "{ratio}");
    }

    #[test]
    fn an_election_does_not_depend_on_points_far_away() {
        let near = |seeds: Vec<Stored>| {
            let mut near: Vec<Stored> = seeds.into_iter().filter(|s| s.x < 300_000).collect();
            near.sort_unstable();
            near
        };
        let all = sheet(50_000);
        let part: Vec<Stored> = all.iter().copied().filter(|p| p.x < 600_000).collect();
        let radius = ELECTION_RADIUS * 0.02;
        assert_eq!(
            near(poisson(&scan(all, 0.02), radius, 7)),
            near(poisson(&scan(part, 0.02), radius, 7))
        );
    }
}
