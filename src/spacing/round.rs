//! Round spacings, the numbers of points that each would give, and the one to propose for a scan of which nothing
//! is known.
//!
//! Nobody knows beforehand how many sites a spacing gives. Where a scan is much denser than the output, the voxels that its
//! points occupy say so; they are counted for all round spacings in one pass over the points.

use serde::Serialize;

use super::distinct::DistinctCount;
use crate::{
    geometry::{Quantization, Stored, spread},
    tiling::Bounds,
};

/// The leading digits of round spacings.
const ROUND_DIGITS: [u32; 4] = [1, 2, 3, 5];
/// The range of the round spacings that are looked at, below half the extent of a scan.
const MAX_DECADES: i32 = 7;
/// Points of the scan to each point of the output, at least, at a spacing that is proposed for a large scan.
const POINTS_TO_ONE: f64 = 20.0;
/// The least number of points to one that is proposed for a small scan: with fewer, points of the output would lie between
/// those of the scan.
const LEAST_POINTS_TO_ONE: f64 = 4.0;
/// The number of points of the output that a small scan keeps if it can.
const POINTS_OF_A_SMALL_OUTPUT: f64 = 1000.0;
/// The edge of a counted voxel in spacings: that of the double voxels of an election.
const VOXEL_EDGE_IN_SPACINGS: f64 = 0.8;
/// Sites for each occupied double voxel, four fifths of a spacing wide, approximately: 0.49 on planes at all
/// angles, 0.74 on planes along the axes.
const SITES_PER_VOXEL: f64 = 0.58;
/// Round spacings on either side of a given one that are listed beside it.
const LISTED_ON_EITHER_SIDE: usize = 2;

/// Round spacings for a scan, finest first. Lengths are CRS units.
#[derive(Clone, Debug)]
pub(crate) struct RoundSpacings {
    /// The number of points of the scan.
    pub(crate) points: u64,
    /// Half of the longest side of the scan, beyond which no spacing has a meaning.
    widest: f64,
    spacings: Vec<RoundSpacing>,
}

/// A round spacing, and what it gives.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct RoundSpacing {
    /// The spacing (CRS units).
    pub(crate) spacing: f64,
    /// Approximate number of points of the output, by the voxels that the scan occupies. It is within a quarter where
    /// the scan is dense, and too small where the output is as dense as the scan.
    pub(crate) points_out: u64,
}

impl RoundSpacings {
    /// The spacing to propose: the finest one with at least twenty points of the scan to each point of the output. A scan of less
    /// than twenty thousand points is asked for a thousandth of its points to one, but for at least four. Where no
    /// spacing gives so many it is the widest one.
    ///
    /// Returns `None` if the scan has no points.
    pub(crate) fn proposed(&self) -> Option<RoundSpacing> {
        let points = self.points as f64;
        let wanted = self.points_to_one_wanted();
        let below = |round: &&RoundSpacing| round.spacing <= self.widest;
        let mut fitting = self.spacings.iter().filter(below);
        fitting
            .clone()
            .find(|round| points >= wanted * round.points_out as f64)
            .or_else(|| fitting.next_back())
            .copied()
            .or_else(|| self.of_few_points())
    }

    /// The number of points of the scan that each point of the output should have.
    pub(crate) fn points_to_one_wanted(&self) -> f64 {
        (self.points as f64 / POINTS_OF_A_SMALL_OUTPUT).clamp(LEAST_POINTS_TO_ONE, POINTS_TO_ONE)
    }

    /// The spacing for a scan that is so small that no spacing was counted: points at one place take any.
    fn of_few_points(&self) -> Option<RoundSpacing> {
        let spacing = match self.widest > 0.0 {
            true => widest_round_below(self.widest),
            false => 1.0,
        };
        (self.points > 0).then_some(RoundSpacing {
            spacing,
            points_out: self.points,
        })
    }

