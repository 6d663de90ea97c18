//! Bounds on what is around a seed, which the seeds of a wide block share.
//!
//! To know what is usual around a seed takes a look at a thousand voxels, and which seeds are around it one at some twenty of
//! them. Nearly all seeds stand for so many points that the most that are anywhere around their block say enough.

use std::sync::OnceLock;

use crate::{
    geometry::Local,
    lloyd::{
        options::SolverOptions,
        surface::{Surface, bounding_box},
    },
};

/// Edge of a block.
const BLOCK_IN_SPACINGS: f64 = 8.0;

/// Seeds by block.
pub(super) struct SeedBlocks {
    /// The block of each seed.
    block_of: Vec<u32>,
    blocks: Vec<Block>,
}

/// The seeds of a block. What is around them is found when it is first needed.
pub(super) struct Block {
    /// The corners of the box around the seeds.
    pub(super) corners: [Local; 2],
    /// The options at the seed where the spacing is coarsest.
    pub(super) options: SolverOptions,
    /// No less than the number of points that voxels around a seed of the block usually have.
    pub(super) most_usual_points: OnceLock<f64>,
    /// No less than the number of points near a seed beside one of the block.
    pub(super) most_near: OnceLock<f64>,
}

impl SeedBlocks {
    /// The blocks of seeds at `positions`.
    pub(super) fn new(surface: Surface<'_>, positions: &[Local]) -> Self {
        let (cells, order) = surface.field().cells(positions, BLOCK_IN_SPACINGS);
        let mut block_of = vec![0; positions.len()];
        let blocks = (0_u32..).zip(cells.ranges()).map(|(number, range)| {
            let seeds = order[range].iter().map(|&seed| seed as usize);
            seeds.clone().for_each(|seed| block_of[seed] = number);
            let places = seeds.map(|seed| positions[seed]);
            Block {
                corners: bounding_box(places.clone()),
                options: surface.coarsest_options(places),
                most_usual_points: OnceLock::new(),
                most_near: OnceLock::new(),
            }
        });
        let blocks = blocks.collect();
        Self { block_of, blocks }
    }

    /// The block of the `seed`.
    pub(super) fn of(&self, seed: usize) -> &Block {
        &self.blocks[self.block_of[seed] as usize]
    }
}

impl Block {
    /// The corners of the box that contains all that is within `radius` (CRS units) of a seed of the block.
    pub(super) fn corners_around(&self, radius: f64) -> [Local; 2] {
        let ([low, high], reach) = (self.corners, Local::repeat(radius));
        [low - reach, high + reach]
    }
}
