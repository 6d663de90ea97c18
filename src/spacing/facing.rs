//! The directions that the planes of a cloud face, from a sample of it.
//!
//! The sample must be the same whatever memory there is, since all seeds depend on it. Estimates of a count do not do, as they
//! depend a little on how far points were thinned when they came. So small blocks are drawn from those that are occupied, by
//! a hash of their place, and what counts are means of voxels that are seen as a whole.

use rayon::prelude::*;

use crate::{
    geometry::{Local, Quantization, Rect, spread},
    lloyd::{DominantNormals, SeedRule, SolverOptions, coarse_normals},
    tiling::CountedCloud,
};

/// Edge of a block.
const BLOCK_IN_SPACINGS: f64 = 8.0;
/// The usual number of blocks that are drawn.
const BLOCKS: usize = 64;
/// The share of all blocks that is drawn where that is more.
const SHARE: f64 = 0.01;
/// The largest share of all blocks that is drawn, so that a small cloud is not read twice.
const LARGEST_SHARE: f64 = 0.125;
/// Fewer blocks say nothing, however few there are.
const FEWEST_BLOCKS: usize = 8;
/// Points of a block beyond which they are thinned while they are gathered.
const BLOCK_THINNING_LIMIT: u64 = 500_000;
/// Blocks whose points are in memory at a time.
const BLOCKS_IN_MEMORY: usize = 4;

/// The directions that many planes of `cloud` face, at the scale of `options`; none where seeds do not stand on lattices.
///
/// # Errors
///
/// If a part of the cloud cannot be gathered.
pub(crate) fn dominant_normals<C: CountedCloud>(
    cloud: &C,
    quantization: &Quantization,
    options: &SolverOptions,
) -> Result<DominantNormals, C::Error> {
    if options.seeds != SeedRule::Hexagonal || options.grading.is_some() {
        return Ok(DominantNormals::default());
    }
    let edge = quantization.units(BLOCK_IN_SPACINGS * options.spacing);
    // At least a double voxel, however fine the spacing is.
    let margin = quantization.units(options.spacing) + 2;
    let normals_of = |block: &[i64; 2]| {
        let min = block.map(|index| index * edge);
        let max = min.map(|c| c + edge);
        let core = Rect { min, max };
        let seen = core.grown(margin);
        let points = cloud.gather(&seen, quantization, options, BLOCK_THINNING_LIMIT)?;
        Ok(coarse_normals(&points, &core, quantization, options))
    };
    let mut normals: Vec<Local> = Vec::new();
    for blocks in drawn(cloud, edge).chunks(BLOCKS_IN_MEMORY) {
        let of_blocks: Result<Vec<_>, _> =
            blocks.par_iter().with_max_len(1).map(normals_of).collect();
        normals.extend(of_blocks?.into_iter().flatten());
    }
    Ok(DominantNormals::among(normals.into_iter()))
}

/// A sample of the blocks with this `edge` (stored units) in which occupied squares of `cloud` begin.
fn drawn(cloud: &impl CountedCloud, edge: i64) -> Vec<[i64; 2]> {
    let square = cloud.square_edge();
    let occupied = cloud.squares().map(|(index, _)| {
        let block = index.map(|index| (index * square).div_euclid(edge));
        (hash(block), block)
    });
    let mut blocks: Vec<(u64, [i64; 2])> = occupied.collect();
    blocks.par_sort_unstable();
    blocks.dedup();
    let share = |share: f64| (share * blocks.len() as f64) as usize;
    let most = share(LARGEST_SHARE).max(FEWEST_BLOCKS);
    blocks.truncate(BLOCKS.max(share(SHARE)).min(most));
    blocks.into_iter().map(|(_, block)| block).collect()
}

