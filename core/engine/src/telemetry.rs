//! Time spent in each node, and its limit.

use asperity_node::Fault;

use crate::panics::contain;

/// A clock handed in by the host; the engine has none of its own.
pub trait Clock {
    /// False lets the compiler remove all timing.
    const TIMES: bool = true;

    /// Nanoseconds since some fixed moment.
    fn now_ns(&self) -> u64;

    /// Called with the index of the node that runs next, so that a node that never returns can be
    /// named. Only where [`TIMES`](Self::TIMES) is true. Tick thread.
    fn enters(&self, _node: usize) {}
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

/// The clock, and the longest call of a node.
#[derive(Debug)]
pub(crate) struct Watch<'a, C> {
    pub(crate) clock: &'a C,
    pub(crate) limit_ns: Option<u64>,
}

impl<C: Clock> Watch<'_, C> {
    /// Runs a node's code. An overrun is detected only afterwards.
    pub(crate) fn call<T>(&self, f: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
        let Some(limit) = self.limit_ns.filter(|_| C::TIMES) else {
            return contain(f);
        };
        let before = self.clock.now_ns();
        let answer = contain(f)?;
        let late = self.clock.now_ns().saturating_sub(before) > limit;
        if late { Err(Fault::Overrun) } else { Ok(answer) }
    }
}
