//! Counts the program's memory, and limits it.

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs::read_to_string;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_diagnostics::budget;

/// The system's allocator, with a count of allocated bytes.
struct Counted;

static BYTES: AtomicU64 = AtomicU64::new(0);

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// Allocated bytes, without those of plugins with their own allocators.
pub fn bytes() -> u64 {
    BYTES.load(Ordering::Relaxed)
}

/// Limits the program to this many bytes, by default to half of the machine's memory. If that is not known,
/// there is no limit.
pub fn limit(most: Option<u64>) {
    if let Some(most) = most.or_else(|| Some(of_machine()? / 2)) {
        budget::set(most, bytes);
    }
}

/// Memory of the machine, or of the control group that the program runs in, on Linux.
fn of_machine() -> Option<u64> {
    let info = read_to_string("/proc/meminfo").ok()?;
    let total = info.lines().find_map(|line| line.strip_prefix("MemTotal:")?.strip_suffix("kB"))?;
    let total = total.trim().parse::<u64>().ok()? << 10;
    // The limits of parent groups hold too.
    let group = read_to_string("/proc/self/cgroup").unwrap_or_default();
    let group = group.lines().find_map(|line| line.strip_prefix("0::/")).unwrap_or_default();
    let group = Path::new("/sys/fs/cgroup").join(group);
    let most = |dir: &Path| read_to_string(dir.join("memory.max")).ok()?.trim().parse::<u64>().ok();
    Some(group.ancestors().filter_map(most).fold(total, u64::min))
}

// SAFETY: every call goes to the system's allocator with the same arguments; the count touches no allocated
// memory.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as of this function.
        let at = unsafe { System.alloc(layout) };
        if !at.is_null() {
            BYTES.fetch_add(layout.size() as u64, Ordering::Relaxed);
        }
        at
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        BYTES.fetch_sub(layout.size() as u64, Ordering::Relaxed);
        // SAFETY: as of this function.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as of this function.
        let at = unsafe { System.alloc_zeroed(layout) };
        if !at.is_null() {
            BYTES.fetch_add(layout.size() as u64, Ordering::Relaxed);
        }
        at
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as of this function.
        let now = unsafe { System.realloc(at, layout, size) };
        if !now.is_null() {
            BYTES.fetch_add(size as u64, Ordering::Relaxed);
            BYTES.fetch_sub(layout.size() as u64, Ordering::Relaxed);
        }
        now
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn allocation_is_counted_until_freed() {
        let before = super::bytes();
        let much = std::hint::black_box(vec![1_u8; 64 << 20]);
        assert!(super::bytes() >= before + (60 << 20));
        drop(much);
        assert!(super::bytes() < before + (32 << 20));
    }
}