/// A hash of a block.
fn hash([column, row]: [i64; 2]) -> u64 {
    spread(spread(column as u64) ^ row as u64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        geometry::{CellIndex, Stored},
        lloyd::{PointSum, ThinnedPoints, Thinning},
        tiling::{Bounds, CellGrid, CloudInMemory},
    };

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.001,
        offset: [0.0; 3],
    };

    /// A cloud of which points and sums are left, whose squares have the counts of all points.
    struct Thinned<C> {
        all: C,
        left: ThinnedPoints,
    }

    impl<C: CountedCloud> CountedCloud for Thinned<C> {
        type Error = C::Error;

        fn points(&self) -> u64 {
            self.all.points()
        }

        fn bounds(&self) -> Bounds {
            self.all.bounds()
        }

        fn square_edge(&self) -> i64 {
            self.all.square_edge()
        }

        fn squares(&self) -> impl Iterator<Item = ([i64; 2], u64)> + '_ {
            self.all.squares()
        }

        fn cells(
            &self,
            rect: &Rect,
            cell_of: impl Fn(Stored) -> CellIndex + Sync,
        ) -> Result<Vec<CellIndex>, C::Error> {
            self.all.cells(rect, cell_of)
        }

        fn gather(
            &self,
            rect: &Rect,
            _: &Quantization,
            _: &SolverOptions,
            _: u64,
        ) -> Result<ThinnedPoints, C::Error> {
            let kept = self.left.kept.iter().copied();
            let sums = self.left.sums.iter().copied();
            Ok(ThinnedPoints {
                kept: kept.filter(|&point| rect.contains(point)).collect(),
                sums: sums
                    .filter(|sum: &PointSum| rect.contains(sum.mean()))
                    .collect(),
                ..ThinnedPoints::default()
            })
        }
    }

    /// Ground of 18 m by 24 m, and walls of 6 m that stand on it over lines in the direction (1, 2).
    fn points() -> Vec<Stored> {
        let random = |k: u64, below: u64| (spread(k) % below) as i32;
        let on_ground = |i: u64| Stored {
            x: random(3 * i, 18_000),
            y: random(3 * i + 1, 24_000),
            z: 0,
        };
        let on_wall = |i: u64| {
            let along = random(3 * i, 10_000);
            Stored {
                x: along + 2000 * (i % 3) as i32,
                y: 2 * along,
                z: random(3 * i + 1, 6000),
            }
        };
        let on_ground = (0..100_000).map(on_ground);
        on_ground.chain((100_000..300_000).map(on_wall)).collect()
    }

    #[test]
    fn the_directions_of_walls_do_not_depend_on_how_far_points_are_thinned() {
        let points = points();
        let go_on = || Ok::<(), ()>(());
        for spacing in [0.2, 0.3, 0.4] {
            let options = SolverOptions::new(spacing);
            let cloud = CloudInMemory::new(&points, CellGrid::new(1000), &go_on);
            let of_all = dominant_normals(&cloud, &QUANTIZATION, &options).unwrap();
            let thinning = Thinning::new(&QUANTIZATION, &options);
            let left = thinning.thinned(points.clone().into());
            assert!(left.sums.len() > 1000, "{} sums", left.sums.len());
            let thinned = Thinned { all: cloud, left };
            let of_thinned = dominant_normals(&thinned, &QUANTIZATION, &options).unwrap();
            assert_ne!(of_all, DominantNormals::default());
            assert_eq!(of_all, of_thinned);
        }
    }

    #[test]
    fn no_more_blocks_are_drawn_than_are_wanted() {
        let points = points();
        let go_on = || Ok::<(), ()>(());
        let cloud = CloudInMemory::new(&points, CellGrid::new(1000), &go_on);
        // All but a few of the squares have points.
        let a_hundredth = 18 * 24 * 8 * 8 / 100;
        let fine = drawn(&cloud, 100).len();
        assert!((a_hundredth - 10..=a_hundredth).contains(&fine), "{fine}");
        assert_eq!(drawn(&cloud, 2000).len(), 9 * 12 / 8);
        assert_eq!(drawn(&cloud, 10_000).len(), 2 * 3);
    }
}
