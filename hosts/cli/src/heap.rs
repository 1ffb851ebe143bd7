//! Memory that the program holds, and how much it may hold.

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs::read_to_string;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use asperity_diagnostics::budget;

/// The system's allocator, with a count of the bytes that are held. `--memory` needs it in every command; a
/// count costs about 1 ns, and no tick allocates.
struct Counted;

static BYTES: AtomicU64 = AtomicU64::new(0);

#[global_allocator]
static ALLOCATOR: Counted = Counted;

/// Bytes that the program holds on the heap. Allocators of plugins are not counted.
pub fn bytes() -> u64 {
    BYTES.load(Ordering::Relaxed)
}

/// Limits the program to `most` bytes, or else to half of the machine's memory. Without either there is no
/// limit.
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

/// Counts an allocation, unless it failed.
fn taken(at: *mut u8, size: usize) -> *mut u8 {
    if !at.is_null() {
        BYTES.fetch_add(size as u64, Ordering::Relaxed);
    }
    at
}

fn freed(size: usize) {
    BYTES.fetch_sub(size as u64, Ordering::Relaxed);
}

// SAFETY: every call is passed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counted {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as of this function.
        taken(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        freed(layout.size());
        // SAFETY: as of this function.
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as of this function.
        taken(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: as of this function.
        let now = taken(unsafe { System.realloc(at, layout, size) }, size);
        if !now.is_null() {
            freed(layout.size());
        }
        now
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn bytes_count_an_allocation_until_it_is_freed() {
        let before = super::bytes();
        let much = std::hint::black_box(vec![1_u8; 64 << 20]);
        assert!(super::bytes() >= before + (60 << 20));
        drop(much);
        assert!(super::bytes() < before + (32 << 20));
    }
}
