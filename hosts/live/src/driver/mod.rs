//! Drivers call the ticks: from the audio callback itself, from a paced thread, or from a timer.
//!
//! A driver starts with a [`Ticker`] and returns it when it stops, so that the same run can go on under
//! another one: when a
//! device is lost, a timer takes over until the device is back. A driver with audio fades its output by a
//! [`Ramp`](crate::Ramp), and counts in [`Meters`] the samples that it could not play.

mod callback;
mod controls;
mod paced;
mod run;
mod sleep;
mod slot;
mod thread;
mod timer;

pub use callback::{Callback, CallbackHalf};
pub use controls::Controls;
pub use paced::{PacedHalf, paced};
pub use run::Rates;
pub(crate) use slot::Slot;
pub use thread::TickThread;
pub use timer::timer;

use std::sync::Arc;

use crate::RunControl;
use crate::meters::Meters;
use crate::output_limits::SharedLimits;
use crate::ramp::START_S;
use crate::realtime::PRIORITY;

/// A graph that runs tick by tick. No method may wait, allocate or log. A panic is caught and ends the
/// output.
pub trait Ticker: Send {
    /// Rates and channels of the run, which never change.
    fn rates(&self) -> Rates;

    /// Number of the next tick.
    fn next_tick(&self) -> u64;

    /// Runs the next tick. `time_ns`: when inputs are read, by [`now_ns`](crate::now_ns). `out`:
    /// interleaved samples of exactly
    /// this tick (`asperity_node::time::samples(next_tick, rate_hz, tick_hz)`), zeroed, to be filled.
    fn tick(&mut self, time_ns: u64, out: &mut [f32]);

    /// Skips `n` ticks.
    fn skip(&mut self, n: u64);
}

/// Clock of the ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The audio callback.
    Callback,
    /// A thread with evenly spaced ticks, steered by the callback's clock.
    Paced,
    /// A thread on the system's clock; no audio.
    Timer,
}

impl Clock {
    /// Its name: `callback`, `paced`, `timer`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Callback => "callback",
            Self::Paced => "paced",
            Self::Timer => "timer",
        }
    }
}

/// The requested clock. By default: the callback if the device's real period is at most one tick, a paced
/// thread if it is longer, a timer without a device (`period_frames` 0).
pub fn choose(asked: Option<Clock>, period_frames: u32, rate_hz: u32, tick_hz: u32) -> Clock {
    let fits = u64::from(period_frames) * u64::from(tick_hz) <= u64::from(rate_hz);
    match (asked, period_frames) {
        (Some(clock), _) => clock,
        (None, 0) => Clock::Timer,
        (None, _) if fits => Clock::Callback,
        (None, _) => Clock::Paced,
    }
}

/// Options of a driver.
#[derive(Clone, Debug)]
pub struct Options {
    /// SCHED_FIFO priority of the tick thread and the device's thread; `None` requests nothing.
    pub priority: Option<i32>,
    /// Seconds from silence to full at the start.
    pub start_s: f64,
    /// Period of the device in frames, for the paced driver; 0 measures it, and follows a device that calls
    /// in bunches.
    pub period_frames: u32,
    /// Period of the device in frames as measured before, to size the paced driver's ring; 0 if unknown.
    pub seen_frames: u32,
    /// Times and counts.
    pub meters: Arc<Meters>,
    /// Mutes and stops it.
    pub run_control: RunControl,
    /// Limits of the device's channels, if any.
    pub limits: Option<SharedLimits>,
}

impl Options {
    /// Options of a run for a person.
    pub fn new(meters: Arc<Meters>) -> Self {
        Self {
            priority: Some(PRIORITY),
            start_s: START_S,
            period_frames: 0,
            seen_frames: 0,
            meters,
            run_control: RunControl::default(),
            limits: None,
        }
    }
}

#[cfg(test)]
#[path = "testing.rs"]
mod testing;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clock_is_callback_up_to_a_period_of_one_tick() {
        assert_eq!(choose(None, 96, 48_000, 500), Clock::Callback);
        assert_eq!(choose(None, 97, 48_000, 500), Clock::Paced);
        assert_eq!(choose(None, 64, 48_000, 1_000), Clock::Paced);
        assert_eq!(choose(None, 0, 48_000, 500), Clock::Timer);
        assert_eq!(choose(Some(Clock::Callback), 1_024, 48_000, 500), Clock::Callback);
    }
}
