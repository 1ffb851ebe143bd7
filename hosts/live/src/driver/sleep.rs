//! Sleeping until a time.

use crate::now_ns;

/// Sleeps until a time of [`now_ns`]. One system call and two readings of clocks.
#[cfg(target_os = "linux")]
pub(super) fn until(time_ns: u64) {
    let mut now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `now` is of the type that is filled.
    unsafe { libc::clock_gettime(libc::CLOCK_MONOTONIC, &mut now) };
    let left = time_ns.saturating_sub(now_ns());
    let at = now.tv_nsec as u64 + left;
    let at = libc::timespec {
        tv_sec: now.tv_sec + (at / 1_000_000_000) as libc::time_t,
        tv_nsec: (at % 1_000_000_000) as libc::c_long,
    };
    let sleep = || {
        // SAFETY: `at` outlives the call; no remainder is asked for.
        unsafe {
            libc::clock_nanosleep(libc::CLOCK_MONOTONIC, libc::TIMER_ABSTIME, &at, std::ptr::null_mut())
        }
    };
    // Woken by a signal, it sleeps on: the time is absolute.
    while left > 0 && sleep() == libc::EINTR {}
}

/// Sleeps until a time of [`now_ns`].
#[cfg(not(target_os = "linux"))]
pub(super) fn until(time_ns: u64) {
    std::thread::sleep(std::time::Duration::from_nanos(time_ns.saturating_sub(now_ns())));
}
