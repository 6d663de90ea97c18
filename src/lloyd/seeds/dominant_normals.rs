//! The directions that many planes of a cloud face: the walls of its streets, the sides of its houses.
//!
//! A lattice of seeds follows from a normal that is rounded to one of a few directions, so that all of a wall has one
//! lattice. But across most walls those few stand askew, and the rows are stretched; with more of them noise would decide
//! between two from place to place. So the directions that many normals of the whole cloud share are found once,
//! before any tile is solved, and have lattices of their own.

use std::cmp::Reverse;

use serde::{Deserialize, Serialize};

use super::rounded_normal::RoundedNormal;
use crate::geometry::Local;

/// The most directions that are found.
const MOST_NORMALS: usize = 16;

/// The cosine of 1.5°: normals with a smaller angle between them face one way.
const ALIKE: f64 = 0.999_657;
/// The cosine of 6°: planes whose normal is as near to a dominant one have its lattice. Rows are stretched by half a
/// percent there.
const OF_ONE_LATTICE: f64 = 0.994_522;

/// The least share of all normals that face a dominant direction.
const LEAST_SHARE: f64 = 0.015;
/// The least number of normals that face a dominant direction.
const FEWEST_NORMALS: f64 = 50.0;
/// The least share that they have of the normals with the same lattice: on a curved surface normals are spread evenly.
const LEAST_SHARE_OF_LATTICE: f64 = 0.4;
/// Planes that are tilted by less than 4° (one less its cosine) against one of the few lattices have that one.
const LEAST_TILT: f64 = 0.002_436;

/// Normals over their largest component are rounded to steps of one over this, half a degree.
const STEPS: f64 = 120.0;
/// So many bins, those with the largest counts, may be dominant.
const CANDIDATES: usize = 256;

/// A normal over its largest component, in steps.
type Steps = [i8; 3];

/// The directions that many normals of a cloud share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DominantNormals {
    count: u8,
    normals: [Steps; MOST_NORMALS],
}

/// Normals that are rounded to the same steps.
struct Bin {
    count: u32,
    steps: Steps,
    normal: Local,
}

impl DominantNormals {
    /// The directions that many of `normals`, unit vectors of either sign, share. Their order does not matter.
    pub(crate) fn among(normals: impl Iterator<Item = Local>) -> Self {
        let mut bins = bins(normals);
        let all: u32 = bins.iter().map(|bin| bin.count).sum();
        let least = FEWEST_NORMALS.max(LEAST_SHARE * f64::from(all));
        let mut found = Self::default();
        while usize::from(found.count) < MOST_NORMALS {
            let Some(normal) = next_dominant(&bins, least) else {
                break;
            };
            let few = RoundedNormal::of(normal);
            if 1.0 - few.unit.dot(&normal).abs() > LEAST_TILT {
                found.normals[usize::from(found.count)] = rounded(normal);
                found.count += 1;
            }
            bins.retain(|bin| bin.normal.dot(&normal).abs() < OF_ONE_LATTICE);
        }
        found
    }

    /// The dominant direction nearest to `normal`, a unit vector, if the two may have one lattice: its components over the
    /// largest, in steps.
    pub(super) fn nearest(&self, normal: Local) -> Option<Steps> {
        let known = self.normals[..usize::from(self.count)].iter();
        let with_cosine = known.map(|&steps| (unit(steps).dot(&normal).abs(), steps));
        let near = with_cosine.filter(|&(cosine, _)| cosine >= OF_ONE_LATTICE);
        let nearest = near.max_by(|a, b| a.0.total_cmp(&b.0));
        nearest.map(|(_, steps)| steps)
    }
}

/// The direction of the most normals that face one way, if they are at least `least` and stand out among those around.
fn next_dominant(bins: &[Bin], least: f64) -> Option<Local> {
    let count = |normal, cosine| {
        around(bins, normal, cosine)
            .map(|near| near.count)
            .sum::<u32>()
    };
    let candidates = bins[..bins.len().min(CANDIDATES)].iter();
    let counted = candidates.map(|bin| (count(bin.normal, ALIKE), bin));
    let is_dominant = |&(alike, bin): &(u32, &Bin)| {
        let of_lattice = f64::from(count(bin.normal, OF_ONE_LATTICE));
        f64::from(alike) >= f64::max(least, LEAST_SHARE_OF_LATTICE * of_lattice)
    };
    let dominant = counted.filter(is_dominant);
    let (_, bin) = dominant.max_by_key(|&(alike, bin)| (alike, bin.steps))?;
    let signed = |near: &Bin| {
        let sign = near.normal.dot(&bin.normal).signum();
        near.normal * (sign * f64::from(near.count))
    };
    let alike = around(bins, bin.normal, ALIKE);
    Some(alike.map(signed).sum::<Local>().normalize())
}

