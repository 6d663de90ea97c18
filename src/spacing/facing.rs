//! The directions that the planes of a cloud face, from a sample of it.
//!
//! The sample must be the same whatever memory there is, since all seeds depend on it. How many points a square has
//! depends on how far they have been thinned; that it has some does not. So small blocks are drawn from
//! those that are occupied, by a hash of their place.

use rayon::prelude::*;

use crate::{
    geometry::{Local, Quantization, Rect, spread},
    lloyd::{DominantNormals, SeedRule, SolverOptions, coarse_normals},
    tiling::CountedCloud,
};

/// Edge of a block.
const BLOCK_IN_SPACINGS: f64 = 8.0;
/// Blocks that are drawn: so many, or a share of all if that is more.
const BLOCKS: usize = 64;
const SHARE: f64 = 0.01;
/// No larger share of the blocks is drawn, unless there are too few of them to say anything.
const LARGEST_SHARE: f64 = 0.125;
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
    let edge = quantization
        .units(BLOCK_IN_SPACINGS * options.spacing)
        .max(1);
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
