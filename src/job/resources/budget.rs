//! The memory of a job, divided among its stages.
//!
//! The costs below were measured. A tile is planned so that its points and seeds fit; decoders and
//! buffers of the scatter share the same budget before there are tiles.

use super::memory::memory_limit;

/// Bytes of the program, its threads and small values, measured on a job of a few points.
const BASE_BYTES: u64 = 48 << 20;
/// Bytes of a decoder with its batches: LAZ models, raw and converted points, and points that wait
/// for the writer.
const BYTES_PER_DECODER: u64 = 16 << 20;
/// Further bytes of a decoder of a remote file: what was requested before it is needed, by the decoder itself and for the
/// part after it, and what waits for the checksum.
const BYTES_PER_REMOTE_DECODER: u64 = 12 << 20;
/// Bytes per point of a tile that is being read; the sort of the scan is the peak.
const BYTES_PER_POINT_READ: f64 = 32.0;
/// Bytes per point of a tile whose seeds are being elected, if none of its points lie on a surface.
const BYTES_PER_POINT_ELECTED: f64 = 45.0;
/// Bytes per point of a tile that is being solved.
const BYTES_PER_POINT_SOLVED: f64 = 9.0;
/// Bytes per voxel of a tile's scan: sample, table, order.
const BYTES_PER_VOXEL: f64 = 50.0;
/// Approximate number of voxels per seed: six on a plane that is parallel to the lattice, nine on
/// one that crosses it, twelve in the crowns of trees.
const VOXELS_PER_SEED: f64 = 12.0;
/// Positions that the filling adds per seed where the scan is coarser than the output.
const FILLED_POSITIONS_PER_SEED: f64 = 4.0;
/// Points per seed of a scan that is so dense that hardly any positions are filled.
const POINTS_PER_SEED_WITHOUT_FILLING: f64 = 8.0;
/// Bytes per seed of a tile: states, steps, responses to moves, histories.
const BYTES_PER_SEED: f64 = 700.0;
/// Share of the cost of a tile that its points and voxels take before it is solved, at most.
const WAITING_SHARE: f64 = 0.5;
/// Share of the budget that a tile may use, because the allocator does not return all memory at
/// once. With it, and 750 bytes per seed, tiles that just fitted 256 MiB had peaks of up to 0.73 of that on
/// twelve real scans, of 0.78 on simulated streets, and of 0.92 in the crowns of trees, where points cost most; with 700 bytes a job of
/// five tiles had one of 0.90 of 1 GiB.
const USABLE_SHARE: f64 = 0.8;
/// Share of the budget that scattered points may take; tiles have the rest.
const LARGEST_SPILL_SHARE: f64 = 0.3;
/// The largest cost of a tile in bytes, however large the budget: a stopped job loses the tile that
/// it was solving.
const LARGEST_TILE_BYTES: u64 = 5 << 29;

/// The memory and the threads of a job.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    /// Peak memory in bytes.
    pub(crate) total: u64,
    /// Worker threads.
    pub(crate) threads: usize,
    /// Bytes of the scattered points that stay in memory throughout.
    pub(crate) held: u64,
}

impl Budget {
    /// The budget of `requested` bytes, or of three quarters of the memory that the system allows.
    pub(crate) fn new(requested: Option<u64>, threads: usize) -> Self {
        let by_machine = || memory_limit().map_or(2 << 30, |limit| limit / 4 * 3);
        Self {
            total: requested.unwrap_or_else(by_machine),
            threads,
            held: 0,
        }
    }

    /// The budget of a job whose scattered points take `bytes` of memory.
    pub(crate) fn holding(self, bytes: u64) -> Self {
        Self {
            held: bytes,
            ..self
        }
    }

    /// Bytes of scattered points that may stay in memory.
    pub(crate) fn spill(&self) -> u64 {
        (self.total.saturating_sub(BASE_BYTES) as f64 * LARGEST_SPILL_SHARE) as u64
    }

    /// Number of decoders that may work at once, of files of which some are remote or none.
    pub(crate) fn decoders(&self, are_remote: bool) -> usize {
        let bytes = match are_remote {
            true => BYTES_PER_DECODER + BYTES_PER_REMOTE_DECODER,
            false => BYTES_PER_DECODER,
        };
        let affordable = (self.total.saturating_sub(BASE_BYTES) / 2 / bytes) as usize;
        self.threads.min(affordable).max(1)
    }

    /// Bytes of a remote file that may wait in memory for those before them, for its checksum.
    pub(crate) fn waiting_for_checksums(&self) -> u64 {
        (self.total / 16).clamp(4 << 20, 64 << 20)
    }

    /// Bytes for the buffers of the scatter.
    pub(crate) fn buffers(&self) -> usize {
        (self.total / 8).clamp(4 << 20, 256 << 20) as usize
    }

    /// Bytes that the points in memory may take.
    pub(crate) fn usable(&self) -> u64 {
        let left = self.total.saturating_sub(BASE_BYTES + self.held);
        (left as f64 * USABLE_SHARE) as u64
    }

    /// Largest cost of a tile in bytes.
    pub(crate) fn tile(&self) -> u64 {
        self.usable().min(LARGEST_TILE_BYTES)
    }

