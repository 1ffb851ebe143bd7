//! Real-time requests to the system, and their results.
//!
//! A run works without them. The request of an audio callback makes three system calls and allocates
//! nothing; texts for a person are made elsewhere from the numbers.

use std::fmt;
use std::fs::File;
use std::sync::OnceLock;

/// Default priority: below JACK's own threads of most set-ups, above all else.
pub const PRIORITY: i32 = 80;

/// Result of a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grant {
    /// Not requested.
    #[default]
    NotAsked,
    /// Granted, and checked afterwards.
    Granted,
    /// Refused with this error number; 0 if the system accepted it and did nothing.
    Refused(i32),
    /// Not available on this system.
    NotSupported,
}

impl Grant {
    /// Whether it was requested and not granted.
    pub fn missing(self) -> bool {
        matches!(self, Self::Refused(_) | Self::NotSupported)
    }
}

impl fmt::Display for Grant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAsked => f.write_str("not asked for"),
            Self::Granted => f.write_str("granted"),
            Self::Refused(0) => f.write_str("the system accepted it but did not do it"),
            Self::Refused(error) => write!(f, "{}", std::io::Error::from_raw_os_error(*error)),
            Self::NotSupported => f.write_str("not supported here"),
        }
    }
}

/// Results of all requests.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Grants {
    /// SCHED_FIFO for the tick thread, and for the device's if that is another.
    pub priority: Grant,
    /// Locked memory of the process.
    pub memory: Grant,
    /// /dev/cpu_dma_latency held at 0: cores do not sleep deeply.
    pub latency: Grant,
}

impl Grants {
    /// One line a refusal: what, why, and the setting that allows it. Allocates.
    pub fn refused(&self) -> Vec<String> {
        let all = [
            (
                self.priority,
                "real-time priority (SCHED_FIFO)",
                "put `@audio - rtprio 90` into /etc/security/limits.d/audio.conf, \
                 be in the group audio, and log in again",
            ),
            (
                self.memory,
                "memory locked (mlockall)",
                "put `@audio - memlock unlimited` into /etc/security/limits.d/audio.conf \
                 (`ulimit -l unlimited` for one shell)",
            ),
            (
                self.latency,
                "cores kept awake (/dev/cpu_dma_latency at 0)",
                "put `KERNEL==\"cpu_dma_latency\", GROUP=\"audio\", MODE=\"0660\"` \
                 into /etc/udev/rules.d/99-cpu-dma-latency.rules",
            ),
        ];
        let line = |(grant, what, allow): (Grant, &str, &str)| match grant {
            Grant::Refused(_) => Some(format!("{what}: {grant}; to allow it, {allow}")),
            Grant::NotSupported => Some(format!("{what}: {grant}")),
            _ => None,
        };
        all.into_iter().filter_map(line).collect()
    }
}

/// Requests for the whole process. When dropped, cores may sleep again; memory stays locked.
#[derive(Debug)]
pub struct Machine {
    memory: Grant,
    latency: Grant,
    _held: Option<File>,
}

impl Machine {
    /// Requests locked memory and waking cores. Control thread.
    pub fn ask() -> Self {
        let memory = os::lock_memory();
        let (latency, held) = os::hold_latency();
        Self { memory, latency, _held: held }
    }

    /// Results, with that of a thread's priority.
    pub fn grants(&self, priority: Grant) -> Grants {
        Grants { priority, memory: self.memory, latency: self.latency }
    }
}

/// Request of a real-time thread at its start; other threads read the result.
#[derive(Debug, Default)]
pub struct Asked(OnceLock<Grant>);

impl Asked {
    /// At the first call: requests the priority (`None` requests nothing) and touches `STACK` bytes of
    /// stack.
    pub fn once<const STACK: usize>(&self, priority: Option<i32>) {
        if self.0.get().is_none() {
            let _ = self.0.set(priority.map_or(Grant::NotAsked, ask_priority));
            touch_stack::<STACK>();
        }
    }

    /// Result; `NotAsked` before the thread ran.
    pub fn get(&self) -> Grant {
        self.0.get().copied().unwrap_or_default()
    }
}

/// Writes to every page of the next `STACK` bytes of stack, so that none is paged in later. No system call.
#[inline(never)]
pub fn touch_stack<const STACK: usize>() {
    let mut stack = [0_u8; STACK];
    std::hint::black_box(&mut stack);
}

pub use os::ask_priority;
pub(crate) use os::sleep_sharply;

