//! How much memory can be had: the least of what the machine has left, what the process may still ask for, and what the
//! container that it runs in may.

use std::path::Path;

/// Bytes of memory that can be had without swapping, where the system says so: the least of the machine's, of the limits
/// of the process (`ulimit -v`, `-d`) and of its control groups, of either version.
pub fn available_memory() -> Option<u64> {
    available_below(Path::new("/"))
}

/// The same, on a system whose `proc` and `sys` are in this folder.
fn available_below(root: &Path) -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap_or_default();
    let kib = |text: &str, key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key))?;
        line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib.saturating_mul(1024))
    };
    let machine = kib(&read("proc/meminfo"), "MemAvailable:");
    let (limits, status) = (read("proc/self/limits"), read("proc/self/status"));
    let of_process = [("Max address space", "VmSize:"), ("Max data size", "VmData:")].map(|(limit, used)| {
        let line = limits.lines().find_map(|line| line.strip_prefix(limit))?;
        let limit = line.split_whitespace().next()?.parse::<u64>().ok()?;
        Some(limit.saturating_sub(kib(&status, used)?))
    });
    let groups = read("proc/self/cgroup");
    let of_groups = groups.lines().flat_map(|line| of_group(root, line));
    machine.into_iter().chain(of_process.into_iter().flatten()).chain(of_groups).min()
}

/// What is left to a control group and to those around it. `line` names it as `/proc/self/cgroup` does: its hierarchy, what
/// that controls (nothing, in version 2), and its path.
fn of_group(root: &Path, line: &str) -> Vec<u64> {
    let mut parts = line.splitn(3, ':').skip(1);
    let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { return Vec::new() };
    let (mount, limit, used, cache) = if controllers.is_empty() {
        ("sys/fs/cgroup", "memory.max", "memory.current", "inactive_file ")
    } else if controllers.split(',').any(|c| c == "memory") {
        ("sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file ")
    } else {
        return Vec::new();
    };
    let mount = root.join(mount);
    let left = |group: &Path| {
        let folder = mount.join(group);
        let text = |name: &str| std::fs::read_to_string(folder.join(name)).ok();
        let number = |name: &str| text(name)?.trim().parse::<u64>().ok();
        // Files that nobody looked at for a while make room.
        let spare = text("memory.stat")
            .and_then(|stat| stat.lines().find_map(|line| line.strip_prefix(cache)?.trim().parse::<u64>().ok()))
            .unwrap_or(0);
        // A group without a limit says `max`, or a number beyond any memory.
        Some(number(limit)?.saturating_sub(number(used)?.saturating_sub(spare)))
    };
    Path::new(path.trim_start_matches('/')).ancestors().filter_map(left).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_of_all_limits_counts() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let write = |path: &str, text: &str| {
            let path = root.join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        assert_eq!(available_below(root), None);
        write("proc/meminfo", "MemTotal: 9000 kB\nMemAvailable:    8000 kB\n");
        write(
            "proc/self/limits",
            "Limit   Soft Limit  Hard Limit  Units\nMax data size   unlimited   unlimited   bytes\n",
        );
        write("proc/self/status", "VmSize:\t    1000 kB\nVmData:\t     500 kB\n");
        assert_eq!(available_below(root), Some(8000 << 10));
        write(
            "proc/self/limits",
            "Max data size   7168000  unlimited  bytes\nMax address space  unlimited  unlimited  bytes\n",
        );
        assert_eq!(available_below(root), Some(6500 << 10));
        write(
            "proc/self/limits",
            "Max data size   7168000  unlimited  bytes\nMax address space  7168000  unlimited  bytes\n",
        );
        assert_eq!(available_below(root), Some(6000 << 10));
        // Version 2: a limit may be that of a group around the own one.
        write("proc/self/cgroup", "0::/a/b\n");
        write("sys/fs/cgroup/a/b/memory.max", "max\n");
        write("sys/fs/cgroup/a/b/memory.current", "1000\n");
        write("sys/fs/cgroup/a/memory.max", "6000000\n");
        write("sys/fs/cgroup/a/memory.current", "2000000\n");
        write("sys/fs/cgroup/a/memory.stat", "anon 1\ninactive_file 500000\n");
        assert_eq!(available_below(root), Some(4_500_000));
        // Version 1; in a container the group is at the root, whatever its path says.
        write("proc/self/cgroup", "5:cpu,memory:/docker/1\n4:pids:/\n");
        write("sys/fs/cgroup/memory/memory.limit_in_bytes", "1000000\n");
        write("sys/fs/cgroup/memory/memory.usage_in_bytes", "900000\n");
        write("sys/fs/cgroup/memory/memory.stat", "total_inactive_file 100000\n");
        assert_eq!(available_below(root), Some(200_000));
        write("sys/fs/cgroup/memory/memory.usage_in_bytes", "2000000\n");
        assert_eq!(available_below(root), Some(0));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_system_tells() {
        assert!(available_memory().is_some_and(|n| n > 0));
    }
}
