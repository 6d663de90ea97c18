//! Memory and threads of a comparison of a cloud with scans.

use crate::job::{
    JobError,
    resources::{Budget, mebibytes},
};

/// Bytes of memory per point of the cloud: its coordinates, its share of the nodes of a tree, a distance.
const BYTES_PER_CLOUD_POINT: u64 = 24;
/// Bytes of memory per point of a batch: its coordinates and its share of the nodes of a tree.
const BYTES_PER_BATCH_POINT: u64 = 16;
/// Bytes of a decoder with its buffers.
const BYTES_PER_DECODER: u64 = 16 << 20;
/// Points of a batch, at least.
const LEAST_BATCH_POINTS: u64 = 1 << 19;
/// Points of a batch if memory allows, however small the cloud.
const USUAL_BATCH_POINTS: u64 = 1 << 20;

/// How a cloud is compared with scans: in so many threads, each with a batch of so many scanned points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ComparisonPlan {
    pub(super) threads: usize,
    pub(super) batch_points: usize,
}

impl ComparisonPlan {
    /// The plan for a cloud of `cloud_points` within `budget`. Every batch is compared with all points of the cloud: batches
    /// are as large as the cloud where memory allows, so that this costs no more than the batch does.
    ///
    /// # Errors
    ///
    /// [`JobError::Resources`] if the cloud does not fit.
    pub(super) fn new(cloud_points: u64, budget: &Budget) -> Result<Self, JobError> {
        let cloud = cloud_points.saturating_mul(BYTES_PER_CLOUD_POINT);
        let thread = BYTES_PER_DECODER + LEAST_BATCH_POINTS * BYTES_PER_BATCH_POINT;
        let free = budget.usable().saturating_sub(cloud);
        let threads = (free / thread).min(budget.threads as u64);
        if threads == 0 {
            return Err(JobError::Resources(format!(
                "--memory {} is too little to compare {cloud_points} points with scans: they stay in memory while \
                 the scans pass by; give at least {}, or measure the cloud without --against",
                mebibytes(budget.total),
                mebibytes(budget.needed((cloud + thread) as f64))
            )));
        }
        let affordable = (free / threads - BYTES_PER_DECODER) / BYTES_PER_BATCH_POINT;
        let batch_points = affordable.min(cloud_points.max(USUAL_BATCH_POINTS));
        Ok(Self {
            threads: threads as usize,
            batch_points: batch_points as usize,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(cloud_points: u64, mebibytes: u64, threads: usize) -> Result<ComparisonPlan, JobError> {
        ComparisonPlan::new(cloud_points, &Budget::new(Some(mebibytes << 20), threads))
    }

    #[test]
    fn threads_and_batches_follow_the_memory() {
        let usual = ComparisonPlan {
            threads: 2,
            batch_points: 1 << 20,
        };
        assert_eq!(plan(200_000, 256, 2).unwrap(), usual);
        assert_eq!(plan(5_000_000, 4096, 2).unwrap().batch_points, 5_000_000);
        assert_eq!(plan(5_000_000, 256, 8).unwrap().threads, 2);
        let least = Budget::new(Some(0), 2).least() >> 20;
        assert_eq!(plan(40_000, least, 2).unwrap().threads, 1);
    }

    #[test]
    fn what_the_refusal_asks_for_is_enough() {
        let refused = plan(9_000_000, 256, 2).unwrap_err().to_string();
        let asked = refused.split("at least ").nth(1).unwrap();
        let asked: u64 = asked.split(' ').next().unwrap().parse().unwrap();
        assert!(plan(9_000_000, asked, 2).is_ok());
        assert!(plan(9_000_000, asked - 1, 2).is_err(), "{refused}");
    }
}
