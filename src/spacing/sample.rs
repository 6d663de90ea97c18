//! A sample of the parts of a cloud, by which sites are counted.
//!
//! The cloud is cut into parts small enough for any memory budget. Parts are drawn by systematic sampling
//! with inclusion probabilities proportional to the voxels that their points occupy, because few sparse
//! parts far from the scanner can carry most of the sites. Counts are weighted by the inverse of the
//! inclusion probability (Horvitz and Thompson, *A generalization of sampling without replacement from a
//! finite universe*, 1952).

use rayon::prelude::*;

use crate::{
    geometry::{OccupiedCells, Quantization, Stored},
    lloyd::{Scan, SolverOptions, Thinning, elected_in},
    tiling::{CountedCloud, Plan, PlanOptions, Square, Tile},
};

/// Approximate number of seeds in a part: the part sees a third of them again around itself.
const SEEDS_PER_PART: f64 = 1_500.0;
/// The least and the largest number of points in a part.
const POINTS_PER_PART: [f64; 2] = [22_500.0, 1_000_000.0];
/// Points of a square count as far as they are this many times what a scan keeps of a plane. Were all counted,
/// the parts of a very dense cloud would be narrower than what they see around them, and each would read what
/// all others do.
const MOST_COUNTED_IN_KEPT: f64 = 8.0;
/// Points of a part beyond which they are thinned while they are gathered.
const PART_THINNING_LIMIT: u64 = 500_000;
/// Points of all parts that are in memory at a time: four parts that are thinned.
const POINTS_IN_MEMORY: u64 = 4 * PART_THINNING_LIMIT;
/// Parts whose voxels are counted even if their points are more than the caller's limit.
const MIN_COUNTED_PARTS: usize = 24;
/// What a part sees around it, in spacings of the first guess. It serves a count, not seeds that others
/// agree with: with 3 the count of three scans came out within 0.3 % of that with 2.
const PART_HALO_IN_SPACINGS: f64 = 2.0;

/// A part that was drawn, and the probability with which it was.
#[derive(Clone, Copy, Debug)]
pub(super) struct DrawnPart {
    index: usize,
    inclusion_probability: f64,
}

/// How many parts are drawn: approximately `parts`, or the `share` of all parts if that is more.
#[derive(Clone, Copy, Debug)]
pub(super) struct SampleSize {
    pub(super) parts: f64,
    pub(super) share: f64,
}

/// Seeds and voxels of parts that were drawn, each part weighted by the inverse of its inclusion
/// probability.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WeightedCounts {
    seeds: f64,
    voxels: f64,
}

impl WeightedCounts {
    /// The counts of both samples together.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            seeds: self.seeds + other.seeds,
            voxels: self.voxels + other.voxels,
        }
    }
}

/// The parts of a cloud, the same whatever memory and threads there are.
pub(super) struct Parts<'a, C> {
    cloud: &'a C,
    quantization: &'a Quantization,
    halo: i64,
    /// Parts, each with the number of voxels that its points occupy.
    parts: Vec<(Tile, u64)>,
    /// Points of the cloud for each point of the parts.
    points_per_counted_point: f64,
}

impl<'a, C: CountedCloud> Parts<'a, C> {
    /// Cuts `cloud` into parts for `options`, and takes every n-th, such that these contain approximately
    /// `max_points` points. Their voxels are not counted: parts count alike.
    pub(super) fn cut(
        cloud: &'a C,
        quantization: &'a Quantization,
        options: &SolverOptions,
        max_points: u64,
    ) -> Self {
        let halo = quantization.units(PART_HALO_IN_SPACINGS * options.spacing);
        let [least, most] = POINTS_PER_PART;
        let plan = PlanOptions {
            halo,
            margin: quantization.units(options.farthest_seed()),
            tile_edge: None,
            most_cost: (SEEDS_PER_PART / options.seeds_per_point).clamp(least, most) as u64,
        };
        let edge = cloud.square_edge();
        let width = edge as f64 * quantization.scale;
        let kept = Thinning::new(quantization, options).most_on_square(width);
        let most = (MOST_COUNTED_IN_KEPT * kept).ceil() as u64;
        let squares = cloud.squares().map(|(index, points)| Square {
            index,
            points,
            cost: points.min(most),
        });
        let tiles = Plan::make(&squares.collect::<Vec<_>>(), edge, &plan).tiles;
        let step = cloud.points().div_ceil(max_points) as usize;
        let step = step.min(tiles.len() / MIN_COUNTED_PARTS).max(1);
        let parts: Vec<(Tile, u64)> = tiles.into_iter().step_by(step).map(|t| (t, 1)).collect();
        let points: u64 = parts.iter().map(|(tile, _)| tile.points_core).sum();
        Self {
            cloud,
            quantization,
            halo,
            parts,
            points_per_counted_point: cloud.points() as f64 / points.max(1) as f64,
        }
    }

