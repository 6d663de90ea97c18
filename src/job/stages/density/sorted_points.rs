//! Points in the order of their positions, so that sums over them do not depend on the order in which they were read.

use rayon::prelude::*;

use crate::geometry::{Local, Quantization, Stored};

/// Points in the order of their positions.
#[derive(Debug)]
pub(super) struct SortedPoints {
    /// The positions as stored.
    pub(super) stored: Vec<Stored>,
    /// The local positions.
    pub(super) local: Vec<Local>,
    /// For each point its index in the input.
    pub(super) order: Vec<u32>,
}

impl SortedPoints {
    /// Sorts `points`.
    ///
    /// # Panics
    ///
    /// Unless there are fewer than 2³² points.
    pub(super) fn new(points: &[Stored], quantization: &Quantization) -> Self {
        let count = u32::try_from(points.len()).expect("a tile has under 2^32 points");
        let mut order: Vec<u32> = (0..count).collect();
        order.par_sort_unstable_by_key(|&index| (points[index as usize], index));
        let stored: Vec<Stored> = order.iter().map(|&i| points[i as usize]).collect();
        Self {
            local: stored.iter().map(|&p| quantization.local(p)).collect(),
            stored,
            order,
        }
    }
}
