//! Memory that the system allows this process, and memory that the process has resident.

use std::{fs, path::Path};

/// The memory that this process may use, in bytes: the smallest limit of its cgroup and all
/// cgroups that contain it, or the machine's memory if that is less; `None` where the system does
/// not report it.
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

/// The largest resident memory of this process so far, in bytes, mapped pages included (`VmHWM`);
/// `None` where the system does not report it.
pub(crate) fn peak_resident() -> Option<u64> {
    proc_kib("/proc/self/status", "VmHWM:")
}

/// The resident memory of this process now, in bytes, mapped pages included (`VmRSS`); `None`
/// where the system does not report it.
pub(crate) fn resident() -> Option<u64> {
    proc_kib("/proc/self/status", "VmRSS:")
}

/// Reads the value of `key`, which `file` gives in KiB, in bytes.
fn proc_kib(file: &str, key: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_used_is_within_what_there_is() {
        if let (Some(limit), Some(used)) = (memory_limit(), peak_resident()) {
            assert!(used > 0 && used <= limit);
        }
    }
}