    /// The round spacings nearest to `spacing`, without itself, finest first. Spacings are left out that would
    /// put points between those of the scan, or that are too wide for it.
    pub(crate) fn beside(&self, spacing: f64) -> Vec<RoundSpacing> {
        let is_near = |other: f64| (other / spacing - 1.0).abs() < 1e-3;
        let is_listed = |round: &&RoundSpacing| {
            let points_out = round.points_out.max(1) as f64;
            let is_carried = self.points as f64 >= LEAST_POINTS_TO_ONE * points_out;
            round.spacing <= self.widest && is_carried && !is_near(round.spacing)
        };
        let listed: Vec<RoundSpacing> = self.spacings.iter().filter(is_listed).copied().collect();
        let next = listed.partition_point(|round| round.spacing < spacing);
        let first = next.saturating_sub(LISTED_ON_EITHER_SIDE);
        let end = (next + LISTED_ON_EITHER_SIDE).min(listed.len());
        listed[first..end].to_vec()
    }
}

/// The widest round number that is at most `length`, which is positive.
fn widest_round_below(length: f64) -> f64 {
    round_numbers_below(length).next().unwrap_or(length)
}

/// The round numbers up to `length`, which is positive, in descending order.
fn round_numbers_below(length: f64) -> impl Iterator<Item = f64> {
    let highest = length.log10().ceil() as i32;
    let of_decade = |exponent: i32| {
        // As a decimal number, so that 0.03 is the number that is written so.
        let number = move |digit| format!("{digit}e{exponent}").parse().unwrap_or(f64::MAX);
        ROUND_DIGITS.into_iter().rev().map(number)
    };
    let decades = (highest - MAX_DECADES..=highest).rev();
    decades.flat_map(of_decade).filter(move |&n| n <= length)
}

/// Counts the voxels that the points of a scan occupy, for all round spacings at once.
#[derive(Clone, Debug)]
pub(crate) struct VoxelCounts {
    /// The scale of the points (CRS units).
    scale: f64,
    points: u64,
    bounds: Bounds,
    levels: Vec<Level>,
}

/// The voxels of one spacing.
#[derive(Clone, Debug)]
struct Level {
    spacing: f64,
    /// Voxels to a stored unit.
    voxels_per_unit: f64,
    voxels: DistinctCount,
}

impl VoxelCounts {
    /// No points yet, of a scan whose longest side is about `extent` (CRS units) on `quantization`. Spacings are
    /// counted between twice the scale and half the extent.
    pub(crate) fn new(quantization: &Quantization, extent: f64) -> Self {
        let scale = quantization.scale;
        let level = |spacing: f64| Level {
            spacing,
            voxels_per_unit: scale / (VOXEL_EDGE_IN_SPACINGS * spacing),
            voxels: DistinctCount::new(),
        };
        let is_long = extent > 0.0 && extent.is_finite();
        let spacings = is_long.then(|| round_numbers_below(0.5 * extent));
        let spacings = spacings.into_iter().flatten();
        let mut levels: Vec<Level> = spacings
            .take_while(|&spacing| spacing >= 2.0 * scale)
            .map(level)
            .collect();
        levels.reverse();
        Self {
            scale,
            points: 0,
            bounds: Bounds::empty(),
            levels,
        }
    }

    /// Adds a point.
    pub(crate) fn add(&mut self, point: Stored) {
        self.points += 1;
        self.bounds.grow(point);
        // From the least coordinate that there can be, so that a conversion to integers rounds down.
        let [x, y, z] =
            [point.x, point.y, point.z].map(|c| (i64::from(c) - i64::from(i32::MIN)) as f64);
        for level in &mut self.levels {
            let [x, y, z] = [x, y, z].map(|c| (c * level.voxels_per_unit) as u64);
            // At most 33 bits each: odd factors keep them apart, and `spread` mixes them.
            let key = x
                .wrapping_mul(0x9e37_79b9_7f4a_7c15)
                .wrapping_add(y.wrapping_mul(0xc2b2_ae3d_27d4_eb4f))
                .wrapping_add(z.wrapping_mul(0x1656_67b1_9e37_79f9));
            level.voxels.add(spread(key));
        }
    }

