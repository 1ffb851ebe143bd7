//! Memory that the program holds, and how much it may hold.

use std::fs::read_to_string;
use std::path::Path;

use asperity_diagnostics::budget;

/// Bytes on the heap, as glibc counts them. Elsewhere resident memory, without pages that nobody touched.
pub fn bytes() -> u64 {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        // SAFETY: it takes nothing and only reads the allocator's own figures, under its locks.
        let held = unsafe { libc::mallinfo2() };
        (held.uordblks + held.hblkhd) as u64
    }
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    memory_stats::memory_stats().map_or(0, |held| held.physical_mem as u64)
}

/// Limits the program to `most` bytes, or else to half of the machine's memory.
pub fn limit(most: Option<u64>) {
    if let Some(most) = most.or_else(|| Some(of_machine()? / 2)) {
        budget::set(most, bytes);
    }
}

/// Memory of the machine, or of the control group in which the program runs, on Linux.
fn of_machine() -> Option<u64> {
    let info = read_to_string("/proc/meminfo").ok()?;
    let total = info.lines().find_map(|line| line.strip_prefix("MemTotal:")?.strip_suffix("kB"))?;
    let total = total.trim().parse::<u64>().ok()? << 10;
    // The limits of the groups above hold too.
    let group = read_to_string("/proc/self/cgroup").unwrap_or_default();
    let group = group.lines().find_map(|line| line.strip_prefix("0::/")).unwrap_or_default();
    let group = Path::new("/sys/fs/cgroup").join(group);
    let most = |dir: &Path| read_to_string(dir.join("memory.max")).ok()?.trim().parse::<u64>().ok();
    Some(group.ancestors().filter_map(most).fold(total, u64::min))
}

#[cfg(test)]
mod tests {
    #[test]
    fn bytes_count_an_allocation_until_it_is_freed() {
        // Much more than other tests of the process take and free meanwhile. Nobody writes to it, so that
        // it is counted and takes no memory.
        let before = super::bytes();
        let much = std::hint::black_box(Vec::<u8>::with_capacity(1 << 30));
        assert!(super::bytes() >= before + (768 << 20));
        drop(much);
        assert!(super::bytes() < before + (256 << 20));
    }
}