    /// Whether a tile that costs `next` may be read while one that costs `current` is solved.
    pub(crate) fn has_room_for_next(&self, current: u64, next: u64) -> bool {
        current + waiting(next) <= self.usable()
    }

    /// The largest sum of the costs of tiles that are in memory together, if tiles of `costs` are
    /// solved in this order.
    pub(crate) fn most_held(&self, costs: &[u64]) -> u64 {
        let together = |pair: &[u64]| match self.has_room_for_next(pair[0], pair[1]) {
            true => pair[0] + waiting(pair[1]),
            false => 0,
        };
        let pairs = costs.windows(2).map(together);
        pairs.chain(costs.iter().copied()).max().unwrap_or(0)
    }

    /// Number of points that fit at `bytes` each.
    pub(crate) fn points(&self, bytes: f64) -> u64 {
        (self.tile() as f64 / bytes) as u64
    }

    /// The smallest budget, in bytes, with which a tile that costs `bytes` fits.
    pub(crate) fn needed(&self, bytes: f64) -> u64 {
        BASE_BYTES + self.held + with_margin(bytes)
    }

    /// The smallest budget, in bytes, with which a tile that costs `bytes` fits, if scattered points of `scattered` bytes stay in memory
    /// wherever they may.
    pub(crate) fn needed_beside(&self, bytes: f64, scattered: u64) -> u64 {
        let without = self.holding(0).needed(bytes);
        let with_points = self.holding(scattered).needed(bytes);
        let stay = self.held > 0
            || scattered
                <= Self {
                    total: without,
                    ..*self
                }
                .spill();
        if stay { with_points } else { without }
    }

    /// What a process holds at the most that has `resident` bytes when its tiles are planned, of which those that are in memory together cost
    /// `bytes`: the allocator may keep what was freed by then. It is no more than the budget.
    pub(crate) fn held_with(&self, resident: u64, bytes: f64) -> u64 {
        let with_tiles = resident + with_margin(bytes);
        with_tiles.min(self.total).max(self.needed(bytes))
    }

    /// The smallest budget, in bytes, with which any job is begun.
    pub(crate) fn least(&self) -> u64 {
        BASE_BYTES + 2 * BYTES_PER_DECODER + (16 << 20)
    }
}

/// The cost in bytes of a tile with `points` in at most `voxels`, and `seeds`: what it takes while
/// it is read, while its seeds are elected or while it is solved, whichever is most.
pub(crate) fn tile_bytes(points: f64, voxels: f64, seeds: f64) -> f64 {
    // Each filled position occupies a voxel of its own.
    let sparse = (1.0 - points / (POINTS_PER_SEED_WITHOUT_FILLING * seeds)).max(0.0);
    let filled = sparse * FILLED_POSITIONS_PER_SEED * seeds;
    let voxels = (seeds * VOXELS_PER_SEED).min(voxels + filled);
    let read = BYTES_PER_POINT_READ * points;
    let solved = BYTES_PER_POINT_SOLVED * points + BYTES_PER_SEED * seeds;
    let elected = BYTES_PER_POINT_ELECTED * points;
    BYTES_PER_VOXEL * voxels + read.max(elected).max(solved)
}

/// The largest number of points of a tile that costs `bytes`.
pub(crate) fn points_for(bytes: u64) -> u64 {
    (bytes as f64 / BYTES_PER_POINT_READ) as u64
}

/// What tiles that cost `bytes` take of a budget.
fn with_margin(bytes: f64) -> u64 {
    (bytes / USABLE_SHARE).ceil() as u64
}

/// What a tile that costs `bytes` takes before it is solved, at most.
fn waiting(bytes: u64) -> u64 {
    (bytes as f64 * WAITING_SHARE) as u64
}

/// `bytes` in MiB, rounded up, for a message.
pub(crate) fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", bytes.div_ceil(1 << 20))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_that_was_planned_fits_its_budget() {
        for total in [256 << 20, 1 << 30] {
            let budget = Budget::new(Some(total), 2);
            assert!(budget.tile() < LARGEST_TILE_BYTES);
            let bytes = budget.tile() as f64;
            assert!(budget.needed(bytes) <= total);
            assert!(budget.needed(1.01 * bytes) > total);
        }
    }

    #[test]
    fn points_that_would_stay_in_memory_are_counted_when_more_of_it_is_asked_for() {
        let tight = Budget::new(Some(100 << 20), 2);
        let (tile, points) = (100e6, 12 << 20);
        assert!(points <= Budget::new(Some(tight.needed(tile)), 2).spill());
        let needed = tight.needed_beside(tile, points);
        assert!(Budget::new(Some(needed), 2).holding(points).tile() as f64 >= tile);
        // So many stay on the disk.
        assert_eq!(tight.needed_beside(tile, 1 << 30), tight.needed(tile));
    }

    #[test]
    fn a_tile_is_read_before_the_last_one_is_solved_only_if_both_fit() {
        let budget = Budget::new(Some(1 << 30), 2);
        let [large, small] = [budget.usable() / 4 * 3, budget.usable() / 4];
        assert!(!budget.has_room_for_next(large, large));
        assert!(budget.has_room_for_next(large, small));
        assert_eq!(budget.most_held(&[large, large, large]), large);
        let held = budget.most_held(&[small, large, small]);
        assert!(large < held && held <= budget.usable());
        assert_eq!(budget.most_held(&[]), 0);
    }
}