    /// Counts the double voxels that the points of each part occupy.
    pub(super) fn count_voxels(&mut self, options: &SolverOptions) -> Result<(), C::Error> {
        let tiles: Vec<Tile> = self.parts.iter().map(|part| part.0).collect();
        let thinning = Thinning::new(self.quantization, options);
        let voxels = by_tile(&tiles, |tile| {
            let points =
                self.cloud
                    .gather(&tile.core, self.quantization, options, PART_THINNING_LIMIT)?;
            let voxel = |&point: &Stored| thinning.double_voxel_of(point);
            Ok(OccupiedCells::sort(&points.kept, voxel).0.len() as u64)
        })?;
        self.parts = tiles.into_iter().zip(voxels).collect();
        Ok(())
    }

    /// Whether a sample of `size` is all parts, so that no part's voxels matter.
    pub(super) fn are_all_drawn(&self, size: SampleSize) -> bool {
        self.parts.len() as f64 <= size.parts
    }

    /// The number of sites of the cloud, if there are `sites_per_voxel` for each voxel that its points occupy.
    pub(super) fn sites(&self, sites_per_voxel: f64) -> f64 {
        let voxels: f64 = self.parts.iter().map(|&(_, voxels)| voxels as f64).sum();
        sites_per_voxel * voxels * self.points_per_counted_point
    }

    /// Elects seeds in the `drawn` parts.
    pub(super) fn elect(
        &self,
        drawn: &[DrawnPart],
        options: &SolverOptions,
    ) -> Result<WeightedCounts, C::Error> {
        let tiles: Vec<Tile> = drawn.iter().map(|part| self.parts[part.index].0).collect();
        let elected = by_tile(&tiles, |tile| {
            let seen = tile.core.grown(self.halo);
            let mut points =
                self.cloud
                    .gather(&seen, self.quantization, options, PART_THINNING_LIMIT)?;
            self.cloud.complete(&mut points, self.quantization, options);
            let scan = Scan::prepared(points, *self.quantization, options);
            Ok(elected_in(&scan, options, &tile.core) as u64)
        })?;
        let weighted = |(part, seeds): (&DrawnPart, u64)| WeightedCounts {
            seeds: seeds as f64 / part.inclusion_probability,
            voxels: self.parts[part.index].1 as f64 / part.inclusion_probability,
        };
        let counts = drawn.iter().zip(elected).map(weighted);
        Ok(counts.fold(WeightedCounts::default(), WeightedCounts::and))
    }

    /// Estimated number of seeds of the cloud, by the ratio of seeds to voxels in the sample.
    pub(super) fn seeds(&self, sample: WeightedCounts) -> f64 {
        self.sites(sample.seeds / f64::max(sample.voxels, 1.0))
    }

    /// Draws parts, evenly over the cloud, by systematic sampling with probability proportional to their
    /// voxels.
    pub(super) fn draw(&self, size: SampleSize) -> Vec<DrawnPart> {
        let wanted = size.parts.max(size.share * self.parts.len() as f64);
        let probabilities = |factor: f64| {
            let parts = self.parts.iter();
            parts.map(move |&(_, voxels)| (factor * voxels as f64).min(1.0))
        };
        // Bisection for the factor with which the probabilities sum up to the size of the sample.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if probabilities(middle).sum::<f64>() < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        // A part is drawn where the running sum of the probabilities passes a whole number.
        let mut sum = 0.5;
        let mut is_drawn = |probability: f64| {
            let before = f64::floor(sum);
            sum += probability;
            sum.floor() > before
        };
        (0..)
            .zip(probabilities(high))
            .filter(|&(_, probability)| is_drawn(probability))
            .map(|(index, inclusion_probability)| DrawnPart {
                index,
                inclusion_probability,
            })
            .collect()
    }
}

/// The results of `work` for all `tiles`, in their order. Tiles are worked on in parallel, as many at a time
/// as have no more than [`POINTS_IN_MEMORY`] points together once they are thinned.
fn by_tile<E: Send>(
    tiles: &[Tile],
    work: impl Fn(&Tile) -> Result<u64, E> + Sync,
) -> Result<Vec<u64>, E> {
    let most = tiles.iter().map(|tile| tile.points_seen).max().unwrap_or(0);
    let at_a_time = (POINTS_IN_MEMORY / most.clamp(1, PART_THINNING_LIMIT)) as usize;
    let mut results = Vec::with_capacity(tiles.len());
    for tiles in tiles.chunks(at_a_time) {
        let part: Result<Vec<u64>, E> = tiles.par_iter().with_max_len(1).map(&work).collect();
        results.extend(part?);
    }
    Ok(results)
}
