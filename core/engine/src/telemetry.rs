//! Time per node, for those who ask.

/// A clock handed in by the host; the engine has none of its own.
pub trait Clock {
    /// False lets the compiler leave all timing out.
    const TIMES: bool = true;

    /// Nanoseconds since some fixed moment.
    fn now_ns(&self) -> u64;
}

/// No clock: nothing is timed.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoClock;

impl Clock for NoClock {
    const TIMES: bool = false;

    fn now_ns(&self) -> u64 {
        0
    }
}