/// The `bins` whose angle to `normal` has at least this `cosine`.
fn around(bins: &[Bin], normal: Local, cosine: f64) -> impl Iterator<Item = &Bin> {
    bins.iter()
        .filter(move |bin| bin.normal.dot(&normal).abs() >= cosine)
}

/// The `normals` by their steps, those of the largest count first.
fn bins(normals: impl Iterator<Item = Local>) -> Vec<Bin> {
    let mut all: Vec<Steps> = normals.map(rounded).collect();
    all.sort_unstable();
    let equal = all.chunk_by(|a, b| a == b);
    let mut bins: Vec<Bin> = equal
        .map(|equal| Bin {
            count: equal.len() as u32,
            steps: equal[0],
            normal: unit(equal[0]),
        })
        .collect();
    bins.sort_by_key(|bin| (Reverse(bin.count), bin.steps));
    bins
}

/// `normal` over its largest component, in steps; the same for the opposite direction.
fn rounded(normal: Local) -> Steps {
    let scaled = normal / normal[normal.iamax()];
    scaled.map(|c| (c * STEPS).round() as i8).into()
}

/// The unit vector in the direction of `steps`.
pub(super) fn unit(steps: Steps) -> Local {
    Local::from(steps.map(f64::from)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    /// A number in [-1, 1).
    fn random(k: u64) -> f64 {
        (spread(k) % 2_000_000) as f64 * 1e-6 - 1.0
    }

    /// Unit vectors near to `direction`: within `noise` of it on each axis.
    fn near(direction: Local, noise: f64, count: u64) -> impl Iterator<Item = Local> {
        let moved = move |i: u64| {
            let noise = [0, 1, 2].map(|axis| noise * random(3 * i + axis));
            (direction.normalize() + Local::from(noise)).normalize()
        };
        (0..count).map(moved)
    }

    /// Unit vectors in all directions.
    fn everywhere(count: u64) -> impl Iterator<Item = Local> {
        let vector = |i: u64| Local::from([0, 1, 2].map(|axis| random(7 * i + axis)));
        let in_ball = (0..count).map(vector).filter(|v| v.norm() < 1.0);
        in_ball.map(|v| v.normalize())
    }

    fn angle(a: Local, b: Local) -> f64 {
        a.normalize().dot(&b.normalize()).abs().acos().to_degrees()
    }

    #[test]
    fn walls_and_roofs_are_dominant_and_the_road_has_the_lattice_that_it_had() {
        let [along, across, roof, road] = [
            Local::new(0.94, 0.34, 0.0),
            Local::new(-0.34, 0.94, 0.0),
            Local::new(0.28, 0.15, 1.0),
            Local::new(0.02, 0.0, 1.0),
        ];
        let normals: Vec<Local> = near(along, 0.01, 900)
            .chain(near(-across, 0.01, 700))
            .chain(near(across, 0.01, 300))
            .chain(near(roof, 0.01, 400))
            .chain(near(road, 0.01, 5000))
            .chain(everywhere(4000))
            .collect();
        let found = DominantNormals::among(normals.iter().copied());
        assert_eq!(found.count, 3);
        for wall in [along, across, roof] {
            for turned in [wall, -wall] {
                let nearest = found.nearest(turned.normalize()).unwrap();
                assert!(angle(unit(nearest), wall) < 0.5, "{nearest:?}");
            }
        }
        assert_eq!(found.nearest(road.normalize()), None);
        assert_eq!(found.nearest(Local::new(0.8, 0.6, 0.0)), None);
        let backwards = DominantNormals::among(normals.iter().rev().copied());
        assert_eq!(found, backwards);
    }

    #[test]
    fn curved_surfaces_and_few_normals_have_no_dominant_ones() {
        assert_eq!(DominantNormals::among(everywhere(20_000)).count, 0);
        let of_tube = |i: u64| Local::new(random(i), random(i + 1), 0.1 * random(i + 2));
        let of_tube = (0..20_000).map(|i| of_tube(3 * i).normalize());
        assert_eq!(DominantNormals::among(of_tube).count, 0);
        let wall = Local::new(0.94, 0.34, 0.0);
        assert_eq!(DominantNormals::among(near(wall, 0.01, 40)).count, 0);
        assert_eq!(DominantNormals::among(near(wall, 0.01, 60)).count, 1);
        assert_eq!(DominantNormals::among(std::iter::empty()).count, 0);
    }

    #[test]
    fn no_more_directions_are_found_than_have_room() {
        let wall = |i: u32| {
            let (sin, cos) = (f64::from(7 * i) + 5.0).to_radians().sin_cos();
            Local::new(cos, sin, 0.0)
        };
        let walls = (0..26).flat_map(|i| near(wall(i), 0.005, 200));
        assert_eq!(
            usize::from(DominantNormals::among(walls).count),
            MOST_NORMALS
        );
    }
}