    /// Adds the points of `other`, which counts the same spacings.
    pub(crate) fn join(&mut self, other: &Self) {
        self.points += other.points;
        self.bounds.join(&other.bounds);
        for (level, other) in self.levels.iter_mut().zip(&other.levels) {
            level.voxels.join(&other.voxels);
        }
    }

    /// What the spacings give.
    pub(crate) fn spacings(&self) -> RoundSpacings {
        let round = |level: &Level| RoundSpacing {
            spacing: level.spacing,
            points_out: (SITES_PER_VOXEL * level.voxels.estimate()).round() as u64,
        };
        RoundSpacings {
            points: self.points,
            widest: match self.points {
                0 => 0.0,
                _ => 0.5 * self.bounds.extent() as f64 * self.scale,
            },
            spacings: self.levels.iter().map(round).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// A square of points `step` stored units apart, `side` to a row.
    fn square(side: i32, step: i32) -> Vec<Stored> {
        let point = |i: i32| Stored {
            x: step * (i % side),
            y: step * (i / side),
            z: 3,
        };
        (0..side * side).map(point).collect()
    }

    fn counted(points: &[Stored], extent: f64) -> VoxelCounts {
        let mut counts = VoxelCounts::new(&QUANTIZATION, extent);
        points.iter().for_each(|&point| counts.add(point));
        counts
    }

    #[test]
    fn round_numbers_are_written_as_people_write_them() {
        let numbers: Vec<String> = round_numbers_below(0.06)
            .take(5)
            .map(|n| n.to_string())
            .collect();
        assert_eq!(numbers, ["0.05", "0.03", "0.02", "0.01", "0.005"]);
        assert_eq!(widest_round_below(1.0), 1.0);
        assert_eq!(widest_round_below(250.0), 200.0);
    }

    #[test]
    fn the_finest_spacing_with_twenty_points_to_one_is_proposed() {
        // A metre to 100 points along each side: at 5 cm there are 25 points to 0.866 h², 22 to one.
        let points = square(600, 10);
        let spacings = counted(&points, 6.0).spacings();
        let proposed = spacings.proposed().unwrap();
        assert_eq!(proposed.spacing, 0.05);
        let plane = 6.0 * 6.0 / (0.866 * 0.05 * 0.05);
        assert!((0.75..1.35).contains(&(proposed.points_out as f64 / plane)));
        let beside: Vec<f64> = spacings.beside(0.05).iter().map(|r| r.spacing).collect();
        assert_eq!(beside, [0.02, 0.03, 0.1, 0.2]);
    }

    #[test]
    fn order_and_division_of_the_points_do_not_show() {
        let mut points = square(500, 7);
        let whole = counted(&points, 10.0).spacings();
        points.reverse();
        let (first, rest) = points.split_at(70_000);
        let mut joined = counted(first, 10.0);
        joined.join(&counted(rest, 10.0));
        assert_eq!(joined.spacings().spacings, whole.spacings);
        assert_eq!(joined.spacings().proposed(), whole.proposed());
    }

    #[test]
    fn few_points_have_a_spacing_too() {
        let one = counted(&square(1, 10), 5.0).spacings();
        assert_eq!(one.proposed().unwrap().spacing, 1.0);
        // Nine points on a square of 2 m: whatever is proposed is at most half of it.
        let nine = counted(&square(3, 1000), 2.0).spacings();
        let spacing = nine.proposed().unwrap().spacing;
        assert!(spacing <= 1.0, "{spacing}");
        // Bounds that are too wide by far do not make it wider.
        let claimed = counted(&square(3, 1000), 1e6).spacings();
        assert!(claimed.proposed().unwrap().spacing <= 1.0);
        // Four points two steps of the scale apart.
        let tiny = counted(&square(2, 2), 0.002).spacings();
        assert_eq!(tiny.proposed().unwrap().spacing, 0.001);
        assert!(counted(&[], 5.0).spacings().proposed().is_none());
    }
}