#[cfg(target_os = "linux")]
mod os {
    use super::{File, Grant};
    use std::io::Write;

    fn errno() -> i32 {
        std::io::Error::last_os_error().raw_os_error().unwrap_or(0)
    }

    fn real_time() -> bool {
        // SAFETY: takes no pointer; 0 is the calling thread.
        let policy = unsafe { libc::sched_getscheduler(0) } & !libc::SCHED_RESET_ON_FORK;
        policy == libc::SCHED_FIFO || policy == libc::SCHED_RR
    }

    /// Requests SCHED_FIFO at a priority for the calling thread, and checks it. A thread that is real-time
    /// already keeps its state. Allocates nothing; at most three system calls. Any thread.
    pub fn ask_priority(priority: i32) -> Grant {
        if real_time() {
            return Grant::Granted;
        }
        let param = libc::sched_param { sched_priority: priority.clamp(1, 99) };
        // SAFETY: the calling thread exists, and `param` outlives the call.
        let error = unsafe { libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &param) };
        match error {
            0 if real_time() => Grant::Granted,
            error => Grant::Refused(error),
        }
    }

    /// Whether locking future memory cannot make a later allocation fail.
    fn unlimited() -> bool {
        let mut limit = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
        // SAFETY: `limit` is of the type that is filled.
        let known = unsafe { libc::getrlimit(libc::RLIMIT_MEMLOCK, &mut limit) } == 0;
        if known && limit.rlim_cur == libc::RLIM_INFINITY {
            return true;
        }
        // CAP_IPC_LOCK is bit 14 of the effective capabilities (capabilities(7)).
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let effective = status.lines().find_map(|l| l.strip_prefix("CapEff:"));
        let bits = effective.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok());
        bits.is_some_and(|bits| bits & (1 << 14) != 0)
    }

    pub(super) fn lock_memory() -> Grant {
        if !unlimited() {
            return Grant::Refused(libc::ENOMEM);
        }
        // SAFETY: takes no pointer.
        match unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) } {
            0 => Grant::Granted,
            _ => Grant::Refused(errno()),
        }
    }

    pub(super) fn hold_latency() -> (Grant, Option<File>) {
        let open = File::options().write(true).open("/dev/cpu_dma_latency");
        let held = open.and_then(|mut file| file.write_all(&0_i32.to_ne_bytes()).map(|()| file));
        match held {
            Ok(file) => (Grant::Granted, Some(file)),
            Err(e) => (Grant::Refused(e.raw_os_error().unwrap_or(0)), None),
        }
    }

    /// Sets the kernel's timer slack of this thread to its minimum; the default is 50 us without real-time
    /// priority.
    pub(crate) fn sleep_sharply() {
        // SAFETY: takes no pointer; concerns the calling thread alone.
        unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, 1) };
    }
}

#[cfg(not(target_os = "linux"))]
mod os {
    use super::{File, Grant};

    pub fn ask_priority(_: i32) -> Grant {
        Grant::NotSupported
    }

    pub(super) fn lock_memory() -> Grant {
        Grant::NotSupported
    }

    pub(super) fn hold_latency() -> (Grant, Option<File>) {
        (Grant::NotSupported, None)
    }

    pub(crate) fn sleep_sharply() {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusal_names_the_line_that_allows_it() {
        let grants =
            Grants { priority: Grant::Refused(1), memory: Grant::Granted, latency: Grant::NotSupported };
        let lines = grants.refused();
        assert_eq!(lines.len(), 2);
        assert!(
            lines[0].contains("@audio - rtprio 90") && lines[0].contains("not permitted"),
            "{}",
            lines[0]
        );
        assert!(lines[1].contains("not supported here"));
        assert!(Grants::default().refused().is_empty());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn granted_priority_is_what_the_system_reports() {
        let (grant, policy, slept) = std::thread::spawn(|| {
            let asked = Asked::default();
            assert_eq!(asked.get(), Grant::NotAsked);
            asked.once::<65_536>(Some(5));
            // SAFETY: takes no pointer.
            let policy = unsafe { libc::sched_getscheduler(0) };
            asked.once::<16>(None);
            (asked.get(), policy, ask_priority(5))
        })
        .join()
        .unwrap();
        assert_eq!(grant == Grant::Granted, policy == libc::SCHED_FIFO);
        assert_eq!(grant, slept, "a second request changes nothing");
        assert!(grant == Grant::Granted || matches!(grant, Grant::Refused(e) if e > 0), "{grant:?}");
    }
}
