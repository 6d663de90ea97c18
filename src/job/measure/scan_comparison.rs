//! The distances between a cloud and the scans that it was made from, in one pass over the scans.
//!
//! ```text
//!   scans ─► decoder ─► batch ─► tree of the batch ◄─┐      accuracy: every point of the cloud, with its
//!                                                    │      smallest distance so far as the limit
//!                                                    ▼
//!                       tree of the cloud, for all batches  coverage: every point of the batch
//! ```
//!
//! The cloud stays in memory. Batches of the scans pass by, one in each thread, and leave nothing but minima and counts
//! behind. A minimum does not depend on the order of its terms, nor does a [`DistanceTally`]: the figures are those
//! of all pairs of points, whatever the threads, the batches and the order of the files.

use std::{
    ops::Range,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
};

use super::{
    bare_points::{BARE_BYTES, BarePoints},
    comparison_plan::ComparisonPlan,
};
use crate::{
    geometry::{Quantization, Stored, StoredTree, stored_distance_squared},
    las::{InputFile, PointFilter},
    quality::DistanceTally,
    tile::{Source, SourceError},
};

/// The distances between a cloud and the scans it is compared with.
pub(super) struct ComparedDistances {
    /// From each point of the cloud to the nearest point of the scans; none if the scans have no points.
    pub(super) accuracy: DistanceTally,
    /// From each point of the scans to the nearest point of the cloud.
    pub(super) coverage: DistanceTally,
}

/// A cloud, and how near the scans have come to its points so far.
pub(super) struct ScanComparison {
    cloud: StoredTree,
    /// For each point of the cloud the squared distance to the nearest point of the scans (stored units), as the bits of a
    /// float: positive floats have the order of their bits.
    nearest_squared: Vec<AtomicU64>,
    quantization: Quantization,
    spacing: f64,
}

impl ScanComparison {
    /// A `cloud` of at least one point, compared with nothing so far; `spacing` (CRS units) is the unit of its figures.
    pub(super) fn new(cloud: Vec<Stored>, quantization: Quantization, spacing: f64) -> Self {
        let never = || AtomicU64::new(f64::INFINITY.to_bits());
        Self {
            nearest_squared: cloud.iter().map(|_| never()).collect(),
            cloud: StoredTree::new(cloud),
            quantization,
            spacing,
        }
    }

    /// Compares the cloud with all points of `scans`.
    ///
    /// # Errors
    ///
    /// If a file cannot be read.
    pub(super) fn with_scans(
        self,
        scans: &[InputFile],
        plan: &ComparisonPlan,
    ) -> Result<ComparedDistances, SourceError> {
        let points_of_part = plan.batch_points as u64;
        let parts = scans.iter().flat_map(|scan| {
            let parts = scan.parts(points_of_part, &PointFilter::default());
            parts.into_iter().map(move |part| (scan, part))
        });
        let waiting = Mutex::new(parts);
        let next = || {
            waiting
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .next()
        };
        let work = || {
            let compared = self.compare_parts(&next, plan.batch_points);
            if compared.is_err() {
                // The other threads are not to take any more.
                while next().is_some() {}
            }
            compared
        };
        let of_threads: Vec<Result<DistanceTally, SourceError>> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..plan.threads).map(|_| scope.spawn(work)).collect();
            let join = |thread: std::thread::ScopedJoinHandle<'_, _>| {
                thread
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            threads.into_iter().map(join).collect()
        });
        let mut coverage = DistanceTally::new(self.spacing);
        for of_thread in of_threads {
            coverage.add(&of_thread?);
        }
        Ok(ComparedDistances {
            accuracy: self.accuracy(),
            coverage,
        })
    }

    /// Compares the cloud with one part after the other, in batches of `batch_points`, and returns the distances of
    /// their points to the cloud.
    fn compare_parts<'a>(
        &self,
        next: &impl Fn() -> Option<(&'a InputFile, Range<u64>)>,
        batch_points: usize,
    ) -> Result<DistanceTally, SourceError> {
        let mut coverage = DistanceTally::new(self.spacing);
        let (mut records, mut batch) = (Vec::new(), Vec::with_capacity(batch_points));
        while let Some((scan, part)) = next() {
            let mut points = BarePoints::open(scan, part, self.quantization)?;
            while points.next_batch(&mut records)?.read > 0 {
                let more = records.chunks_exact(BARE_BYTES).map(Stored::of_record);
                if batch.len() + more.len() > batch_points {
                    batch = self.compare_batch(batch, &mut coverage);
                }
                batch.extend(more);
            }
        }
        self.compare_batch(batch, &mut coverage);
        Ok(coverage)
    }

    /// Compares the cloud with a batch of scanned points, and returns the memory of the batch.
    fn compare_batch(&self, batch: Vec<Stored>, coverage: &mut DistanceTally) -> Vec<Stored> {
        let batch = StoredTree::new(batch);
        let scale = self.quantization.scale;
        visit_nearest(
            &batch,
            &self.cloud,
            |_| f64::INFINITY,
            |_, squared| {
                coverage.push(squared.sqrt() * scale);
            },
        );
        let limit = |point: usize| {
            let bits = self.nearest_squared[point].load(Ordering::Relaxed);
            f64::from_bits(bits)
        };
        visit_nearest(&self.cloud, &batch, limit, |point, squared: f64| {
            self.nearest_squared[point].fetch_min(squared.to_bits(), Ordering::Relaxed);
        });
        let mut memory = batch.into_points();
        memory.clear();
        memory
    }

    fn accuracy(&self) -> DistanceTally {
        let mut accuracy = DistanceTally::new(self.spacing);
        for bits in &self.nearest_squared {
            let squared = f64::from_bits(bits.load(Ordering::Relaxed));
            if squared.is_finite() {
                accuracy.push(squared.sqrt() * self.quantization.scale);
            }
        }
        accuracy
    }
}

