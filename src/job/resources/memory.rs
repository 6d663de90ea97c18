//! How much memory there is, and how much was used.

use std::{fs, path::Path};

/// The memory that this process may use, in bytes: the tightest limit of its
/// cgroup and all that contain it, or the machine's if that is less; `None`
/// where the system does not tell.
pub(crate) fn memory_limit() -> Option<u64> {
    let machine = proc_kib("/proc/meminfo", "MemTotal:");
    let cgroups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let limits = cgroups.lines().flat_map(|line| {
        let mut fields = line.splitn(3, ':');
        let (_, controllers, path) = (fields.next(), fields.next(), fields.next());
        let (root, file) = match controllers {
            Some("") => ("/sys/fs/cgroup", "memory.max"),
            Some(list) if list.split(',').any(|c| c == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => return Vec::new(),
        };
        let inside = path.unwrap_or("/").trim_start_matches('/');
        Path::new(inside)
            .ancestors()
            .filter_map(|group| {
                let limit = Path::new(root).join(group).join(file);
                fs::read_to_string(limit).ok()?.trim().parse::<u64>().ok()
            })
            .collect()
    });
    limits.chain(machine).min()
}

/// The most memory that this process has held so far, in bytes, mapped pages
/// included (`VmHWM`); `None` where the system does not tell.
pub(crate) fn peak_resident() -> Option<u64> {
    proc_kib("/proc/self/status", "VmHWM:")
}

/// The memory that this process holds now, in bytes, mapped pages included (`VmRSS`);
/// `None` where the system does not tell.
pub(crate) fn resident() -> Option<u64> {
    proc_kib("/proc/self/status", "VmRSS:")
}

fn proc_kib(file: &str, key: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

/// Memory of program, threads and small things, whatever the job: measured on
/// a job of a few points.
const BASE: u64 = 48 << 20;
/// Memory of a decoder with its batches: LAZ models, raw and converted points,
/// what waits for the writer.
const PER_DECODER: u64 = 16 << 20;
/// Memory for each point of a tile that is being read (the sort of the scan is
/// the peak), and of one that is being solved.
const PER_POINT_READ: f64 = 32.0;
const PER_POINT_SOLVED: f64 = 9.0;
/// Memory for each voxel of a tile's scan: sample, table, order. A tile is
/// solved while the next one is read: both have voxels.
const PER_VOXEL: f64 = 2.0 * 50.0;
/// Voxels to a seed, about: eight of a plane that lies in the lattice, half as
/// many again of one that crosses it.
const VOXELS_PER_SEED: f64 = 12.0;
/// Places of the filling to a seed where the scan is coarser than the output.
const FILLING_PER_SEED: f64 = 4.0;
/// Memory for each seed of a tile: states, steps, answers to moves, histories.
const PER_SEED: f64 = 900.0;
/// The allocator does not give everything back at once. With the costs above and 0.85 fifteen runs of
/// the demo's job, whose three tiles just fit, held 68 to 93 % of 256 MiB at their peaks.
const USABLE: f64 = 0.8;
/// No tile costs more than this, whatever the budget: a tile is what a stopped job
/// loses.
const LARGEST_TILE: u64 = 5 << 29;

/// The job's memory, shared out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Budget {
    pub(crate) total: u64,
    pub(crate) threads: usize,
}

impl Budget {
    /// What `--memory` says, or three quarters of what there is.
    pub(crate) fn new(asked: Option<u64>, threads: usize) -> Self {
        let by_machine = || memory_limit().map_or(2 << 30, |limit| limit / 4 * 3);
        Self {
            total: asked.unwrap_or_else(by_machine),
            threads,
        }
    }

    /// Decoders that may work at once.
    pub(crate) fn decoders(&self) -> usize {
        let affordable = (self.total.saturating_sub(BASE) / 2 / PER_DECODER) as usize;
        self.threads.min(affordable).max(1)
    }

    /// Bytes for the buffers of the scatter.
    pub(crate) fn buffers(&self) -> usize {
        (self.total / 8).clamp(4 << 20, 256 << 20) as usize
    }

    /// Bytes that a tile may cost.
    pub(crate) fn tile(&self) -> u64 {
        let usable = (self.total.saturating_sub(BASE) as f64 * USABLE) as u64;
        usable.min(LARGEST_TILE)
    }

    /// Points that fit, at so many bytes each.
    pub(crate) fn points(&self, bytes: f64) -> u64 {
        (self.tile() as f64 / bytes) as u64
    }

    /// The budget with which a tile that costs so many bytes would fit.
    pub(crate) fn needed(&self, bytes: f64) -> u64 {
        BASE + (bytes / USABLE).ceil() as u64
    }

    /// The least budget with which any job is tried.
    pub(crate) fn least(&self) -> u64 {
        BASE + 2 * PER_DECODER + (16 << 20)
    }
}

/// Bytes that a tile takes for so many points and seeds.
pub(crate) fn bytes_of(points: f64, seeds: f64) -> f64 {
    // A voxel for each point at the most, and those of the filling.
    let voxels = (seeds * VOXELS_PER_SEED).min(points + seeds * FILLING_PER_SEED);
    (PER_POINT_READ + PER_POINT_SOLVED) * points + PER_VOXEL * voxels + PER_SEED * seeds
}

/// Points that a tile of so many bytes has at the most.
pub(crate) fn points_for(bytes: u64) -> u64 {
    (bytes as f64 / (PER_POINT_READ + PER_POINT_SOLVED)) as u64
}

pub(crate) fn mebibytes(bytes: u64) -> String {
    format!("{} MiB", bytes.div_ceil(1 << 20))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_that_was_planned_fits_its_budget() {
        for total in [256 << 20, 1 << 30] {
            let budget = Budget { total, threads: 2 };
            assert!(budget.tile() < LARGEST_TILE);
            let bytes = budget.tile() as f64;
            assert!(budget.needed(bytes) <= total);
            assert!(budget.needed(1.01 * bytes) > total);
        }
    }

    #[test]
    fn what_is_used_is_within_what_there_is() {
        if let (Some(limit), Some(used)) = (memory_limit(), peak_resident()) {
            assert!(used > 0 && used <= limit);
        }
    }
}