/// Calls `visit` for each point of `asking` that has a point of `tree` nearer than `limit`, a squared distance, with its index
/// and the squared distance to the nearest.
fn visit_nearest(
    asking: &StoredTree,
    tree: &StoredTree,
    limit: impl Fn(usize) -> f64,
    mut visit: impl FnMut(usize, f64),
) {
    let Some(&(mut guess)) = tree.points().first() else {
        return;
    };
    for (index, &position) in asking.points().iter().enumerate() {
        let limit = limit(index);
        // The neighbour of the point before is near this one, too: few nodes of the tree are nearer.
        let guessed = stored_distance_squared(position, guess);
        if let Some(near) = tree.nearest_below(position, limit.min(guessed)) {
            guess = near.point;
            visit(index, near.distance_squared);
        } else if guessed < limit {
            visit(index, guessed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::spread;

    const QUANTIZATION: Quantization = Quantization {
        scale: 0.01,
        offset: [0.0; 3],
    };

    /// Points of a tilted plane, some of them coincident, and one in thirty up to 300 units away from it.
    fn cloud(count: u64, seed: u64) -> Vec<Stored> {
        let c = |i: u64, k, most| (spread(seed + 4 * i + k) % most) as i32;
        let point = |i| {
            let (x, y) = (c(i, 0, 400), c(i, 1, 300));
            let z = (x + y) / 3 + if c(i, 2, 30) == 0 { c(i, 3, 300) } else { 0 };
            Stored { x, y, z }
        };
        (0..count).map(point).collect()
    }

    /// The slow twin: the tally of the distances from all points to the nearest of `others`.
    fn by_brute_force(points: &[Stored], others: &[Stored]) -> DistanceTally {
        let mut tally = DistanceTally::new(0.1);
        for &point in points {
            let squared = others.iter().map(|&p| stored_distance_squared(point, p));
            if let Some(squared) = squared.min_by(f64::total_cmp) {
                tally.push(squared.sqrt() * QUANTIZATION.scale);
            }
        }
        tally
    }

    fn compared(cloud: &[Stored], batches: &[Vec<Stored>]) -> ComparedDistances {
        let comparison = ScanComparison::new(cloud.to_vec(), QUANTIZATION, 0.1);
        let mut coverage = DistanceTally::new(0.1);
        for batch in batches {
            comparison.compare_batch(batch.clone(), &mut coverage);
        }
        let accuracy = comparison.accuracy();
        ComparedDistances { accuracy, coverage }
    }

    #[test]
    fn distances_are_those_of_all_pairs_whatever_the_batches_and_their_order() {
        for (count, scanned) in [(700, 3000), (1, 500), (900, 40), (300, 0)] {
            let (cloud, mut scan) = (cloud(count, 0), cloud(scanned, 1_000_000));
            let truth = [by_brute_force(&cloud, &scan), by_brute_force(&scan, &cloud)];
            for batch_points in [5000, 700, 33] {
                let batches: Vec<_> = scan.chunks(batch_points).map(<[_]>::to_vec).collect();
                let found = compared(&cloud, &batches);
                assert_eq!([found.accuracy, found.coverage], truth);
                scan.reverse();
            }
            scan.sort_unstable();
            let found = compared(&cloud, &[scan]);
            assert_eq!([found.accuracy, found.coverage], truth);
        }
    }
}
